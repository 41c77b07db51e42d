"""Ctrl-C, and a request to end: heeded wherever they arrive."""

import signal
import sys

_interrupts: list[int] = []


def heed_interrupts() -> None:
    """From now on SIGTERM is like Ctrl-C, so that nothing unfinished is left behind, and neither is lost."""
    for one in (signal.SIGINT, signal.SIGTERM):
        signal.signal(one, _interrupt)
    sys.unraisablehook = _tell_unless_interrupted


def stop_if_interrupted() -> None:
    """Raise the interrupt again: one that arrives within a callback of an engine or of the compiler is swallowed there."""
    if _interrupts:
        raise KeyboardInterrupt


def _interrupt(number: int, frame: object) -> None:
    _interrupts.append(number)
    raise KeyboardInterrupt


def _tell_unless_interrupted(found: "sys.UnraisableHookArgs") -> None:
    """Say what went wrong where nothing can be raised; an interrupt that came there is not lost, see `stop_if_interrupted`."""
    if not isinstance(found.exc_value, KeyboardInterrupt):
        sys.__unraisablehook__(found)
