"""The Python boundary: flat float64 arrays in and out, value types in between."""

import math
import operator
import os
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reference_impl import lanes
from reference_impl.body import Body, World
from reference_impl.kernels import Parts, blocks, config, recording_kernel
from reference_impl.methods import Methods
from reference_impl.parameters import FRICTION, checked, ensemble_size, is_finite, pack

Array = NDArray[np.float64]


class UnsolvedContact(RuntimeWarning):
    """Some steps ended before the impulses of `contact=sequential` had settled."""


def step(
    states: ArrayLike,
    body: Body,
    world: World,
    dt: float | Array,
    forces: ArrayLike | None = None,
    methods: Methods | None = None,
) -> Array:
    """Advance one state, or an ensemble of them, by one step of the note's Algorithm 1.

    Args:
        states: Position [m], orientation [x, y, z, w] (brought to length 1), velocity [m/s], angular velocity [rad/s], shape (13,) or
            (B, 13).
        body: The body, or an ensemble of B.
        world: What acts on it.
        dt: Time step [s], one for all or shape (B,).
        forces: Force on each vertex, in the world frame [N], shape (n, 3) or (B, n, 3) (eq 9). None: none.
        methods: What stands in place of the note's parts. None: the note, literally.

    Returns:
        The next states, shape (13,) or (B, 13).

    Raises:
        ValueError: An argument is no number, has the wrong shape, or describes no body. The text says which.

    Source: H. Wang, Rigid Body Dynamics (lecture note), Algorithms 1 and 2.
    """
    simulator = Simulator(body, world, dt, methods)
    rows = simulator.run(states, 1, forces=forces)
    _warn_if_unsolved(simulator, rows, 1)
    return rows[..., 1, :]


def simulate(
    states: ArrayLike,
    body: Body,
    world: World,
    dt: float | Array,
    steps: int,
    every: int = 1,
    methods: Methods | None = None,
    threads: int | None = None,
) -> Array:
    """Advance one state, or an ensemble of them, by many steps, recording each `every`-th.

    Whatever is given for each of B bodies (states, masses, step sizes, …) makes it an ensemble of B; what is given once holds for all. A
    body moves in an ensemble as it does alone, to the last bit, for any number of threads.

    Args:
        states: As in `step`, shape (13,) or (B, 13).
        body: The body, or an ensemble of B.
        world: What acts on it.
        dt: Time step [s], one for all or shape (B,).
        steps: Number of steps.
        every: Steps between two rows of the result. Left-over steps at the end are not taken.
        methods: As in `step`.
        threads: How many threads share an ensemble. None: as many as this process may use processors, where that saves time. Ctrl-C
            takes effect between blocks of bodies; one body runs to its end.

    Returns:
        The states, the start first, shape (1 + steps // every, 13) or (B, 1 + steps // every, 13).

    Raises:
        ValueError: As in `step`.

    Warns:
        UnsolvedContact: `contact=sequential` reached its limit of sweeps; the text says in how many steps.
    """
    simulator = Simulator(body, world, dt, methods)
    rows = simulator.run(states, steps, every, threads=threads)
    _warn_if_unsolved(simulator, rows, steps - steps % every)
    return rows


class Simulator:
    """Bodies in a world, checked and converted once, for who simulates them many times over.

    Attributes:
        unsolved_steps: In how many steps so far the impulses of `contact=sequential` had not settled.

    Raises:
        ValueError: As in `step`.
    """

    def __init__(self, body: Body, world: World, dt: float | Array, methods: Methods | None = None) -> None:
        self._methods = methods or Methods()
        self._parameters = pack(body, world, dt)
        if world.floor is not None:
            _assert_law_fits(self._methods, self._parameters.columns[:, FRICTION])
        self._world = world
        self._upright_ball = _falls_upright(body, world)
        self._packed: dict[int, list[Array]] = {}
        self.unsolved_steps = 0

    def run(self, states: ArrayLike, steps: int, every: int = 1, forces: ArrayLike | None = None, threads: int | None = None) -> Array:
        """States from `states` on: the arguments of `simulate`, and the forces of `step`; shape (…, 1 + steps // every, 13)."""
        columns, points, is_ensemble = self._parameters
        starts = checked("state", states, (13,), "finite numbers, the orientation not the zero quaternion", _is_state)
        on_vertices = None if forces is None else checked("forces", forces, points.shape[1:], "finite numbers, in N", is_finite)
        steps, every = _whole("steps", steps, 0), _whole("every", every, 1)
        threads = None if threads is None else _whole("threads", threads, 1)
        given = {"state": starts, "body, world and dt": columns} | ({} if on_vertices is None else {"forces": on_vertices})
        size = ensemble_size(given)
        starts = _with_unit_orientation(starts)
        if len(starts) < size:
            starts = np.broadcast_to(starts, (size, 13))
        turning = on_vertices is not None or not (self._upright_ball and _is_without_spin(starts, self._world))
        world = self._world
        parts = Parts(world.gravity is not None, on_vertices is not None, world.damping is not None, world.floor is not None, turning)
        width = lanes.WIDTH if size > 1 and self._methods.go_side_by_side and not config.DISABLE_JIT else 1
        recorded = np.empty((size, 1 + steps // every, 13))
        if width not in self._packed:
            self._packed[width] = [blocks(columns, width), blocks(points, width)]
        packed = (blocks(starts, width), *self._packed[width], None if on_vertices is None else blocks(on_vertices, width))
        kernel = recording_kernel(self._methods, parts, width)
        work = steps * width
        self.unsolved_steps += _share_out(partial(kernel, recorded, *packed, every), -(-size // width), work, threads)
        is_alone = not is_ensemble and np.ndim(states) == 1 and (forces is None or np.ndim(forces) == 2)
        return recorded[0] if is_alone else recorded


def usable_cores() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


AT_A_TIME = 3_000_000
"""Steps, of all its bodies, that a thread takes at a time: few enough to share the work evenly, and to stop soon at Ctrl-C."""
WORTH_A_THREAD = 300_000
"""Steps, of all bodies, below which starting threads takes longer than they save."""


def _share_out(fill: Callable[[int, int], int], count: int, work: int, threads: int | None) -> int:
    """Fill all blocks, each of so much work, some at a time, and add up what the kernel counted."""
    if count == 1:
        return fill(0, 1)
    threads = threads or (usable_cores() if count * work > WORTH_A_THREAD else 1)
    each = min(max(1, AT_A_TIME // max(work, 1)), -(-count // threads))
    firsts = range(0, count, each)
    lasts = [min(first + each, count) for first in firsts]
    if threads == 1:
        return sum(map(fill, firsts, lasts))
    with ThreadPoolExecutor(threads) as pool:
        return sum(pool.map(fill, firsts, lasts))


def _warn_if_unsolved(simulator: Simulator, recorded: Array, steps: int) -> None:
    if simulator.unsolved_steps:
        taken = steps * math.prod(recorded.shape[:-2])
        text = f"the contact was not solved in {simulator.unsolved_steps} of {taken} steps"
        warnings.warn(text, UnsolvedContact, stacklevel=3)


def _is_state(states: Array) -> NDArray[np.bool_]:
    return is_finite(states) & states[:, 3:7].any(axis=1)


def _with_unit_orientation(states: Array) -> Array:
    """The states with quaternions of length 1; those that are, to rounding, stay as they are to the last bit."""
    q = states[:, 3:7]
    if (np.abs(np.einsum("ij,ij->i", q, q) - 1.0) < 1e-14).all():
        return states
    largest = np.abs(q).max(axis=1, keepdims=True)  # first, so that no square is beyond what a number holds
    scaled = q / largest
    states[:, 3:7] = scaled / np.sqrt(np.sum(scaled * scaled, axis=1, keepdims=True))
    return states


def _whole(name: str, value: int, least: int) -> int:
    try:
        number = operator.index(value)
    except TypeError:
        number = least - 1
    if not least <= number < 2**62:
        raise ValueError(f"{name}: got {value!r}; must be a whole number, at least {least}")
    return number


def _assert_law_fits(methods: Methods, friction: Array) -> None:
    between = np.extract((friction > 0.0) & np.isfinite(friction), friction)
    if len(between) and methods.law not in ("normal", "coulomb"):
        raise ValueError(f"law {methods.law!r} knows friction 0 and infinity, got {between[0]:g}; use law='coulomb'")


def _falls_upright(body: Body, world: World) -> bool:
    """Balls that neither a vertex nor gravity along a floor that grips can turn."""
    is_ball = np.all(np.asarray(body.radius) > 0.0) and not np.any(body.points)
    return bool(is_ball and (not _grips(world) or world.gravity is None or not np.any(np.asarray(world.gravity)[..., [0, 2]])))


def _is_without_spin(states: Array, world: World) -> bool:
    """And that neither spin nor slide: nothing turns them at all, so turning is left out."""
    return not np.any(states[:, 10:13]) and not (_grips(world) and np.any(states[:, [7, 9]]))


def _grips(world: World) -> bool:
    return world.floor is not None and bool(np.any(world.floor.friction))
