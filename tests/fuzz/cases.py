"""One case: a command in surroundings of its own, and what must hold after every command."""

import contextlib
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any
from unittest import mock

import psutil
from support.cli import Done, dropspin, spawn

CODES = {0, 1, 2, 3}
"""The allowed exit codes; 130 is that of an interrupt, and 70 that of an internal error, of which there is none here."""
TIME = 300
"""After so many seconds a command counts as one that hangs."""
LINES, LENGTH = 3, 2000
"""The largest message of exit code 2, besides what it repeats of the command line."""


class Hung(Exception):
    """A command that did not end in time."""


@contextlib.contextmanager
def surroundings() -> Iterator[Path]:
    """An empty working directory, with an empty home and an empty folder for temporary files beside it."""
    with tempfile.TemporaryDirectory(prefix="dropspin-fuzz-") as root:
        for name in ("work", "home", "temporary"):
            (Path(root) / name).mkdir()
        yield Path(root) / "work"


def fill(work: Path, sound: Path) -> None:
    """Copy sound inputs into a working directory."""
    shutil.copytree(sound, work, dirs_exist_ok=True)


def run(work: Path, *arguments: object, outputs: Iterable[str]) -> Done:
    """Run a command in this process, and verify what holds for every command.

    Args:
        work: The working directory, from `surroundings`.
        arguments: Those of the command.
        outputs: The paths, relative to the working directory, that it may write.
    """
    places = {"HOME": str(work.parent / "home"), "TMPDIR": str(work.parent / "temporary")}
    with mock.patch.object(tempfile, "tempdir", places["TMPDIR"]), mock.patch.object(sys, "dont_write_bytecode", True):
        return _verified(lambda: dropspin(*arguments, cwd=work, **places), work, arguments, outputs)


def run_alone(work: Path, *arguments: object, outputs: Iterable[str]) -> Done:
    """The same in a process of its own, which finds an empty home."""
    places = {"HOME": str(work.parent / "home"), "TMPDIR": str(work.parent / "temporary"), "PYTHONDONTWRITEBYTECODE": "1"}

    def call() -> Done:
        done = spawn(*arguments, cwd=work, **places)
        return Done(done.returncode, done.stdout, done.stderr)

    return _verified(call, work, arguments, outputs)


def _verified(call: Callable[[], Done], work: Path, arguments: tuple[object, ...], outputs: Iterable[str]) -> Done:
    files, processes = _files(work.parent), set(psutil.Process().children(recursive=True))
    with _alarm() as alarms:
        done = call()
    left = _left(processes)
    after = _files(work.parent)
    written = {path for path, _ in files.items() ^ after.items()}
    allowed = [os.path.normpath(work / output) for output in outputs]
    outside = {path for path in written if not any(f"{path}/".startswith(f"{one}/") or one.startswith(f"{path}/") for one in allowed)}
    problems = {
        "it hangs": bool(alarms),
        f"exit code {done.returncode}": done.returncode not in CODES,
        "a traceback": "Traceback (most recent call last)" in done.stderr + done.stdout,
        f"output that is not printable: {_unprintable(done)!a}": bool(_unprintable(done)),
        "a long message": done.returncode == 2 and not _is_short(done.stderr, arguments),
        f"processes left: {left}": bool(left),
        f"files outside of the output: {sorted(outside)}": bool(outside),
        "unfinished files left": any("unfinished-" in path for path in after.keys() - files.keys()),
    }
    found = [problem for problem, is_one in problems.items() if is_one]
    command = " ".join(map(ascii, arguments))
    assert not found, f"{'; '.join(found)}\nof: dropspin {command}\n{done.stdout[-2000:]}\n{done.stderr[-6000:]}"
    return done


def _files(folder: Path) -> dict[str, Any]:
    """By path, what changes when a file is written."""
    found: dict[str, Any] = {}
    for place, folders, files in os.walk(folder):
        for name in files + folders:
            path = os.path.join(place, name)
            stat = os.lstat(path)
            found[path] = "folder" if name in folders else (stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_mode)
    return found


def _left(before: set[psutil.Process]) -> list[str]:
    """The names of processes that are there and were not before; they are ended. Orphans become children of this process: `conftest.py`."""
    _, alive = psutil.wait_procs(set(psutil.Process().children(recursive=True)) - before, timeout=10.0)
    for process in alive:
        process.kill()
    return [process.name() for process in alive]


def _unprintable(done: Done) -> str:
    return "".join(one for one in done.stdout + done.stderr if not one.isprintable() and one not in "\n\t")[:20]


def _is_short(text: str, arguments: tuple[object, ...]) -> bool:
    """Whether a message has at most three lines, besides progress and usage."""
    _, found, message = text.rpartition("dropspin: " if "dropspin: " in text else "Error: ")
    return bool(found) and message.count("\n") <= LINES and len(message) <= LENGTH + sum(map(len, map(str, arguments)))


@contextlib.contextmanager
def _alarm() -> Iterator[list[int]]:
    """Raise an exception in a command that hangs, and list the alarm, as the exception may be caught."""
    alarms: list[int] = []

    def hung(number: int, frame: FrameType | None) -> None:
        alarms.append(number)
        raise Hung

    before = signal.signal(signal.SIGALRM, hung)
    signal.alarm(TIME)
    try:
        yield alarms
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
