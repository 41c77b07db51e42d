"""Compiled loops over `step.advance`, one for each choice of methods, cached on disk.

numba's own cache looks at the file of the compiled function alone and would serve old physics after an edit elsewhere in this package.
So kernels are kept in a folder named after everything that goes into them.
"""

import hashlib
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba import njit
from numba.core import config as numba_config

from reference_impl.methods import CONTACTS, CORRECTIONS, LAWS, ROTATIONS, Methods
from reference_impl.step import advance
from reference_impl.vectors import Quat, Vec3

config: Any = numba_config  # numba sets its attributes at run time, which its type hints do not know
PACKAGE = Path(__file__).parent


@cache
def recording_kernel(methods: Methods, rotates: bool) -> Callable[..., int]:
    """The loop that fills rows with each `every`-th state and counts the steps whose contact was not solved."""
    turn = ROTATIONS[methods.rotation] if rotates else None
    law = LAWS[methods.law]
    collide = CONTACTS[methods.contact][methods.law]
    correct = CORRECTIONS[methods.correction]

    def fill(rows, state, dt, every, body, gravity, forces, damping, floor):
        x = Vec3(float(state[0]), float(state[1]), float(state[2]))
        q = Quat(float(state[3]), float(state[4]), float(state[5]), float(state[6]))
        v = Vec3(float(state[7]), float(state[8]), float(state[9]))
        w = Vec3(float(state[10]), float(state[11]), float(state[12]))
        rows[0] = state
        unsolved = 0
        for row in range(1, rows.shape[0]):
            for _ in range(every):
                x, q, v, w, solved = advance(x, q, v, w, dt, body, gravity, forces, damping, floor, turn, collide, law, correct)
                unsolved += not solved
            out = rows[row]
            out[0], out[1], out[2] = x.x, x.y, x.z
            out[3], out[4], out[5], out[6] = q.x, q.y, q.z, q.w
            out[7], out[8], out[9] = v.x, v.y, v.z
            out[10], out[11], out[12] = w.x, w.y, w.z
        return unsolved

    return compile_cached(fill)


def compile_cached(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel: IEEE rules (1/0 is inf), no reassociation, Python's lock let go, kept on disk where that can be written."""
    with _cache_folder() as writable:
        return njit(nogil=True, error_model="numpy", cache=writable)(function)


@contextmanager
def _cache_folder() -> Iterator[bool]:
    """Point numba at this package's own folder while a kernel is declared; the user's setting is left as it was."""
    kept = config.CACHE_DIR
    base = Path(kept) if kept else PACKAGE / "__pycache__"
    folder = base / f"dropspin-{_fingerprint()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        config.CACHE_DIR = str(folder)
        yield os.access(folder, os.W_OK)
    except OSError:
        yield False
    finally:
        config.CACHE_DIR = kept


@cache
def _fingerprint() -> str:
    """A hash of every source file of the package, of numba's version and of its settings in the environment."""
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(PACKAGE.rglob("*.py")):
        digest.update(str(source.relative_to(PACKAGE)).encode() + b"\0" + source.read_bytes())
    for name in sorted(os.environ):
        if name.startswith("NUMBA_") and name != "NUMBA_CACHE_DIR":
            digest.update(f"{name}={os.environ[name]}".encode())
    return digest.hexdigest()[:16]
