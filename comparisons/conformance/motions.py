"""The check of a probe: the engine's motion equals the exact solution; if not, which fault or symptom explains the difference.

A fault model changes the scene that is simulated, the states that are reported, or both. It explains an engine's motion if that motion is
the exact solution of the changed scene, reported in the changed way. Faults that give the same motion of a probe cannot be distinguished by
it, so that other probes are compared too. Two faults at once are recognised as well. If no known fault explains a motion, its
symptoms are stated: which quantities differ from the exact solution, and by how much.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from itertools import combinations

import numpy as np

from dropspin.comparisons.conformance.impacts import (
    OF_NOTE,
    OF_REBOUND,
    PECULIARITIES,
    decaying_restitution,
    explain_impact,
    turning_impulse,
)
from dropspin.comparisons.conformance.offset import off_centre
from dropspin.comparisons.conformance.outcomes import CheckFailed, Declined, Noted, digits_that_differ, instead
from dropspin.comparisons.conformance.probes import DT, PROBES, Probe, differences
from dropspin.comparisons.engines.base import Engine, KnownLimitation
from dropspin.comparisons.faults.fault_model import FaultModel
from dropspin.comparisons.faults.mistakes import MISTAKES, Mistake
from dropspin.comparisons.faults.parameters import FAULT_MODELS
from dropspin.comparisons.faults.shapes import SHAPE_FAULTS
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.running.recording import Breakdown, record, try_record
from dropspin.scenarios import Scenario, Trajectory, truth_for
from dropspin.scenarios.rotations import rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, RATES, SPIN, VELOCITY, Array
from dropspin.scenarios.text import rounded
from dropspin.scenarios.truths import LAWS, Law, exact_solution

Fault = FaultModel | Mistake
SINGLY: tuple[Fault, ...] = (*(fault for fault in FAULT_MODELS if fault.about != "start"), *SHAPE_FAULTS, *MISTAKES)
"""The start has a check of its own."""
PAIRS = tuple(first.and_also(second) for first, second in combinations(FAULT_MODELS, 2) if first.about != second.about)
QUANTITIES = (("position", "m"), ("attitude", "rad"), ("velocity", "m/s"), ("angular velocity", "rad/s"))
"""Those of `differences`."""
CLEAR = 1e-3
"""Share of a speed, and ratio of a friction impulse, from which a difference is stated."""
ALONG = 0.1
"""Change of the direction of an angular momentum, over the fall of its size, from which damping is not the only explanation."""
ELSEWHERE = 0.1
"""Change of angular momentum about the contact point, over M r v, from which it is stated."""
CONTRADICTIONS = 2
"""Number of probes in which another motion excludes a fault that explains none."""
TURNED = math.radians(1.0)
"""Angle from which the direction of friction is stated to be wrong."""


def check_motion(engine: Engine, probe: Probe) -> str:
    """The motion of a probe."""
    refusal = engine.refusal(probe.scene)
    if refusal is not None:
        raise Declined(refusal)
    recording = record(engine, probe.scene, DT, verify=False)
    states, exact = recording.motion.states[probe.rows], probe.exact
    if probe.off(states, exact) <= 1.0:
        position, attitude, velocity, spin = differences(states, exact)
        return f"errors: {position:.2g} m, {attitude:.2g} rad, {velocity:.2g} m/s, {spin:.2g} rad/s"
    explaining = [limitation.message for limitation in recording.limitations if _explains(limitation, states, exact, probe)]
    if explaining:
        raise Noted("; ".join(explaining))
    law = _own_law(engine, probe, states)
    if law is not None:
        raise Noted(f"impacts follow the {law} law, as the engine states")
    mistake = _in_impacts(engine, probe, recording.motion)
    if mistake is not None:
        raise mistake
    fault = explain_motion(probe, states, lambda other: _states(engine, other))
    if fault is None:
        raise CheckFailed("; ".join(symptoms(probe, recording.motion)))
    raise Noted(fault.message) if fault.is_peculiarity else CheckFailed(fault.message)


def _in_impacts(engine: Engine, probe: Probe, motion: Trajectory) -> CheckFailed | Noted | None:
    """A mistake in an impact, or that restitution decays, by which another fault could seem to explain the motion."""
    mistake = explain_impact(probe.scene, motion)
    if mistake in OF_REBOUND and _rebounds_rightly(engine, probe):
        mistake = None
    is_stated = mistake == OF_NOTE and "law note" in (engine.discretisation(probe.scene) or "")  # the motion then differs otherwise
    if mistake is not None and not is_stated:
        return Noted(mistake) if mistake in PECULIARITIES else CheckFailed(mistake)
    decay = decaying_restitution(engine) if probe.scene.floor is not None and probe.scene.floor.friction == "none" else None
    return None if decay is None else CheckFailed(decay)


def _rebounds_rightly(engine: Engine, probe: Probe) -> bool:
    """Whether the engine is right in another probe of the same body and friction, which a mistake of the rebound changes too."""
    for other in PROBES:
        (own, floor), is_same_body = (probe.scene.floor, other.scene.floor), other.scene.body == probe.scene.body
        is_alike = other != probe and is_same_body and own is not None and floor is not None and own.friction == floor.friction
        states = _states(engine, other) if is_alike else None
        if states is not None and other.off(states, other.exact) <= 1.0:
            return True
    return False


def _states(engine: Engine, probe: Probe) -> Array | None:
    """The engine's states of a probe, shape (2, 13); None if it declines the scene or breaks down, which the check of that probe states."""
    recording = try_record(engine, probe.scene, DT, verify=False)
    return None if isinstance(recording, Breakdown) else recording.motion.states[probe.rows]


def _own_law(engine: Engine, probe: Probe, states: Array) -> Law | None:
    """The impact law that an engine names in its discretisation, if its motion follows that law."""
    named = engine.discretisation(probe.scene) or ""
    for law in LAWS:
        truth = truth_for(probe.scene, law) if f"law {law}" in named else None
        if truth is not None and probe.off(states, truth(probe.times).states) <= 1.0:
            return law
    return None


def _explains(limitation: KnownLimitation, states: Array, exact: Array, probe: Probe) -> bool:
    """Whether a known limitation explains the errors of position and attitude, and with them those of the velocities."""
    explained, (position, attitude, _, _) = limitation.explained_errors, differences(states, exact)
    errors = zip(("position_error", "orientation_error"), (position, attitude), probe.allowed, strict=False)
    return bool(explained) and all(error <= max(explained.get(name, 0.0), allowed) for name, error, allowed in errors)


def explain_motion(probe: Probe, states: Array, motion_of: Callable[[Probe], Array | None]) -> Fault | None:
    """The fault, or the two, that give an engine's states of a probe, shape (2, 13); None if there are none.

    Several faults may give the same motion of a probe. A fault is no explanation if it changes the motion of another probe in which the
    engine is right; of those that are left, the one is taken that gives the motion of the most probes.

    Args:
        probe: The probe.
        states: The engine's states of it.
        motion_of: Function from another probe to the engine's states of it, or to None if the engine has none.
    """
    # The exact solution of a box on its corner takes too long for thousands of pairs.
    shapes = {*Engine.shapes, probe.scene.body.shape}
    for faults in (SINGLY, PAIRS) if _has_pairs(probe) else (SINGLY,):
        motions = _motions(probe, faults)
        off = dict(zip(motions, np.round(probe.off(states, np.array([*motions.values()])), 3), strict=True))
        candidates = sorted((fault for fault in motions if off[fault] <= 1.0), key=off.__getitem__)
        known = PROBES if faults is SINGLY else list(filter(_has_pairs, PROBES))
        others = [other for other in known if other != probe and other.scene.body.shape in shapes]
        best = _best(candidates, others, motion_of)
        if best is not None:
            return best
    return None


def _has_pairs(probe: Probe) -> bool:
    return probe.scene.floor is None or probe.scene.body.is_ball


def _best(candidates: Iterable[Fault], probes: Iterable[Probe], motion_of: Callable[[Probe], Array | None]) -> Fault | None:
    """The fault that gives the engine's states of the most probes.

    A fault is left out if it changes a probe in which the engine is right, or if it explains no other probe and gives other states than the
    engine's in several.
    """
    explained = dict.fromkeys(candidates, 0)
    contradicted = dict.fromkeys(explained, 0)
    for probe in probes:
        exact, motions = probe.exact, _motions(probe, tuple(explained))
        changed = {fault: states for fault, states in motions.items() if probe.off(states, exact) > 1.0}
        of_engine = motion_of(probe) if changed else None
        if of_engine is None:
            continue
        for fault, states in changed.items():
            if probe.off(of_engine, states) <= 1.0:
                explained[fault] += 1
            elif probe.off(of_engine, exact) <= 1.0:
                del explained[fault]
            else:
                contradicted[fault] += 1
    likely = [fault for fault, probes_of_it in explained.items() if probes_of_it or contradicted[fault] < CONTRADICTIONS]
    return max(likely, key=explained.__getitem__, default=None)


@cache
def _motions(probe: Probe, faults: tuple[Fault, ...]) -> dict[Fault, Array]:
    """The states of a probe with each of some faults for which they are known, shape (2, 13)."""
    return {fault: states for fault in faults if (states := fault.motion(probe.scene, probe.times)) is not None}


def explain_start(scene: Scenario, state: Array, allowed: float) -> FaultModel | None:
    """The fault, or the two, that give a state at the start, shape (13,), within `allowed` times its largest number, if any."""
    close = allowed * np.abs(scene.initial_state).max()
    for fault in (*FAULT_MODELS, *PAIRS):
        start = fault.start(scene)
        # A fault made both when setting and when reading a state cancels at the start, which then is no evidence of it.
        if np.abs(start - state).max() <= close < np.abs(start - scene.initial_state).max():
            return fault
    return None


def symptoms(probe: Probe, motion: Trajectory) -> Iterator[str]:
    """What is wrong in an engine's motion of a probe, the most specific first; at least one sentence."""
    rows, exact = motion.states, probe.exact
    if not np.isfinite(rows).all():
        yield "the state is not finite"
        return
    if probe.scene.floor is not None:
        yield from _of_first_contact(probe, Comparison.with_truth(probe.scene, motion, exact_solution(probe.scene)))
    elif off := off_centre(probe.scene, motion, exact_solution(probe.scene)(motion.t).position):
        yield off
        return
    elif not np.any(rows[-1, RATES]) and np.any(exact[-1, RATES]):
        yield "the body stops: the engine puts it to sleep"
        return
    elif probe.scene.gravity is None:
        yield from _of_flight(probe.scene, rows[probe.rows], exact)
    for (name, unit), error, allowed in zip(QUANTITIES, differences(rows[probe.rows], exact), probe.allowed, strict=True):
        if not error <= allowed:
            yield f"{name} is off by {error:.{min(digits_that_differ(error, allowed), 4)}g} {unit} (allowed: {allowed:g} {unit})"


def _of_flight(scene: Scenario, states: Array, exact_states: Array) -> Iterator[str]:
    """Speeds at the end of a motion without gravity and floor; of unequal moments the angular momentum, as the angular speed varies.

    Velocities that are wrong beside right positions, or angular velocities beside right attitudes, are not due to damping.
    """
    end, exact = states[-1], exact_states[-1]
    (position, attitude, *_), inertia = differences(states, exact_states), scene.body.inertia_tensor
    spin = ("angular velocity", "rad/s", end[SPIN], exact[SPIN])
    if np.ptp(np.linalg.eigvalsh(inertia)) > CLEAR * inertia.max():
        got, right = (rotate(state[ORIENTATION], inertia @ unrotate(state[ORIENTATION], state[SPIN])) for state in (end, exact))
        spin = ("angular momentum", "kg m²/s", got, right)
    speeds = (("speed", "m/s", end[VELOCITY], exact[VELOCITY]), position, VELOCITY), (spin, attitude, SPIN)
    for (quantity, unit, got, right), off, part in speeds:
        final, expected = float(np.linalg.norm(got)), float(np.linalg.norm(right))
        if abs(final - expected) > CLEAR * expected:
            too_fast, too_slow = "", "damping or a clamp that the scene does not have: "
            if scene.damping is not None:
                too_fast, too_slow = "damping is missing or too weak: ", "damping is too strong, or a clamp: "
            elif quantity == "angular momentum" and end[SPIN] @ got >= exact[SPIN] @ right:
                too_slow = ""  # damping lowers the energy too
            elif quantity == "angular momentum" and np.linalg.norm(got - right * final / expected) > ALONG * (expected - final):
                too_slow = "damping, a clamp or a wrong gyroscopic term: "  # damping in proportion to the momentum does not turn it
            why, beside = too_slow if final < expected else too_fast, ""
            if off <= CLEAR * float(np.linalg.norm(exact[part])) * scene.duration:
                why, beside = "", f", beside {'positions' if quantity == 'speed' else 'attitudes'} that are right"
            yield f"{why}the final {quantity} is {instead(final, expected, unit)}{beside}"


def _of_first_contact(probe: Probe, case: Comparison) -> Iterator[str]:
    """The place of the first contact, and its impulse along the normal and along the floor, over the mass."""
    scene, first = probe.scene, case.first_contact
    assert scene.floor is not None
    allowed_position, _, allowed, _ = probe.allowed
    if first is None:
        stays = scene.starts_above_floor and np.ptp(case.motion.position[:, 1]) <= allowed_position
        held = "the body does not fall: gravity is missing, or the floor supports it from the first step on"
        yield held if stays else "the floor does not change the velocity"
        return
    before, after = first
    height = float(case.motion.position[before, 1])
    if case.impacts:
        times, step = case.motion.t, 2.0 * case.dt
        impact = float(np.interp(case.impacts[0], case.exact.t, case.exact.position[:, 1]))
        if abs(height - impact) > allowed_position + step * abs(float(case.motion.velocity[before, 1])):
            yield f"the first contact begins at a height of {instead(height, impact, 'm')}"
            if not scene.body.is_ball:  # it touches elsewhere, so that the impulse at the exact contact point says nothing
                return
        # The impact of the engine may be a step or two early or late; the next one is another.
        before = min(before, int(np.searchsorted(times, case.impacts[0] - step)))
        end = case.impacts[1] if len(case.impacts) > 1 else times[-1]
        after = min(max(after, int(np.searchsorted(times, case.impacts[0] + step))), int(np.searchsorted(times, end - step)))
    duration = (after - before) * case.dt
    change, exact = (rows.velocity[after] - rows.velocity[before] - duration * scene.acceleration for rows in (case.motion, case.exact))
    if turning := turning_impulse(scene, case.motion.states[[before, after]]):
        yield turning
        return
    if case.impacts and abs(change[1] - exact[1]) > allowed:
        sampled = Comparison(scene, case.exact, case.exact, case.impacts)
        wrong, right = (METRICS["restitution_error"].value_or_nan([compared]) for compared in (case, sampled))
        if abs(wrong - right) > CLEAR:
            yield f"restitution is {instead(scene.floor.restitution + wrong - right, scene.floor.restitution)}"
    moment = METRICS["contact_momentum_error"]
    if moment.applies(scene, exact_solution(scene)) and (turned := moment.value_or_nan([case])) > ELSEWHERE:
        yield (
            "an impulse at the contact point does not explain the change of the velocities in the first contact: the angular momentum "
            f"about it changes by {turned:.2g} of mass × distance from the centre × speed"
        )
    if float(np.linalg.norm((change - exact)[[0, 2]])) > allowed:
        yield from _of_friction(change, exact)


def _of_friction(change: Array, exact: Array) -> Iterator[str]:
    """The size of the friction impulse over the normal one, and its direction."""
    strength, expected = (float(np.linalg.norm(impulse[[0, 2]]) / impulse[1]) for impulse in (change, exact))
    if abs(strength - expected) > CLEAR:
        yield f"the ratio of the friction impulse to the normal impulse is {instead(strength, expected)}"
    angle = abs(math.remainder(math.atan2(change[0], change[2]) - math.atan2(exact[0], exact[2]), math.tau))
    if strength > CLEAR and expected > CLEAR and angle > TURNED:
        yield f"friction acts {rounded(math.degrees(angle), 2)}° from its exact direction"
