"""Quantities at each state of many motions at once: the formulas of `dropspin.scenarios.mechanics` in one compiled loop."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.measuring import state_quantities as states_module
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.contact_laws import contact_residuals
from dropspin.comparisons.measuring.contact_runs import Mask, RowNumbers
from dropspin.comparisons.measuring.motion_quantities import Motions, Setup
from dropspin.comparisons.measuring.requirements import obeys_contact_laws
from dropspin.comparisons.measuring.state_quantities import States, StatesOfMany, is_touching
from dropspin.scenarios import Scenario, Trajectory, mechanics
from dropspin.scenarios.mechanics import depth_of, energy_of, kinetic_energy_of, offset_of
from dropspin.scenarios.state import Array

BATCH_BYTES = 8 * 2**20
"""States that are held in memory at a time; more would not be faster."""
AT_ONCE = ("kinetic_energy", "energy", "lowest_height", "touching")
REACH = 1.0 + 1e-9
"""Height of the centre of mass, relative to the size of the body, above which no point of it is below the floor."""


def motions_side_by_side(
    setup: Setup, states: Array, dt: Array, velocity_lag: Array, last_row: RowNumbers, unit_tolerance: float
) -> tuple[Motions, Mask]:
    """Motions from their states, to which metrics can be applied.

    Args:
        setup: The bodies, and the forces on them.
        states: Shape (B, n, 13).
        dt: Time between two rows [s], shape (B,).
        velocity_lag: Time by which velocities lag positions [s], shape (B,).
        last_row: The last row of each motion, shape (B,); later ones are ignored.
        unit_tolerance: Largest allowed difference of the length of a quaternion from 1.

    Returns:
        The motions, and for each whether its states are valid, that is, finite with unit quaternions.
    """
    shape = states.shape[:2]
    height, kinetic, energy, lowest = (np.empty(shape) for _ in range(4))
    touching, valid = np.zeros((shape[0], shape[1] - 1), dtype=bool), np.ones(shape[0], dtype=bool)
    quantities = StatesOfMany(height, states[..., 8], kinetic, energy, lowest, touching)
    shared = (setup.mass, setup.inertia, setup.vertices, setup.semi_axes, setup.size, setup.origin, setup.gravity, setup.gravity_strength)
    inputs = tuple(_for_each(values, shape[0]) for values in (*shared, setup.damping_share(dt), dt, velocity_lag))
    rows, last = np.ascontiguousarray(states), np.ascontiguousarray(last_row, dtype=np.int64)
    _kernel()((height, kinetic, energy, lowest, touching, valid), rows, unit_tolerance, last, inputs)
    return Motions(setup, quantities, dt, last_row), valid


def compute_cases(cases: Sequence[Comparison]) -> None:
    """Compute what metrics need of motions from several starts of one scene, of all at once where their states are finite."""
    scene, starts = cases[0].scene, Setup.of_starts([case.scene for case in cases])
    setup, has_residuals = Setup.of(scene), obeys_contact_laws(scene, None)
    for case, origin, clearance in zip(cases, starts.origin, starts.clearance, strict=True):
        started = replace(setup, origin=origin, clearance=np.asarray(clearance))
        last_row = np.asarray(len(case.motion) - 1)
        vars(case).update(
            motions=Motions(started, States(case.scene, case.motion), np.asarray(case.dt), last_row), clearance=float(clearance)
        )
    for numbers, states, together in compute_states([case.states for case in cases]):
        residuals = contact_residuals(scene, states, together) if has_residuals else None
        for number, case in enumerate(cases[numbers]):
            vars(case.motions).update(together.of_motion(number))
            if residuals is not None:
                vars(case)["contacts"] = residuals.of_motion(number)


def compute_states(all_states: Sequence[States]) -> Iterator[tuple[slice, Array, Motions]]:
    """Compute the quantities at each state of motions from several starts of one scene, of those of equal length at once.

    Yields:
        For each batch of motions whose states are finite: which of the motions they are, their states, shape (B, n, 13), and the motions.
    """
    lengths = [len(item.motion) for item in all_states]
    edges = [0, *(number for number in range(1, len(all_states)) if lengths[number] != lengths[number - 1]), len(all_states)]
    batches = [(start, end, max(1, BATCH_BYTES // (max(lengths[start], 1) * 13 * 8))) for start, end in pairwise(edges)]
    for numbers in (slice(first, min(first + many, end)) for start, end, many in batches for first in range(start, end, many)):
        batch, rows = all_states[numbers], lengths[numbers.start]
        if rows < 2:
            continue
        setup = Setup.of_starts([item.scene for item in batch])
        states = np.stack([item.motion.states for item in batch]) if len(batch) > 1 else batch[0].motion.states[np.newaxis]
        lag = np.array([item.motion.velocity_lag for item in batch])
        dt = np.full(len(batch), batch[0].motion.t[1] - batch[0].motion.t[0])
        last_row = np.full(len(batch), rows - 1)
        together, valid = motions_side_by_side(setup, states, dt, lag, last_row, np.inf)
        if valid.all():
            for number, item in enumerate(batch):
                vars(item).update({name: getattr(together.states, name)[number] for name in AT_ONCE})
            yield numbers, states, together


def compile_states(scene: Scenario) -> None:
    """Compile the loop over the states in this thread: a process that is forked while another thread compiles may wait for it forever."""
    any(compute_states([States(scene, Trajectory.from_states(np.arange(2.0), np.tile(scene.initial_state, (2, 1))))]))


def _for_each(values: Array, size: int) -> NDArray[np.float64]:
    """Values with one entry for each motion, in the memory layout that the kernel is compiled for."""
    return np.array(np.broadcast_to(values, (size, *values.shape[1:])), order="C")


@cache
def _kernel() -> Callable[..., None]:
    from numba.extending import register_jitable

    from dropspin.reference_impl.kernels import compile_cached

    for formula in (*mechanics.FORMULAS, is_touching):
        register_jitable(formula)
    return compile_cached(_fill, *(Path(module) for module in (__file__, mechanics.__file__, states_module.__file__)))


def _fill(outputs: Any, states: Any, unit_tolerance: float, last_row: Any, inputs: Any) -> None:
    height, kinetic, energy, lowest, touching, valid = outputs
    mass, inertia, vertices, semi_axes, size, origin, gravity, strength, damping_share, dt, lag = inputs
    for body in range(states.shape[0]):
        i, o, g, last = inertia[body], (origin[body, 0], origin[body, 1], origin[body, 2]), gravity[body], last_row[body]
        tensor = ((i[0, 0], i[0, 1], i[0, 2]), (i[1, 0], i[1, 1], i[1, 2]), (i[2, 0], i[2, 1], i[2, 2]))
        pull = (g[0], g[1], g[2])
        for row in range(last + 1):
            s = states[body, row]
            x, q, v, w = (s[0], s[1], s[2]), (s[3], s[4], s[5], s[6]), (s[7], s[8], s[9]), (s[10], s[11], s[12])
            total = 0.0
            for k in range(13):
                total += 0.0 * s[k]  # 0 if all are finite, else NaN
            length = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
            valid[body] &= abs(length - 1.0 + total) <= unit_tolerance
            height[body, row] = s[1]
            kinetic[body, row] = kinetic_energy_of(mass[body], tensor, q, v, w)
            energy[body, row] = energy_of(kinetic[body, row], mass[body], x, v, o, pull, lag[body])
            if row < last:
                n = states[body, row + 1]
                after = (n[7], n[8], n[9])
                touching[body, row] = is_touching(v, after, dt[body], pull, strength[body], damping_share[body])
        for row in range(last + 1):
            near_step = touching[body, max(row - 1, 0) : row + 2].any()
            lowest[body, row] = np.inf
            if near_step or states[body, row, 1] <= REACH * size[body]:
                s, offset = states[body, row], np.inf
                q = (s[3], s[4], s[5], s[6])
                for k in range(vertices.shape[1]):
                    offset = min(offset, offset_of(q, (vertices[body, k, 0], vertices[body, k, 1], vertices[body, k, 2])))
                lowest[body, row] = s[1] + offset - depth_of(q, (semi_axes[body, 0], semi_axes[body, 1], semi_axes[body, 2]))
        for quantity in (height, kinetic, energy, lowest):
            quantity[body, last + 1 :] = quantity[body, last]
