"""Recognition of faults by their motion.

A fault model changes the scene that is simulated, the states that are reported, or both. It explains an engine's motion if that motion is
the exact solution of the changed scene, reported in the changed way.

Faults that give the same motion of a probe cannot be distinguished by it, so that other probes are compared too. Two faults at once are
recognised as well.
"""

from collections.abc import Callable, Iterable
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.conformance.probes import PROBES, Probe
from dropspin.comparisons.faults.conventions import CONVENTIONS
from dropspin.comparisons.faults.fault_model import Exact, FaultModel
from dropspin.comparisons.faults.flight import FLIGHT
from dropspin.comparisons.faults.impact import IMPACT
from dropspin.scenarios import Scenario

Array = NDArray[np.float64]

NO_FAULT = FaultModel("")
FAULT_MODELS = (*CONVENTIONS, *FLIGHT, *IMPACT)


def explain_motion(probe: Probe, found: Array, motion_of: Callable[[Probe], Array | None]) -> FaultModel | None:
    """The fault, or the two, that give an engine's states of a probe, shape (2, 13); None if there are none.

    Several faults may give the same motion of a probe. A fault is no explanation if it changes the motion of another probe in which the
    engine is right; of those that are left, the one is taken that gives the motion of the most probes.

    Args:
        probe: The probe.
        found: The engine's states of it.
        motion_of: Function from another probe to the engine's states of it, or to None if the engine has none.
    """
    # The exact solution of a box on its corner takes too long for thousands of pairs.
    counts = (1, 2) if _has_pairs(probe) else (1,)
    for count in counts:
        faults, motions = _motions_with_faults(probe, count)
        if not faults:
            continue
        off = np.round(probe.off(found, motions), 3)
        candidates = [faults[number] for number in np.argsort(off, kind="stable") if off[number] <= 1.0]
        others = [other for other in PROBES if other != probe and (count == 1 or _has_pairs(other))]
        best = _best(candidates, others, motion_of)
        if best is not None:
            return best
    return None


def _has_pairs(probe: Probe) -> bool:
    return probe.scene.floor is None or probe.scene.body.is_ball


def _best(candidates: Iterable[FaultModel], probes: Iterable[Probe], motion_of: Callable[[Probe], Array | None]) -> FaultModel | None:
    """The fault that gives the engine's states of the most probes, without those that change a probe in which the engine is right."""
    explained = dict.fromkeys(candidates, 0)
    for probe in probes:
        known: Exact = {}
        exact = NO_FAULT.motion(probe.scene, probe.times, known)
        assert exact is not None
        motions = {fault: states for fault in explained if (states := fault.motion(probe.scene, probe.times, known)) is not None}
        changed = {fault: states for fault, states in motions.items() if probe.off(states, exact) > 1.0}
        found = motion_of(probe) if changed else None
        if found is None:
            continue
        for fault, states in changed.items():
            if probe.off(found, states) <= 1.0:
                explained[fault] += 1
            elif probe.off(found, exact) <= 1.0:
                del explained[fault]
    return max(explained, key=explained.__getitem__, default=None)


@cache
def _motions_with_faults(probe: Probe, count: int) -> tuple[list[FaultModel], Array]:
    """All faults, or pairs of them, whose motion of a probe is known, and these motions, shape (faults, 2, 13)."""
    singly = [fault for fault in FAULT_MODELS if fault.about != "start"]  # the start has a check of its own
    known: Exact = {}
    found = [
        (fault, motion)
        for fault in (singly if count == 1 else _pairs())
        if (motion := fault.motion(probe.scene, probe.times, known)) is not None
    ]
    return [fault for fault, _ in found], np.array([motion for _, motion in found])


def explain_start(scene: Scenario, state: Array, allowed: float) -> FaultModel | None:
    """The fault, or the two, that give a state at the start, shape (13,), within `allowed` times its largest number, if any."""
    for candidates in (FAULT_MODELS, _pairs()):
        for fault in candidates:
            start, close = fault.start(scene), allowed * np.abs(scene.initial_state).max()
            # A fault made both when setting and when reading a state cancels at the start, which then is no evidence of it.
            if np.abs(start - state).max() <= close < np.abs(start - scene.initial_state).max():
                return fault
    return None


def _pairs() -> Iterable[FaultModel]:
    return (first.and_also(second) for first, second in combinations(FAULT_MODELS, 2) if first.about != second.about)
