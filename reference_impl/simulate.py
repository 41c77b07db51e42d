"""The Python boundary: flat float64 arrays in and out, value types in between."""

import math
import warnings

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reference_impl.body import Body, Floor, KernelDamping, World, kernel_body
from reference_impl.kernels import recording_kernel
from reference_impl.methods import Methods
from reference_impl.vectors import Vec3

Array = NDArray[np.float64]


class UnsolvedContact(RuntimeWarning):
    """Some steps ended before the impulses of `contact=sequential` had settled."""


def step(state: ArrayLike, body: Body, world: World, dt: float, forces: ArrayLike | None = None, methods: Methods | None = None) -> Array:
    """Advance one state by one step of the note's Algorithm 1.

    Args:
        state: Position [m], orientation [x, y, z, w], velocity [m/s], angular velocity [rad/s], shape (13,).
        body: The body.
        world: What acts on it.
        dt: Time step [s].
        forces: Force on each vertex, in the world frame [N], shape (n, 3) (eq 9). None: none.
        methods: What stands in place of the note's parts. None: the note, literally.

    Returns:
        The next state, shape (13,).

    Raises:
        ValueError: An argument is no number, has the wrong shape, or describes no body. The text says which.

    Source: H. Wang, Rigid Body Dynamics (lecture note), Algorithms 1 and 2.
    """
    simulator = Simulator(body, world, dt, methods)
    rows = simulator.run(state, 1, forces=forces)
    _warn_if_unsolved(simulator, 1)
    return rows[1]


def simulate(state: ArrayLike, body: Body, world: World, dt: float, steps: int, every: int = 1, methods: Methods | None = None) -> Array:
    """Advance one state by many steps, recording each `every`-th.

    Args:
        state: As in `step`, shape (13,).
        body: The body.
        world: What acts on it.
        dt: Time step [s].
        steps: Number of steps.
        every: Steps between two rows of the result. Left-over steps at the end are not taken.
        methods: As in `step`.

    Returns:
        The states, the start first, shape (1 + steps // every, 13).

    Raises:
        ValueError: As in `step`.

    Warns:
        UnsolvedContact: `contact=sequential` reached its limit of sweeps; the text says in how many steps.
    """
    simulator = Simulator(body, world, dt, methods)
    rows = simulator.run(state, steps, every)
    _warn_if_unsolved(simulator, steps)
    return rows


class Simulator:
    """A body in a world at one step size, checked and converted once, for who simulates it many times over.

    Attributes:
        unsolved_steps: In how many steps so far the impulses of `contact=sequential` had not settled.

    Raises:
        ValueError: As in `step`.
    """

    def __init__(self, body: Body, world: World, dt: float, methods: Methods | None = None) -> None:
        if not (math.isfinite(dt) and dt > 0.0):
            raise ValueError(f"dt: got {dt!r}; must be a number above 0, in s")
        self._methods = methods or Methods()
        if world.floor is not None:
            _assert_law_fits(self._methods, world.floor)
        self._body, self._world, self._dt = body, world, float(dt)
        self._kernel_body = kernel_body(body)
        self._gravity = None if world.gravity is None else Vec3(*map(float, _numbers("gravity", world.gravity, (3,))))
        self._damping = None if world.damping is None else KernelDamping(*(math.exp(-rate * dt) for rate in world.damping))
        self.unsolved_steps = 0

    def run(self, state: ArrayLike, steps: int, every: int = 1, forces: ArrayLike | None = None) -> Array:
        """States from `state` on: the arguments of `simulate`, and of `step`; shape (1 + steps // every, 13)."""
        start = _numbers("state", state, (13,))
        if not np.any(start[3:7]):
            raise ValueError("state: the orientation is the zero quaternion; it must be a unit quaternion [x, y, z, w]")
        if steps < 0 or every < 1:
            raise ValueError(f"steps and every: got {steps} and {every}; must be at least 0 and at least 1")
        on_vertices = None if forces is None else _numbers("forces", forces, np.shape(self._body.points))
        rows = np.empty((1 + steps // every, 13))
        kernel = recording_kernel(self._methods, not _cannot_turn(start, self._body, self._world, on_vertices))
        self.unsolved_steps += kernel(
            rows, start, self._dt, every, self._kernel_body, self._gravity, on_vertices, self._damping, self._world.floor
        )
        return rows


def _warn_if_unsolved(simulator: Simulator, steps: int) -> None:
    if simulator.unsolved_steps:
        text = f"the contact was not solved in {simulator.unsolved_steps} of {steps} steps"
        warnings.warn(text, UnsolvedContact, stacklevel=3)


def _assert_law_fits(methods: Methods, floor: Floor) -> None:
    if not 0.0 <= floor.restitution <= 1.0:
        raise ValueError(f"restitution: got {floor.restitution!r}; must be between 0 and 1")
    if not floor.friction >= 0.0:
        raise ValueError(f"friction: got {floor.friction!r}; must be 0 or more")
    if not floor.rest_speed >= 0.0:
        raise ValueError(f"rest_speed: got {floor.rest_speed!r}; must be 0 or more, in m/s")
    if 0.0 < floor.friction < math.inf and methods.law not in ("normal", "coulomb"):
        raise ValueError(f"law {methods.law!r} knows friction 0 and infinity, got {floor.friction:g}; use law='coulomb'")


def _cannot_turn(state: Array, body: Body, world: World, forces: Array | None) -> bool:
    """A ball that falls straight without spin: nothing can turn it, so turning is left out."""
    is_ball = body.radius > 0.0 and not np.any(body.points)
    if not is_ball or np.any(state[10:13]) or forces is not None:
        return False
    if world.floor is None or world.floor.friction == 0.0:
        return True
    sideways = np.any(state[[7, 9]]) or (world.gravity is not None and np.any(np.asarray(world.gravity)[[0, 2]]))
    return not sideways


def _numbers(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Array:
    array = np.ascontiguousarray(values, dtype=float)
    if array.shape != shape:
        raise ValueError(f"{name}: must have shape {shape}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: got {array}; must be finite numbers")
    return array
