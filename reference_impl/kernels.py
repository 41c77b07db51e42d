"""Compiled loops over `step.advance`, one for each choice of methods and parts, cached on disk.

numba invalidates its cache by the file of the compiled function alone, so an edit elsewhere in this package would leave stale kernels in
use. The cache is therefore a folder named after a hash of everything that goes into the kernels. Functions of one name share one index,
in which two processes that compile different kernels at the same time may store one as the other: each kernel has a name of its own, and
each type of processor a folder.
"""

import hashlib
import os
import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import llvmlite
import numba
from llvmlite.binding import get_host_cpu_name
from numba import njit
from numba.core import config as numba_config

from dropspin.reference_impl import sources
from dropspin.reference_impl.methods import COLLIDE, LAWS, ROTATIONS, Methods
from dropspin.reference_impl.parameters import (
    DAMPING,
    FLOOR,
    GRAVITY,
    SEMI_AXES,
    STEP_SIZE,
    read_body,
    read_damping,
    read_floor_with_edges,
    read_nothing,
    read_quaternion,
    read_surface,
    read_vector,
)
from dropspin.reference_impl.step import advance
from dropspin.reference_impl.vectors import compiled

config: Any = numba_config  # numba sets its attributes at run time, which its type hints do not know
COMPILER_SETTINGS = ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "CPU_NAME", "CPU_FEATURES", "ENABLE_AVX", "DEBUGINFO_DEFAULT")
MAX_CACHE_FOLDERS = 8


@dataclass(frozen=True)
class Parts:
    """The parts that are modelled; the others are left out of the compiled step."""

    gravity: bool
    forces: bool
    damping: bool
    floor: bool
    turning: bool
    ellipsoids: bool = False
    rims: bool = False
    edges: bool = False
    walls: int = 0
    many_points: bool = False


@cache
def recording_kernel(methods: Methods, parts: Parts) -> Callable[..., int]:
    """The loop that records each `every`-th state of some bodies, and counts the steps whose contact did not converge."""
    gravity_of = read_vector if parts.gravity else read_nothing
    damping_of = read_damping if parts.damping else read_nothing
    floor_of = (read_floor_with_edges if parts.edges else read_surface) if parts.floor else read_nothing
    turn = ROTATIONS[methods.rotation].turn if parts.turning else None
    touches = parts.floor or parts.walls > 0  # otherwise methods that differ in contacts alone have one kernel
    used = parts.turning and methods.rotation, touches and (methods.contact, methods.law), parts
    law = LAWS[methods.law].impulse if touches else None
    collide = COLLIDE[methods.contact][methods.law] if touches else None
    walls_of, wall_count = _walls_of if parts.walls else read_nothing, parts.walls
    forces_of = _of_body if parts.forces else read_nothing
    many_points_of = _of_body if parts.many_points else read_nothing
    semi_axes_of, has_rims = read_vector if parts.ellipsoids else read_nothing, parts.rims

    def fill(recorded, states, columns, points, many_points, forces, every, first, last):
        unsolved = 0
        for number in range(first, last):
            numbers = columns[min(number, columns.shape[0] - 1)]
            semi_axes = semi_axes_of(numbers, SEMI_AXES)
            body = read_body(numbers, _of_body(points, number), semi_axes, has_rims, many_points_of(many_points, number))
            dt = float(numbers[STEP_SIZE])
            gravity = gravity_of(numbers, GRAVITY)
            damping = damping_of(numbers, DAMPING)
            floor = floor_of(numbers, FLOOR)
            walls = walls_of(numbers, wall_count)
            on_vertices = forces_of(forces, number)
            start = states[number]
            x = read_vector(start, 0)
            q = read_quaternion(start, 3)
            v = read_vector(start, 7)
            w = read_vector(start, 10)
            _record(recorded[number, 0], x, q, v, w)
            for row in range(1, recorded.shape[1]):
                for _ in range(every):
                    x, q, v, w, converged = advance(x, q, v, w, dt, body, gravity, on_vertices, damping, floor, walls, turn, collide, law)
                    unsolved += not converged
                _record(recorded[number, row], x, q, v, w)
        return unsolved

    fill.__qualname__ = f"fill-{hashlib.sha256(repr(used).encode()).hexdigest()[:16]}"
    return compile_cached(fill)


@compiled
def _walls_of(numbers, count):
    """The walls of a body, which are read where they are used: the registers do not hold them."""
    return numbers, count


@compiled
def _of_body(array, number):
    """The part of an array that belongs to a body; the last one may be shared."""
    return array[min(number, array.shape[0] - 1)]


@compiled
def _record(out, x, q, v, w):
    out[0], out[1], out[2] = x.x, x.y, x.z
    out[3], out[4], out[5], out[6] = q.x, q.y, q.z, q.w
    out[7], out[8], out[9] = v.x, v.y, v.z
    out[10], out[11], out[12] = w.x, w.y, w.z


def compile_cached(function: Callable[..., Any], *other_sources: Path) -> Callable[..., Any]:
    """Compile a kernel with IEEE rules (1/0 is inf), without reassociation and without Python's lock; cache it if the disk allows.

    Args:
        function: The kernel. No other one has its qualified name.
        other_sources: The files outside this package that it consists of.
    """
    with _cache_folder(other_sources) as writable:
        return partial(_called, njit(nogil=True, error_model="numpy", cache=writable)(function))


def _called(kernel: Callable[..., Any], *arguments: Any) -> Any:
    """What a kernel returns; one for which the disk has no room, which numba reports after it compiled it, works without the cache."""
    try:
        return kernel(*arguments)
    except OSError:
        return kernel(*arguments)


@contextmanager
def _cache_folder(other_sources: tuple[Path, ...]) -> Iterator[bool]:
    """Make numba use this package's cache folder while a kernel is declared; the user's setting is restored afterwards."""
    with _declaring:
        kept = config.CACHE_DIR
        base = Path(kept) if kept else sources.PACKAGE / "__pycache__"
        folder = base / f"dropspin-{_fingerprint(other_sources)}"
        try:
            _make_room(folder)
            config.CACHE_DIR = str(folder)
            yield os.access(folder, os.W_OK)
        except OSError:
            yield False
        finally:
            config.CACHE_DIR = kept


_declaring = threading.Lock()  # all threads share numba's setting


def _make_room(folder: Path) -> None:
    """Make the folder, and remove the oldest folders of other sources and settings."""
    if folder.is_dir():
        return
    folder.mkdir(parents=True)
    others = sorted(folder.parent.glob("dropspin-*"), key=lambda path: path.stat().st_mtime)
    for stale in others[:-MAX_CACHE_FOLDERS]:
        shutil.rmtree(stale, ignore_errors=True)


def _fingerprint(other_sources: tuple[Path, ...]) -> str:
    """A hash of all source files, of the compilers' versions, of the processor, and of the settings that change what they compile."""
    compilers = f"{sources.HASH} {numba.__version__} {llvmlite.__version__} {get_host_cpu_name()}"
    settings = "".join(f"{name}={getattr(config, name, None)}" for name in COMPILER_SETTINGS)
    parts = [compilers.encode(), *(source.read_bytes() for source in other_sources), settings.encode()]
    return hashlib.sha256(b"".join(parts)).hexdigest()[:16]
