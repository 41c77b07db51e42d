"""Every engine must simulate the same body: what was built is read back and held against the scene."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparisons.engines.base import Engine, Limit, Simulation
from scenarios import Scenario
from scenarios.rotations import length

ULPS = 8
UNIT = 1e-5  # how far a quaternion's length may be from 1; single precision drifts by 1e-7


class BuiltDifferently(Exception):
    """An engine that simulates something else than the scene; the text says what."""


def assert_built_as_meant(engine: Engine, scene: Scenario, simulation: Simulation) -> None:
    """Raise `BuiltDifferently` unless state, mass, inertia and gravity equal the scene's to 8 ulp of the engine's precision."""
    if simulation.staggered not in (True, False):
        raise BuiltDifferently(f"staggered is {simulation.staggered!r}; it is True or False")
    state = simulation.state()
    if state.shape != (13,):
        raise BuiltDifferently(f"the state has shape {state.shape}, not (13,)")
    assert_starts_as_meant(engine, scene, state)
    built = simulation.as_built()
    if built is not None:
        _assert_equal(engine, "mass", np.array([built.mass]), np.array([scene.body.mass]))
        _assert_equal(engine, "inertia", built.inertia, scene.body.inertia_tensor)
        _assert_equal(engine, "gravity", built.gravity, scene.acceleration)


def assert_starts_as_meant(engine: Engine, scene: Scenario, state: NDArray[np.float64], ulps: int = ULPS) -> None:
    """Raise `BuiltDifferently` unless a state is the scene's start, to so many ulp; q and -q are the same orientation."""
    start = scene.initial_state
    state = state.copy()
    if state[3:7] @ start[3:7] < 0.0:
        state[3:7] *= -1.0
    for name, part in (
        ("position", slice(0, 3)),
        ("orientation", slice(3, 7)),
        ("velocity", slice(7, 10)),
        ("angular velocity", slice(10, 13)),
    ):
        _assert_equal(engine, f"{name} at the start", state[part], start[part], ulps)


def sound_record(states: Any, rows: int) -> NDArray[np.float64]:
    """An engine's record as float64, if it is one: the asked number of states, unit quaternions, unless it broke down."""
    if np.iscomplexobj(states):
        raise BuiltDifferently("the record is of complex numbers")
    record = np.asarray(states, dtype=float)
    if record.shape != (rows, 13):
        raise BuiltDifferently(f"the record has shape {record.shape}; {rows} states of 13 numbers were asked for, ({rows}, 13)")
    if not np.isfinite(record).all():
        return record  # one that broke down; of its last numbers nothing can be asked
    lengths = length(record[:, 3:7])
    off = np.abs(lengths - 1.0) > UNIT
    if off.any():
        row = int(np.argmax(off))
        raise BuiltDifferently(f"the quaternion of row {row} has length {lengths[row]:.6g}; an orientation has length 1")
    return record


def sound_limits(limits: Any) -> tuple[Limit, ...]:
    """The limits that a simulation says it has met, each as a `Limit`; a sentence alone explains no error."""
    if isinstance(limits, str) or not isinstance(limits, Iterable):
        raise BuiltDifferently(f"limits is {limits!r}; it is a sequence of sentences, or of comparisons.Limit")
    found = tuple(Limit(limit) if isinstance(limit, str) else limit for limit in limits)
    if not all(isinstance(limit, Limit) for limit in found):
        raise BuiltDifferently(f"limits is {limits!r}; it is a sequence of sentences, or of comparisons.Limit")
    return found


def _assert_equal(engine: Engine, what: str, found: NDArray[np.float64], meant: NDArray[np.float64], ulps: int = ULPS) -> None:
    allowed = ulps * float(np.finfo(engine.precision).eps) * float(np.max(np.abs(meant)))
    difference = float(np.max(np.abs(found - meant)))
    if not difference <= allowed:
        raise BuiltDifferently(
            f"{what} is {np.array2string(found, precision=17)}, the scene says {np.array2string(meant, precision=17)}; "
            f"they differ by {difference:.3g}, {ulps} ulp are {allowed:.3g}"
        )
