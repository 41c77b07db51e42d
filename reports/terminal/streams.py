"""Standard output and standard error that raise no error: a closed pipe or a full device costs what is printed there, and nothing else."""

import codecs
import io
import os
from typing import IO

STAND_INS = {"✓": "+", "✗": "X", "†": "#", "⏱": "T", "∞": "D", "·": ".", "–": "-", "µ": "u"}
"""Characters in the place of marks of outcomes, and of micro, that an encoding lacks: as different from each other, and as wide."""


def _stand_in(error: UnicodeError) -> tuple[str, int]:
    assert isinstance(error, UnicodeEncodeError)
    return "".join(STAND_INS.get(character, "?") for character in error.object[error.start : error.end]), error.end


codecs.register_error("stand-in", _stand_in)


class _Unfailing(io.TextIOWrapper):
    """A stream that leads to the null device from the first error on."""

    error: OSError | None = None

    def write(self, text: str) -> int:
        try:
            return super().write(text)
        except OSError as error:
            self._drop(error)
            return len(text)

    def flush(self) -> None:
        try:
            super().flush()
        except OSError as error:
            self._drop(error)

    def _drop(self, error: OSError) -> None:
        self.error = self.error or error
        with open(os.devnull, "w", encoding="utf-8") as null:
            os.dup2(null.fileno(), self.fileno())  # also for what is in a buffer, which Python writes again at the end


def unfailing(stream: IO[str]) -> IO[str]:
    """The stream of an open file without its errors, of which `error_of` has the first one.

    A character that it cannot encode becomes its stand-in, or else a question mark. Any other stream, such as one in memory, is returned
    unchanged.
    """
    if not isinstance(stream, io.TextIOWrapper):
        return stream
    try:
        os.set_blocking(stream.fileno(), True)  # another process may have set it not to wait for a slow reader
    except OSError:  # of a stream in memory
        stream.reconfigure(errors="stand-in")
        return stream
    file = open(stream.fileno(), "wb", closefd=False)  # noqa: SIM115 - until the end of the process
    return _Unfailing(file, stream.encoding, "stand-in", line_buffering=stream.line_buffering)


def error_of(stream: IO[str]) -> OSError | None:
    """The first error of a stream that `unfailing` returned."""
    if isinstance(stream, _Unfailing):
        stream.flush()
        return stream.error
    return None
