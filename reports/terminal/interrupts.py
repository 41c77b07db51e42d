"""Handlers of Ctrl-C, SIGTERM and SIGHUP; they record interrupts, which stop a command even if a callback suppresses the exception."""

import signal
import sys

from dropspin.comparisons.results.interrupts import INTERRUPTS

_interrupts: list[int] = []


def handle_interrupts() -> None:
    """Treat other interrupts like Ctrl-C from now on, so that unfinished files are removed; record them."""
    for number in INTERRUPTS:
        if number in (signal.SIGINT, signal.SIGTERM) or signal.getsignal(number) is not signal.SIG_IGN:  # which nohup sets for SIGHUP
            signal.signal(number, _interrupt)
    sys.unraisablehook = _report_unless_interrupted


def stop_if_interrupted() -> None:
    """Raise a recorded interrupt again, because callbacks of engines and of the compiler suppress exceptions."""
    if _interrupts:
        raise KeyboardInterrupt


def _interrupt(number: int, frame: object) -> None:
    _interrupts.append(number)
    raise KeyboardInterrupt


def _report_unless_interrupted(unraisable: "sys.UnraisableHookArgs") -> None:
    """Report an exception that Python cannot raise, unless it is an interrupt, which `stop_if_interrupted` raises again."""
    if not isinstance(unraisable.exc_value, KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)
