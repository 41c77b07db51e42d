"""Verification of an adapter's answers: what was built equals the scene; records, settings, limitations and claims are well formed."""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from dropspin.comparisons.engines.base import Engine, KnownLimitation, Simulation, numpy_array
from dropspin.comparisons.engines.exceptions import LONGEST, described, short
from dropspin.scenarios import Scenario
from dropspin.scenarios.model import initial_states
from dropspin.scenarios.rotations import length
from dropspin.scenarios.state import ORIENTATION, PARTS, SPIN, VELOCITY, Array
from dropspin.scenarios.validation import shown

MULTIPLE = 8
"""Eps of the engine's precision by which numbers may differ from the scene's, relative to the largest number of a vector."""
BATCH_MULTIPLE = 64
"""Of many starts a few differ from the scene's by more than the 8 eps that one is allowed."""
SPIN_MULTIPLE = 64
"""Of an angular velocity that was rotated to the body's axes and back, by a quaternion whose length is rounded: measured up to 23."""
UNIT_TOLERANCE = 1e-5
"""How far a quaternion's length may be from 1; single precision drifts by 1e-7."""

LONGEST_SETTINGS, DEEPEST_SETTINGS = 100_000, 20  # bytes as JSON; tables and lists within each other


class BuildMismatch(Exception):
    """An engine simulates something else than the scene; the text says what."""


def verified_simulation(prepared: Any) -> Simulation:
    """What `prepare` returns.

    Raises:
        BuildMismatch: It is not a simulation.
    """
    if not isinstance(prepared, Simulation):
        raise BuildMismatch(f"prepare() returns {shown(prepared)}; it must return a dropspin.Simulation")
    return prepared


def verify_build(engine: Engine, scene: Scenario, simulation: Simulation, dt: float) -> None:
    """Raise `BuildMismatch` unless state, mass, inertia and gravity equal the scene's to 8 eps, a spin to 64, of the engine's precision."""
    verified_lag(simulation.velocity_lag, dt)
    state = numpy_array(simulation.state())
    if state.shape != (13,):
        raise BuildMismatch(f"the state has shape {state.shape}, not (13,)")
    verify_start(engine, scene, state)
    built = simulation.as_built()
    if built is not None:
        _verify_equal(engine, "mass", np.array([[built.mass]]), np.array([[scene.body.mass]]))
        _verify_equal(engine, "inertia", np.reshape(built.inertia, (1, 9)), scene.body.inertia_tensor.reshape(1, 9))
        _verify_equal(engine, "gravity", built.gravity[np.newaxis], scene.acceleration[np.newaxis])


def verified_lag(lag: Any, dt: float) -> float:
    """The time by which a simulation's velocity lags its position [s].

    Raises:
        BuildMismatch: It is not a time of at most one step.
    """
    if isinstance(lag, bool) or not isinstance(lag, int | float | np.floating) or not abs(float(lag)) <= dt:
        raise BuildMismatch(f"velocity_lag is {lag!r}; it is a time in seconds of at most one step, {dt:g} s")
    return float(lag)


def verify_start(engine: Engine, scene: Scenario, state: Array) -> None:
    """Raise `BuildMismatch` unless a state equals the scene's start to 8 eps, a spin to 64; q and -q are the same orientation."""
    verify_starts(engine, [scene], state[np.newaxis], MULTIPLE)


def verify_starts(engine: Engine, scenes: Sequence[Scenario], states: Array, multiple: int = BATCH_MULTIPLE) -> None:
    """As `verify_start`, for each scene and its state, states of shape (size, 13)."""
    starts = initial_states(scenes)
    opposite = np.einsum("ij,ij->i", states[:, ORIENTATION], starts[:, ORIENTATION]) < 0.0
    starts[opposite, ORIENTATION] *= -1.0
    for name, part in PARTS.items():
        allowed = SPIN_MULTIPLE if part == SPIN else multiple
        # A velocity may be what rounding leaves of the velocities that the spin gives to points of the body.
        least = scenes[0].body.size * np.abs(starts[:, SPIN]).max(axis=1) if part == VELOCITY else 0.0
        _verify_equal(engine, f"{name.replace('_', ' ')} at the start", states[:, part], starts[:, part], allowed, least)


def verified_record(states: Any, rows: int) -> Array:
    """A copy of an engine's record as float64: the number of rows asked for, unit quaternions; numbers that are not finite are let through.

    Raises:
        BuildMismatch: It is not such a record.
    """
    record = numpy_array(states)
    if np.iscomplexobj(record):
        raise BuildMismatch("the record has complex numbers")
    record = np.array(record, dtype=float)
    if record.shape != (rows, 13):
        raise BuildMismatch(f"the record has shape {record.shape}; {rows} states of 13 numbers were asked for, shape ({rows}, 13)")
    if not np.isfinite(record).all():
        return record  # a divergence, which has a verdict of its own
    lengths = length(record[:, ORIENTATION])
    off = np.abs(lengths - 1.0) > UNIT_TOLERANCE
    if off.any():
        row = int(np.argmax(off))
        steps = np.diff(lengths)  # none of them has more than half of the growth, unlike that of an orientation that is wrong all along
        grows = row > 0 and bool((steps > -UNIT_TOLERANCE / 10.0).all() and steps.max() <= 0.5 * (lengths[-1] - lengths[0]))
        cause = ": it grows as the body turns, because it is not normalised after each step" if grows else ""
        raise BuildMismatch(f"the quaternion of row {row} has length {lengths[row]:.6g}; an orientation has length 1{cause}")
    return record


def verified_batch(states: Any, size: int, rows: int) -> Array:
    """A copy of an engine's record of a batch as float64, shape (size, rows, 13), each of its motions as in `verified_record`.

    Raises:
        BuildMismatch: It is not such a record.
    """
    batch = numpy_array(states)
    if batch.ndim == 0 or len(batch) != size:
        raise BuildMismatch(f"the record of a batch has shape {batch.shape}; {size} motions were asked for, shape ({size}, {rows}, 13)")
    if batch.shape == (size, rows, 13) and batch.dtype == float:
        squares = np.einsum("...i,...i->...", batch[..., ORIENTATION], batch[..., ORIENTATION])
        if max(squares.max() - 1.0, 1.0 - squares.min()) <= UNIT_TOLERANCE:  # at least as far from 1 as the lengths; NaN is not
            return batch.copy()
    return np.array([verified_record(motion, rows) for motion in batch])


def verified_limitations(limitations: Any) -> tuple[KnownLimitation, ...]:
    """The known limitations that a simulation reports; a sentence alone explains no error.

    Raises:
        BuildMismatch: They are not a sequence of sentences and `KnownLimitation`s.
    """
    allowed = "must be a sequence of strings, of dropspin.KnownLimitation(message, explained_errors), or of both"
    if isinstance(limitations, str) or not isinstance(limitations, Iterable):
        raise BuildMismatch(f"known_limitations is {shown(limitations)}; it {allowed}")
    found = []
    for given in limitations:
        one = KnownLimitation(given) if isinstance(given, str) else given
        if not isinstance(one, KnownLimitation) or not isinstance(one.message, str) or not isinstance(one.explained_errors, Mapping):
            raise BuildMismatch(f"known_limitations has {shown(given)}; it {allowed}")
        errors = {str(name): _verified_number(f"known_limitations: {name}", error) for name, error in one.explained_errors.items()}
        found.append(KnownLimitation(_verified_text("known_limitations", one.message), errors))
    return tuple(found)


def verified_settings(settings: Any) -> dict[str, Any]:
    """The settings that a simulation reports, as JSON stores them.

    Raises:
        BuildMismatch: They are not a mapping that JSON can hold, or too long.
    """
    try:
        text = json.dumps(dict(settings))
        if len(text.encode()) > LONGEST_SETTINGS:
            raise ValueError(f"they are longer than {LONGEST_SETTINGS} bytes")
        found: dict[str, Any] = json.loads(text)
        if _depth(found) > DEEPEST_SETTINGS:
            raise ValueError(f"they are nested more than {DEEPEST_SETTINGS} deep")
        json.dumps(found, ensure_ascii=False).encode()  # lone surrogates cannot be stored
    except (TypeError, ValueError, RecursionError) as error:
        raise BuildMismatch(f"settings cannot be stored as JSON: {described(error)}") from None
    return found


def _depth(content: Any) -> int:
    """How deep mappings and lists are nested."""
    inner = content.values() if isinstance(content, dict) else content if isinstance(content, list) else None
    return 0 if inner is None else 1 + max(map(_depth, inner), default=0)


def verified_refusal(answer: Any) -> str | None:
    """What `declines` returns: the reason, or None.

    Raises:
        BuildMismatch: It is neither.
    """
    return None if answer is None else _verified_text("the answer of declines()", answer)


def verified_claims(engine: Engine, scene: Scenario) -> tuple[str | None, float | None, type]:
    """The discretisation, the order and the precision that an engine states for a scene.

    Raises:
        BuildMismatch: One of them is not of the type that the protocol has.
    """
    name, order, precision = engine.discretisation(scene), engine.order_in(scene), engine.precision
    if precision not in (np.float32, np.float64):
        raise BuildMismatch(f"precision is {shown(precision)}; it must be numpy.float64 or numpy.float32")
    if order is not None and not _verified_number("order", order) > 0.0:
        raise BuildMismatch(f"order is {shown(order)}; it must be None (no claim), a number above 0, or inf (exact)")
    return None if name is None else _verified_text("discretisation()", name), None if order is None else float(order), precision


def verified_predictions(predicted: Mapping[str, Any]) -> dict[str, float]:
    """The errors by metric that an engine predicts; metrics without a prediction are left out.

    Raises:
        BuildMismatch: One is not a number.
    """
    return {name: _verified_number(f"the predicted error of {name}", value) for name, value in predicted.items() if value is not None}


def _verified_text(what: str, text: Any) -> str:
    if not isinstance(text, str) or not text.strip():
        raise BuildMismatch(f"{what} is {shown(text)}; it must be a sentence")
    joined = " ".join(text.split())
    if short(joined) != joined:
        raise BuildMismatch(f"{what} is {short(shown(text))}; it must be printable text of at most {LONGEST} characters")
    return joined


def _verified_number(what: str, number: Any) -> float:
    if isinstance(number, bool) or not isinstance(number, int | float | np.floating) or math.isnan(number):
        raise BuildMismatch(f"{what} is {shown(number)}; it must be a number")
    return float(number)


def _verify_equal(engine: Engine, what: str, found: Array, expected: Array, multiple: int = MULTIPLE, least: Array | float = 0.0) -> None:
    """Raise `BuildMismatch` unless each row of an array equals that of another to some eps of its largest number, or of a `least` one."""
    largest, difference = np.maximum(np.abs(expected).max(axis=1), least), np.abs(found - expected).max(axis=1)
    allowed = multiple * float(np.finfo(engine.precision).eps) * largest
    if not (difference <= allowed).all():
        row = int(np.argmin(difference <= allowed))
        of_which = f" of simulation {row + 1} of {len(found)}" if len(found) > 1 else ""
        is_now, has = (np.array2string(one[row] if one[row].size > 1 else one[row, 0], precision=17) for one in (found, expected))
        raise BuildMismatch(
            f"{what}{of_which} is {is_now}, the scene has {has}; they differ by {difference[row]:.3g}, {multiple} eps is {allowed[row]:.3g}"
        )
