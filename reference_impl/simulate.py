"""The Python interface: arguments are checked, converted and given to a kernel; flat float64 arrays in and out."""

import math
import operator
import warnings
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dropspin.reference_impl.body import Array, Body, World
from dropspin.reference_impl.checks import checked, ensemble_size, is_finite
from dropspin.reference_impl.floor_plane import BLOCK
from dropspin.reference_impl.kernels import Parts, recording_kernel
from dropspin.reference_impl.methods import Methods
from dropspin.reference_impl.parameters import SEMI_AXES, frictions, pack
from dropspin.reference_impl.state import ORIENTATION, SPIN
from dropspin.reference_impl.threads import share_out


class UnsolvedContact(RuntimeWarning):
    """The impulses of `contact=sequential` did not converge in some steps."""


def step(
    states: ArrayLike,
    body: Body,
    world: World,
    dt: float | Array,
    forces: ArrayLike | None = None,
    methods: Methods | None = None,
) -> Array:
    """Advance one state, or an ensemble of states, by one step of Algorithm 1 of the lecture note.

    Args:
        states: Position [m], orientation [x, y, z, w] (of any length; it is normalised), velocity [m/s], angular velocity [rad/s],
            shape (13,) or (B, 13).
        body: The body, or an ensemble of B.
        world: The gravity, floor, damping and walls that act on it.
        dt: Time step [s], a number or shape (B,).
        forces: Force on each vertex, in the world frame [N], shape (n, 3) or (B, n, 3) (eq 9). None: no forces.
        methods: The methods. None: those of the lecture note.

    Returns:
        The next states, shape (13,) or (B, 13).

    Raises:
        ValueError: An argument is not a number, has the wrong shape, or describes no possible body. The message names the argument.

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
    """Advance one state, or an ensemble of states, by many steps, and record the state after each `every` steps.

    If an argument (states, masses, time steps, …) is given for each of B bodies, the simulation is an ensemble of B; an argument that is
    given once applies to all bodies. A body moves in an ensemble exactly as it does alone, to the last bit, for any number of threads.

    Args:
        states: As in `step`, shape (13,) or (B, 13).
        body: The body, or an ensemble of B.
        world: The gravity, floor, damping and walls that act on it.
        dt: Time step [s], a number or shape (B,).
        steps: Number of steps.
        every: Number of steps between two rows of the result. Remaining steps at the end are not taken.
        methods: As in `step`.
        threads: Number of threads that share an ensemble. None: the number of processors that this process may use, if this saves time.
            Ctrl-C takes effect between blocks of bodies; one body runs to its end.

    Returns:
        The states, beginning with the initial one, shape (1 + steps // every, 13) or (B, 1 + steps // every, 13).

    Raises:
        ValueError: As in `step`.

    Warns:
        UnsolvedContact: `contact=sequential` reached its limit of sweeps; the message gives the number of these steps.
    """
    simulator = Simulator(body, world, dt, methods)
    rows = simulator.run(states, steps, every, threads=threads)
    _warn_if_unsolved(simulator, rows, steps - steps % every)
    return rows


class Simulator:
    """Bodies in a world, which are checked and converted once for many simulations.

    Attributes:
        unsolved_steps: Number of steps so far in which the impulses of `contact=sequential` did not converge.

    Raises:
        ValueError: As in `step`.
    """

    def __init__(self, body: Body, world: World, dt: float | Array, methods: Methods | None = None) -> None:
        self._methods = methods = methods or Methods()
        self._parameters = pack(body, world, dt)
        for friction in frictions(world):
            between = np.extract((friction > 0.0) & np.isfinite(friction), friction)
            if len(between) and not methods.takes_any_friction:
                raise ValueError(f"friction: got {between[0]:g}; law {methods.law!r} takes 0 and infinity only; use law='coulomb'")
        self._world = world
        columns, points, _ = self._parameters
        semi_axes = columns[:, SEMI_AXES : SEMI_AXES + 3]
        self._surface = bool(np.ptp(semi_axes, axis=1).any()), bool(((semi_axes[:, 1] == 0.0) & semi_axes.any(axis=1)).any())
        self._can_fall_without_turning = _can_fall_without_turning(body, world)
        self._many_points = None
        if points.shape[1] >= BLOCK and not semi_axes.any():
            reach = np.sqrt(np.max(np.sum(points**2, axis=2), axis=1))[:, None, None]
            self._many_points = np.ascontiguousarray(np.swapaxes(points / reach, 1, 2), dtype=np.float32)
        self.unsolved_steps = 0

    def run(self, states: ArrayLike, steps: int, every: int = 1, forces: ArrayLike | None = None, threads: int | None = None) -> Array:
        """The states, beginning with `states`, shape (…, 1 + steps // every, 13); arguments as in `simulate`, and `forces` as in `step`."""
        columns, points, is_ensemble = self._parameters
        starts = checked("state", states, (13,), "finite numbers, the orientation not the zero quaternion", _is_state)
        on_vertices = None if forces is None else checked("forces", forces, points.shape[1:], "finite numbers, in N", is_finite)
        steps, every = _whole("steps", steps, 0), _whole("every", every, 1)
        threads = None if threads is None else _whole("threads", threads, 1)
        inputs = {"state": starts, "body, world and dt": columns} | ({} if on_vertices is None else {"forces": on_vertices})
        size = ensemble_size(inputs)
        starts = _with_unit_orientation(starts)
        if len(starts) < size:
            starts = np.tile(starts, (size, 1))
        turning = on_vertices is not None or not (self._can_fall_without_turning and _is_without_spin(starts, self._world))
        world = self._world
        modelled = (world.gravity is not None, on_vertices is not None, world.damping is not None, world.floor is not None, turning)
        edges = world.floor is not None and not (world.floor.half_extents is None and world.floor.thickness is None)
        parts = Parts(*modelled, *self._surface, edges, len(world.walls), self._many_points is not None)
        recorded = np.empty((size, 1 + steps // every, 13))
        kernel = recording_kernel(self._methods, parts)
        fill = partial(kernel, recorded, starts, columns, points, self._many_points, on_vertices, every)
        self.unsolved_steps += share_out(fill, size, steps, threads)
        is_alone = not is_ensemble and np.ndim(states) == 1 and (forces is None or np.ndim(forces) == 2)
        return recorded[0] if is_alone else recorded


def _warn_if_unsolved(simulator: Simulator, recorded: Array, steps: int) -> None:
    if simulator.unsolved_steps:
        taken = steps * math.prod(recorded.shape[:-2])
        text = f"the contact was not solved in {simulator.unsolved_steps} of {taken} steps"
        warnings.warn(text, UnsolvedContact, stacklevel=3)


def _is_state(states: Array) -> NDArray[np.bool_]:
    return is_finite(states) & states[:, ORIENTATION].any(axis=1)


def _with_unit_orientation(states: Array) -> Array:
    """The states with quaternions of length 1; quaternions that have it to rounding do not change by a bit."""
    q = states[:, ORIENTATION]
    if (np.abs(np.einsum("ij,ij->i", q, q) - 1.0) < 1e-14).all():
        return states
    largest = np.abs(q).max(axis=1, keepdims=True)  # scaled first, so that no square overflows
    scaled = q / largest
    states[:, ORIENTATION] = scaled / np.sqrt(np.sum(scaled * scaled, axis=1, keepdims=True))
    return states


def _whole(name: str, value: int, least: int) -> int:
    try:
        number = operator.index(value)
    except TypeError:
        number = least - 1
    if not least <= number < 2**62:
        raise ValueError(f"{name}: got {value!r}; must be a whole number, at least {least}")
    return number


def _can_fall_without_turning(body: Body, world: World) -> bool:
    """Whether the bodies are balls that rotate only if they do so initially or slide: there is no gravity along a floor with friction."""
    semi_axes = np.asarray(body.semi_axes)
    is_ball = np.all(semi_axes > 0.0) and not np.ptp(semi_axes, axis=-1).any() and not np.any(body.points)
    falls_straight = world.gravity is None or not np.any(np.asarray(world.gravity)[..., [0, 2]])
    return bool(is_ball and (not _grips(world) or (falls_straight and not world.walls)))


def _is_without_spin(states: Array, world: World) -> bool:
    """Whether no body rotates initially, and none slides on a floor with friction; if so, the rotation is left out."""
    return not np.any(states[:, SPIN]) and not (_grips(world) and np.any(states[:, [7, 9]]))


def _grips(world: World) -> bool:
    return any(np.any(friction) for friction in frictions(world))
