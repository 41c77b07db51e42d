"""Recognition of faults by their motion.

A fault model changes the scene that is simulated, the states that are reported, or both. It explains an engine's motion if that motion is
the exact solution of the changed scene, reported in the changed way.

Faults that give the same motion of a probe cannot be distinguished by it. Two faults at once are recognised as well.
"""

from collections.abc import Iterable
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from comparisons.conformance.conventions import CONVENTIONS
from comparisons.conformance.fault_model import Exact, FaultModel
from comparisons.conformance.flight import FLIGHT
from comparisons.conformance.impact import IMPACT
from comparisons.conformance.probes import Probe
from scenarios import Scenario
from scenarios.body import Sphere

Array = NDArray[np.float64]

FAULT_MODELS = (*CONVENTIONS, *FLIGHT, *IMPACT)


def explain_motion(probe: Probe, found: Array) -> FaultModel | None:
    """The fault, or the two, that give an engine's states of a probe, shape (2, 13); None if there are none."""
    # The exact solution of a box on its corner takes too long for thousands of pairs.
    counts = (1, 2) if probe.scene.floor is None or isinstance(probe.scene.body, Sphere) else (1,)
    for count in counts:
        faults, motions = _motions_with_faults(probe, count)
        if not faults:
            continue
        off = np.round(probe.off(found, motions), 3)
        if off.min() <= 1.0:
            return faults[int(np.argmin(off))]
    return None


@cache
def _motions_with_faults(probe: Probe, count: int) -> tuple[list[FaultModel], Array]:
    """All faults, or pairs of them, whose motion of a probe is known, and these motions, shape (faults, 2, 13)."""
    singly = [fault for fault in FAULT_MODELS if fault.about != "start"]  # the start has a check of its own
    known: Exact = {}
    found = [(fault, motion) for fault in (singly if count == 1 else _pairs()) if (motion := fault.motion(probe, known)) is not None]
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
