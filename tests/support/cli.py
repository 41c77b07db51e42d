"""The command line in tests: in this process, which takes no time to start, or in one of its own."""

import contextlib
import io
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

DROPSPIN = Path(sys.executable).with_name("dropspin")


@dataclass(frozen=True)
class Done:
    """What a command left: the same names as `subprocess.CompletedProcess`."""

    returncode: int
    stdout: str
    stderr: str


def dropspin(*arguments: object, cwd: Path | str, **environment: str) -> Done:
    """Run a command in this process; engines run in processes of their own, as ever."""
    from reports.commands.main import main

    out, err = io.StringIO(), io.StringIO()
    code: object = 0
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.chdir(cwd))
        stack.enter_context(mock.patch.dict(os.environ, {"COLUMNS": "80", **environment}))
        stack.enter_context(mock.patch.object(sys, "argv", ["dropspin", *map(str, arguments)]))
        stack.enter_context(mock.patch.object(sys, "path", [*sys.path, os.fspath(cwd)]))
        stack.enter_context(_unchanged_handlers())
        stack.enter_context(contextlib.redirect_stdout(out))
        stack.enter_context(contextlib.redirect_stderr(err))
        try:
            main()
        except SystemExit as end:
            code = end.code
    return Done(code if isinstance(code, int) else 0 if code is None else 1, out.getvalue(), err.getvalue())


def spawn(*arguments: object, cwd: Path | str, timeout: float = 300.0, **environment: str) -> "subprocess.CompletedProcess[str]":
    """Run the installed command in a process of its own: for exit codes, signals, and what an installation needs."""
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
    handlers = {one: signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM)}
    hook = sys.unraisablehook
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for one, handler in handlers.items():
            signal.signal(one, handler)
