"""An engine that is a program in any language: it reads a scene and requests on its standard input, and answers with states.

A line is a word and numbers. The scene comes first, up to `start`, which the program answers with its state; `advance n` asks for n more
steps, and for the state after them. A state is a line of 13 numbers. The program ends at the end of its input. docs/course.md has examples.
"""

import hashlib
import inspect
import math
import os
import shutil
import signal
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from functools import cache
from os.path import isfile  # of a part that cannot be a path, too, such as a script that is an argument
from pathlib import Path
from select import select
from subprocess import PIPE, Popen, TimeoutExpired
from tempfile import TemporaryFile
from typing import ClassVar

import numpy as np

from dropspin.comparisons.engines.base import Array, Engine, Simulation
from dropspin.comparisons.engines.exceptions import ProgramError, TimedOut, ended_with
from dropspin.scenarios import Scenario
from dropspin.scenarios.text import counted
from dropspin.scenarios.validation import shown

PATIENCE, PATIENCE_OF_A_STEP = 10.0, 1.0
"""Wall times for an answer, and for each of its steps in a slow interpreter [s].

A program that keeps its answer in a buffer waits for the next request, and dropspin for the answer.
"""
POLL = 0.2
"""Between looks at whether the program has ended [s]."""
_most_patience = [math.inf]
"""The wall time that an answer may take in any case [s]."""


def limit_patience(seconds: float) -> None:
    """Wait for an answer of a program at most so long, in this process [s]."""
    _most_patience[:] = [seconds]


class ProgramEngine(Engine):
    """An engine that runs as a separate program. A subclass must define `name` and `program`.

    Attributes:
        options: The options that differ from the defaults; a program has none unless the subclass declares `choices`.
        program: The command and its arguments. A file in the folder of the class's module can be given by its name alone.
    """

    program: ClassVar[Sequence[str]]
    lag: ClassVar[float] = 0.5
    """The time by which velocity lags position, in time steps: half a step under semi-implicit Euler, as in Algorithm 1."""
    shapes, takes_offsets = ("sphere", "box", "capsule", "vertices", "mesh"), True

    def declines(self, scene: Scenario) -> str | None:
        return "the adapter passes on no floor that ends" if scene.floor is not None and scene.floor.ends else None

    @classmethod
    def command(cls) -> list[str]:
        """`program`, with the paths of files in the folder of the class's module, and that of a command on the system's search path.

        Raises:
            TypeError: `program` is not a sequence of strings.
        """
        if isinstance(cls.program, str) or not cls.program:
            raise TypeError(f'`program` is {shown(cls.program)}; give the command and its arguments, such as ("./solver",)')
        folder = cls._folder()
        first, *others = [str(folder / part) if isfile(folder / part) else part for part in cls.program]
        return [shutil.which(first) or first, *others]

    @classmethod
    def _folder(cls) -> Path:
        return Path(inspect.getfile(cls)).resolve().parent

    @classmethod
    def _stated(cls) -> str:
        """The command for the settings, which `check` compares with those of other checkouts: no path begins with a folder of this one."""
        folder = cls._folder()

        def stated(part: str) -> str:
            path = folder / part
            if not isfile(path):
                return part
            return str(path.relative_to(folder)) if path.is_relative_to(folder) else path.name

        return " ".join(map(stated, cls.program))

    def prepare(self, scene: Scenario, dt: float) -> "ProgramSimulation":
        return ProgramSimulation(scene, dt, self.command(), self._stated(), self.lag * dt)


class ProgramSimulation(Simulation):
    """A process of the program, for one scene."""

    def __init__(self, scene: Scenario, dt: float, command: Sequence[str], stated: str, velocity_lag: float) -> None:
        self.velocity_lag = velocity_lag
        files = [(part, os.stat(part)) for part in command if isfile(part)]
        version = _hash(tuple((part, found.st_mtime_ns, found.st_size) for part, found in files))
        self.settings = {"program": stated} | ({"version": version} if files else {})
        with ExitStack() as opened:
            self._errors = opened.enter_context(TemporaryFile())
            try:
                self._process = opened.enter_context(Popen(command, bufsize=0, stdin=PIPE, stdout=PIPE, stderr=self._errors))
            except OSError as error:
                raise ProgramError(f"{command[0]!r} cannot be started: {error.strerror}; `program` is {list(command)}") from None
            opened.callback(self._process.kill)
            self._unread = b""
            self._state = self._ask("start", "\n".join(scene_lines(scene, dt)), PATIENCE)
            self._opened = opened.pop_all()

    def advance(self, steps: int) -> None:
        if steps:
            request = f"advance {steps}"
            self._state = self._ask(request, request, PATIENCE + steps * PATIENCE_OF_A_STEP)

    def state(self) -> Array:
        return self._state.copy()

    def close(self) -> None:
        self._opened.close()

    def _ask(self, asked: str, lines: str, patience: float) -> Array:
        """The state that the program answers with, within a wall time [s], shape (13,)."""
        requests = self._process.stdin
        assert requests is not None
        self._unread += self._written(0.0) or b""
        if self._unread:  # which would be taken for the answer to this request
            raise ProgramError(f"the program wrote {shown(self._unread.decode(errors='replace'))} before {asked!r}; an answer is one line")
        with suppress(BrokenPipeError):  # the program ended, so that there is no answer
            requests.write(f"{lines}\n".encode())
        patience, most = min(patience, *_most_patience), "" if patience < _most_patience[0] else ", the time limit"
        end = time.monotonic() + patience
        while b"\n" not in self._unread:
            has_ended = self._process.poll() not in (None, 0)  # its children may hold its output open, or be the solver
            written = self._written(0.0 if has_ended else max(0.0, min(POLL, end - time.monotonic())))
            if written is None and not has_ended:
                if time.monotonic() < end:
                    continue
                raise TimedOut(f"the program did not answer {asked!r} within {patience:g} s{most}; does it flush its output?")
            if not written:
                end_of_program = self._end()
                if self._process.returncode == -signal.SIGXCPU:
                    raise TimedOut(f"the program did not answer {asked!r} within the processor time that it may use, the time limit")
                raise RuntimeError(f"the program {end_of_program} instead of answering {asked!r}")
            self._unread += written
        line, _, self._unread = self._unread.partition(b"\n")
        answer = line.decode(errors="replace").rstrip()
        try:
            numbers = np.array([float(word) for word in answer.split()])
        except ValueError:
            numbers = np.empty(0)
        if numbers.shape != (13,):
            found = f"{shown(answer)}, {counted(len(answer.split()), 'word')}"
            raise ProgramError(f"the program answered {asked!r} with {found}; a state is a line of 13 numbers")
        return numbers

    def _written(self, patience: float) -> bytes | None:
        """What the program has written and is not read yet, within a wall time [s]: None if nothing, empty if it ended."""
        answers = self._process.stdout
        assert answers is not None
        return answers.read(1 << 16) if select([answers], [], [], patience)[0] else None

    def _end(self) -> str:
        """How the program ended, and the last line of its standard error."""
        try:
            code = self._process.wait(PATIENCE_OF_A_STEP)
        except TimeoutExpired:
            return "closed its output"
        self._errors.seek(0)
        lines = self._errors.read().decode(errors="replace").splitlines()
        return f"ended with {ended_with(code)}" + (f" and the last line {shown(lines[-1])}" if lines else "")


@cache
def _hash(files: tuple[tuple[str, int, int], ...]) -> str:
    """A short hash of the content of files with times of change and sizes: an interpreter of 100 MB is not read for each simulation."""
    return hashlib.sha256(b"".join(Path(path).read_bytes() for path, _, _ in files)).hexdigest()[:12]


def scene_lines(scene: Scenario, dt: float) -> Iterator[str]:
    """A scene at a time step [s] as the lines that a program reads."""
    body, rates = scene.body, scene.damping.rates.values() if scene.damping else (0.0, 0.0)
    yield _line("dt", [dt])
    yield _line("mass", [body.mass])
    yield _line("inertia", body.inertia_tensor.ravel())
    yield _line("gravity", scene.acceleration)
    yield _line("damping", np.exp(-dt * np.array([*rates])))
    if scene.floor is not None:
        yield _line("floor", [scene.floor.restitution, scene.floor.coefficient, scene.floor.rest_speed])
    for wall in scene.wall or ():
        yield _line("wall", [*wall.point, *wall.normal, wall.restitution, wall.coefficient, wall.rest_speed])
    yield _line("radius", body.semi_axes[:1])
    yield f"vertices {len(body.vertices)}"
    for vertex in body.vertices:
        yield _line("vertex", vertex)
    yield _line("start", scene.initial_state)


def _line(word: str, numbers: Sequence[float] | Array) -> str:
    return " ".join([word, *(repr(float(number)) for number in numbers)])
