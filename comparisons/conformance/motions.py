"""The check of a probe: the engine's motion equals the exact solution; if not, which fault or symptom explains the difference.

A fault model changes the scene that is simulated, the states that are reported, or both. It explains an engine's motion if that motion is
the exact solution of the changed scene, reported in the changed way. Faults that give the same motion of a probe cannot be distinguished by
it, so that other probes are compared too. Two faults at once are recognised as well. If no known fault explains a motion, its
symptoms are stated.
"""

from collections.abc import Callable, Iterable
from functools import cache
from itertools import combinations

import numpy as np

from dropspin.comparisons.conformance.impacts import OF_NOTE, OF_REBOUND, PECULIARITIES, explain_impact, verify_no_decay
from dropspin.comparisons.conformance.outcomes import CheckFailed, Declined, Noted
from dropspin.comparisons.conformance.probes import DT, PROBES, Probe, differences
from dropspin.comparisons.conformance.symptoms import symptoms
from dropspin.comparisons.engines.base import Engine, KnownLimitation
from dropspin.comparisons.faults.fault_model import FaultModel
from dropspin.comparisons.faults.mistakes import MISTAKES, Mistake
from dropspin.comparisons.faults.parameters import FAULT_MODELS
from dropspin.comparisons.faults.shapes import SHAPE_FAULTS
from dropspin.comparisons.running.driving import Breakdown, record, try_record
from dropspin.scenarios import Scenario, Trajectory, truth_for
from dropspin.scenarios.state import Array
from dropspin.scenarios.truths import LAWS, Law

Fault = FaultModel | Mistake
SINGLY: tuple[Fault, ...] = (*(fault for fault in FAULT_MODELS if fault.about != "start"), *SHAPE_FAULTS, *MISTAKES)
"""The start has a check of its own."""
PARTS = {first.and_also(second): (first, second) for first, second in combinations(FAULT_MODELS, 2) if first.about != second.about}
PAIRS = tuple(PARTS)
CONTRADICTIONS = 2
"""Number of probes in which another motion excludes a fault that explains none."""


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
    _verify_impacts(engine, probe, recording.motion)
    fault = explain_motion(probe, states, lambda other: _states(engine, other))
    if fault is None:
        raise CheckFailed("; ".join(symptoms(probe, recording.motion)))
    raise Noted(fault.message) if fault.is_peculiarity else CheckFailed(fault.message)


def _verify_impacts(engine: Engine, probe: Probe, motion: Trajectory) -> None:
    """Raise an exception for a mistake in an impact, or if restitution decays, by which another fault could seem to explain the motion."""
    mistake = explain_impact(probe.scene, motion)
    if (mistake in OF_REBOUND and _rebounds_rightly(engine, probe)) or (mistake == OF_NOTE and not _follows_note(engine, probe)):
        mistake = None
    is_stated = mistake == OF_NOTE and "law note" in (engine.discretisation(probe.scene) or "")  # the motion then differs otherwise
    if mistake is not None and not is_stated:
        raise Noted(mistake) if mistake in PECULIARITIES else CheckFailed(mistake)
    if probe.scene.floor is not None and probe.scene.floor.friction == "none":
        verify_no_decay(engine)


def _rebounds_rightly(engine: Engine, probe: Probe) -> bool:
    """Whether the engine is right in another probe of the same body and friction, which a mistake of the rebound changes too."""
    for other in PROBES:
        own, floor = probe.scene.floor, other.scene.floor
        is_alike = other != probe and other.scene.body == probe.scene.body and own and floor and own.friction == floor.friction
        if is_alike and (states := _states(engine, other)) is not None and other.off(states, other.exact) <= 1.0:
            return True
    return False


def _follows_note(engine: Engine, probe: Probe) -> bool:
    """Whether the body follows the law of the note with a spin too; without one, a floor that grips gives the same impact."""
    for scene in (other.scene for other in PROBES):
        if scene.body == probe.scene.body and scene.floor == probe.scene.floor and any(scene.start.angular_velocity):
            recording = try_record(engine, scene, DT, verify=False)
            if not isinstance(recording, Breakdown) and explain_impact(scene, recording.motion) != OF_NOTE:
                return False
    return True


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
    alone: set[Fault] = set()  # a pair is no explanation if one of its faults gives this motion by itself, and is excluded
    for faults in (SINGLY, PAIRS) if _has_pairs(probe) else (SINGLY,):
        motions = _motions(probe, faults)
        off = dict(zip(motions, np.round(probe.off(states, np.array([*motions.values()])), 3), strict=True))
        candidates = sorted((fault for fault in motions if off[fault] <= 1.0), key=off.__getitem__)
        barred: set[Fault] = {pair for pair, parts in PARTS.items() if not alone.isdisjoint(parts)}
        candidates = [fault for fault in candidates if fault not in barred]
        known = PROBES if faults is SINGLY else list(filter(_has_pairs, PROBES))
        others = [other for other in known if other != probe and other.scene.body.shape in shapes]
        best, excluded = _best(candidates, others, motion_of, is_pair=faults is PAIRS)
        if best is not None:
            return best
        alone = excluded
    return None


def _has_pairs(probe: Probe) -> bool:
    return probe.scene.floor is None or probe.scene.body.is_ball


def _best(
    candidates: Iterable[Fault], probes: Iterable[Probe], motion_of: Callable[[Probe], Array | None], *, is_pair: bool
) -> tuple[Fault | None, set[Fault]]:
    """The fault that gives the engine's states of the most probes, and those that change a probe in which the engine is right.

    A fault is left out if it changes a probe in which the engine is right, or if it gives other states than the engine's in several and
    explains no other probe; of the thousands of pairs, some end like the engine by chance: one has to explain more probes than it does not.
    """
    explained = dict.fromkeys(candidates, 0)
    contradicted, excluded = dict.fromkeys(explained, 0), set[Fault]()
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
                excluded.add(fault)
            else:
                contradicted[fault] += 1
    if is_pair:
        likely = [fault for fault, number in explained.items() if number > contradicted[fault]]
    else:
        likely = [fault for fault, number in explained.items() if number > 0 or contradicted[fault] < CONTRADICTIONS]
    return max(likely, key=explained.__getitem__, default=None), excluded


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
