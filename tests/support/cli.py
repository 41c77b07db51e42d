"""The command line in tests: in this process, which costs no start, or in a process of its own.

`dropspin` serves all tests but those that need a process: signals, exit codes as a shell sees them, a closed pipe, an installation.
"""

import contextlib
import importlib
import io
import os
import signal
import subprocess
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import TextIO
from unittest import mock

from pebble import ProcessPool

from dropspin.comparisons.results.interrupts import INTERRUPTS

TERMINAL = {"FORCE_COLOR": "1", "TERM": "dumb"}
"""The environment in which output is that of a terminal of 80 columns, without colours."""
DROPSPIN = Path(sys.executable).with_name("dropspin")


@dataclass(frozen=True)
class Done:
    """The outcome of a command; the names are those of `subprocess.CompletedProcess`."""

    returncode: int
    stdout: str
    stderr: str


def dropspin(*arguments: object, cwd: Path | str, stdout: TextIO | None = None, stderr: TextIO | None = None, **environment: str) -> Done:
    """Run a command in this process, with `cwd` as the working directory; engines run in processes of their own, as always.

    Its output goes to `stdout` and `stderr`, or into the result.
    """
    from dropspin.reports.commands.main import main

    out, err = io.StringIO(), io.StringIO()
    code: object = 0
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.chdir(cwd))
        stack.enter_context(mock.patch.dict(os.environ, {"COLUMNS": "80", **environment}))
        stack.enter_context(mock.patch.object(sys, "argv", ["dropspin", *map(str, arguments)]))
        stack.enter_context(_unchanged_handlers())
        stack.enter_context(_without_modules_of(Path(cwd)))
        stack.enter_context(contextlib.redirect_stdout(stdout or out))
        stack.enter_context(contextlib.redirect_stderr(stderr or err))
        try:
            main()
        except SystemExit as end:
            code = end.code
    return Done(code if isinstance(code, int) else 0 if code is None else 1, out.getvalue(), err.getvalue())


def forked(*arguments: object, cwd: Path | str, timeout: float = 60.0) -> Done:
    """As `dropspin`, in a fork of this process, which is killed after a time [s]; it costs no imports, as `spawn` does."""
    with ProcessPool(max_workers=1, context=get_context("fork")) as pool:
        return pool.schedule(dropspin, args=arguments, kwargs={"cwd": cwd}, timeout=timeout).result()


class Started:
    """A command in a fork of this process, to be interrupted: its errors can be read while it works. It costs no imports."""

    def __init__(self, *arguments: object, cwd: Path | str) -> None:
        reader, writer = os.pipe()
        self._process = get_context("fork").Process(target=_as_in_a_shell, args=(arguments, cwd, writer))
        self._process.start()
        os.close(writer)
        self.stderr = os.fdopen(reader)
        assert self._process.pid is not None
        self.pid = self._process.pid

    def is_alive(self) -> bool:
        """Whether it still works."""
        return self._process.is_alive()

    def end(self, how: int | None = None, timeout: float = 60.0) -> tuple[int | None, str]:
        """Send it a signal, if one is given, and wait for its end: its exit code, and the errors that were not read."""
        if how is not None:
            os.kill(self.pid, how)
        with self.stderr:
            errors = self.stderr.read()
        self._process.join(timeout)
        return self._process.exitcode, errors


def _as_in_a_shell(arguments: tuple[object, ...], cwd: Path | str, errors: int) -> None:
    """Run a command with its errors written to a file descriptor and without its output."""
    from dropspin.reports.commands.main import main

    warnings.simplefilter("ignore", ResourceWarning)  # as outside tests: earlier ones may have left files open, which end here
    os.chdir(cwd)
    os.dup2(errors, 2)
    sys.stdout, sys.stderr = os.fdopen(os.open(os.devnull, os.O_WRONLY), "w"), os.fdopen(2, "w", buffering=1, closefd=False)
    sys.argv = ["dropspin", *map(str, arguments)]
    main()


def assert_refused(done: Done, words: str) -> None:
    """Verify that a command ended with exit code 2 and one line, which has these words."""
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    [line] = done.stderr.splitlines()
    assert line.startswith("dropspin: ")
    assert words in line


def spawn(*arguments: object, cwd: Path | str, timeout: float = 300.0, **environment: str) -> "subprocess.CompletedProcess[str]":
    """Run the installed command in a process of its own."""
    return subprocess.run(
        [DROPSPIN, *map(str, arguments)],
        cwd=cwd,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


@contextlib.contextmanager
def _unchanged_handlers() -> Iterator[None]:
    """Put back the signal handlers and the hook that the command line sets."""
    handlers = {one: signal.getsignal(one) for one in INTERRUPTS}
    hook = sys.unraisablehook
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for one, handler in handlers.items():
            signal.signal(one, handler)


@contextlib.contextmanager
def _without_modules_of(folder: Path) -> Iterator[None]:
    """Forget, afterwards, modules that were imported from a folder: another test's `my_engine` is another engine."""
    importlib.invalidate_caches()
    here, before = os.path.realpath(folder) + os.sep, set(sys.modules)
    try:
        yield
    finally:
        for name in set(sys.modules) - before:
            if str(getattr(sys.modules[name], "__file__", "")).startswith(here):
                del sys.modules[name]
