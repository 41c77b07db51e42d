"""An exception of an adapter as text, which may be anything, or raise; how a process ended; and exceptions of engines."""

from signal import Signals

from dropspin.scenarios.text import printable

LONGEST = 1000


class ProgramError(RuntimeError):
    """Raised if a program cannot be started, or answers with something else than a state, which has nothing to do with the scene."""


class TimedOut(Exception):
    """Raised if an engine does not answer in time; the message says what was asked, and how long it may take."""


def described(error: BaseException) -> str:
    """The type and the text of an exception in one line that any stream and file can take."""
    try:
        text = " ".join(str(error).split())
    except Exception as another:  # an adapter's exception may raise in its own __str__
        text = f"its text cannot be made, {type(another).__name__}"
    if isinstance(error, MemoryError):
        text = " ".join(filter(None, [text, "(the engine's process may not use more memory)"]))
    return short(f"{type(error).__name__}: {text}" if text else type(error).__name__)


def short(text: str) -> str:
    """A text in printable characters, at most 1,000."""
    return printable(text[:LONGEST])


def ended_with(code: int) -> str:
    """What ended a process, by the code that it returned: a signal, which has no name if it is one of real time, or an exit code."""
    if code >= 0:
        return f"exit code {code}"
    return Signals(-code).name if -code in map(int, Signals) else f"signal {-code}"
