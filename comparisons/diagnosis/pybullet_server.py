"""PyBullet's physics server in this process: what it holds, and the loading of URDF files with what it prints about them."""

import ctypes
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from dropspin.comparisons.engines.pybullet_simulation import Connection
from dropspin.scenarios import DropspinError


class Server(Connection):
    """A physics server, and what it holds.

    Attributes:
        holds: The body whose world it holds, and whether that has a surface.
        numbers: Of the body and of the surface.
    """

    def __init__(self) -> None:
        super().__init__()
        self.holds: object = None
        self.numbers = (-1, -1)

    def clear(self) -> None:
        """Remove all; files that changed are read again."""
        self.holds = None
        self.resetSimulation()
        self.setPhysicsEngineParameter(enableFileCaching=0)


@cache
def server() -> Server:
    """The physics server of this process."""
    return Server()


def load(given: str, file: str, flags: int = 0, *, remedy: str = "") -> int:
    """Load a URDF file, or the text of one, and return the number of the body.

    Args:
        given: Its name for messages.
        file: The path, or the text.
        flags: Those of PyBullet.
        remedy: What a message says after the reason if a file is not found.

    Raises:
        DropspinError: PyBullet does not load it, with what it printed.
    """
    bullet = server()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "model.urdf") if file.startswith("<") else Path(file)
        if file.startswith("<"):
            path.write_text(file, encoding="utf-8")
        said = Path(folder, "said")
        with said.open("wb") as there, _printing_to(there.fileno()), suppress(bullet.module.error):
            return int(bullet.loadURDF(str(path), flags=flags))
        text = said.read_text(encoding="utf-8", errors="replace")
    said_of = re.findall(r"b3(Error|Warning|Printf)\[[^]]*\]:(.*?)(?=b3(?:Error|Warning|Printf)\[|$)", text, re.DOTALL)
    pieces = [" ".join(piece.split()) for kind, piece in said_of if kind == "Error" or "cannot find" in piece]
    reason = "; ".join(pieces).replace(":;", ":")
    end = remedy if "cannot find" in reason else ""
    raise DropspinError(f"{given}: PyBullet does not load it: {reason or 'it gives no reason'}{end}.")


@contextmanager
def _printing_to(file: int) -> Iterator[None]:
    """Send what this process prints, PyBullet's C++ included, to a file."""
    flush = ctypes.CDLL(None).fflush
    sys.stdout.flush()
    sys.stderr.flush()
    flush(None)
    kept = [os.dup(stream) for stream in (1, 2)]
    for stream in (1, 2):
        os.dup2(file, stream)
    try:
        yield
    finally:
        flush(None)
        for stream, old in zip((1, 2), kept, strict=True):
            os.dup2(old, stream)
            os.close(old)
