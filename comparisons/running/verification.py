"""Verification of an adapter's answers: what was built equals the scene, records and limitations are well formed."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparisons.engines.base import Engine, KnownLimitation, Simulation
from scenarios import Scenario
from scenarios.rotations import length
from scenarios.state import ORIENTATION, PARTS, SPIN

ULPS = 8
BATCH_ULPS = 64
"""Of many starts a few differ from the scene's by more than the 8 ulp that one is allowed."""
SPIN_ULPS = 64
"""Of an angular velocity that was rotated to the body's axes and back, by a quaternion whose length is rounded: measured up to 23."""
UNIT_TOLERANCE = 1e-5
"""How far a quaternion's length may be from 1; single precision drifts by 1e-7."""


class BuildMismatch(Exception):
    """An engine simulates something else than the scene; the text says what."""


def verify_build(engine: Engine, scene: Scenario, simulation: Simulation, dt: float) -> None:
    """Raise `BuildMismatch` unless state, mass, inertia and gravity equal the scene's to 8 ulp, a spin to 64, of the engine's precision."""
    lag = simulation.velocity_lag
    if isinstance(lag, bool) or not isinstance(lag, int | float | np.floating) or not abs(lag) <= dt:
        raise BuildMismatch(f"velocity_lag is {lag!r}; it is a time in seconds of at most one step, {dt:g} s")
    state = simulation.state()
    if state.shape != (13,):
        raise BuildMismatch(f"the state has shape {state.shape}, not (13,)")
    verify_start(engine, scene, state)
    built = simulation.as_built()
    if built is not None:
        _verify_equal(engine, "mass", np.array([built.mass]), np.array([scene.body.mass]))
        _verify_equal(engine, "inertia", built.inertia, scene.body.inertia_tensor)
        _verify_equal(engine, "gravity", built.gravity, scene.acceleration)


def verify_start(engine: Engine, scene: Scenario, state: NDArray[np.float64], ulps: int = ULPS) -> None:
    """Raise `BuildMismatch` unless a state equals the scene's start to some ulp, a spin to 64; q and -q are the same orientation."""
    start = scene.initial_state
    state = state.copy()
    if state[ORIENTATION] @ start[ORIENTATION] < 0.0:
        state[ORIENTATION] *= -1.0
    for name, part in PARTS.items():
        allowed = SPIN_ULPS if part == SPIN else ulps
        _verify_equal(engine, f"{name.replace('_', ' ')} at the start", state[part], start[part], allowed)


def verified_record(states: Any, rows: int) -> NDArray[np.float64]:
    """An engine's record as float64: the number of rows asked for, unit quaternions; numbers that are not finite are let through.

    Raises:
        BuildMismatch: It is not such a record.
    """
    if np.iscomplexobj(states):
        raise BuildMismatch("the record has complex numbers")
    record = np.asarray(states, dtype=float)
    if record.shape != (rows, 13):
        raise BuildMismatch(f"the record has shape {record.shape}; {rows} states of 13 numbers were asked for, shape ({rows}, 13)")
    if not np.isfinite(record).all():
        return record  # a divergence, which has a verdict of its own
    lengths = length(record[:, ORIENTATION])
    off = np.abs(lengths - 1.0) > UNIT_TOLERANCE
    if off.any():
        row = int(np.argmax(off))
        raise BuildMismatch(f"the quaternion of row {row} has length {lengths[row]:.6g}; an orientation has length 1")
    return record


def verified_limitations(limitations: Any) -> tuple[KnownLimitation, ...]:
    """The known limitations that a simulation reports; a sentence alone explains no error.

    Raises:
        BuildMismatch: They are not a sequence of sentences and `KnownLimitation`s.
    """
    allowed = "must be a sequence of sentences, or of dropspin.KnownLimitation"
    if isinstance(limitations, str) or not isinstance(limitations, Iterable):
        raise BuildMismatch(f"known_limitations is {limitations!r}; it {allowed}")
    found = tuple(KnownLimitation(one) if isinstance(one, str) else one for one in limitations)
    if not all(isinstance(one, KnownLimitation) for one in found):
        raise BuildMismatch(f"known_limitations is {limitations!r}; it {allowed}")
    return found


def _verify_equal(engine: Engine, what: str, found: NDArray[np.float64], expected: NDArray[np.float64], ulps: int = ULPS) -> None:
    allowed = ulps * float(np.finfo(engine.precision).eps) * float(np.max(np.abs(expected)))
    difference = float(np.max(np.abs(found - expected)))
    if not difference <= allowed:
        raise BuildMismatch(
            f"{what} is {np.array2string(found, precision=17)}, the scene has {np.array2string(expected, precision=17)}; "
            f"they differ by {difference:.3g}, {ulps} ulp are {allowed:.3g}"
        )
