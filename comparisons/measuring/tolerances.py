"""How far a figure may move before it says that something has changed: a tolerance for each, from how it was measured.

    metrics    rounding over so many steps, and what sampling_noise may do: one of the start phases falling into the neighbouring step, and,
               where the body starts on the floor, or there is one start only, what starts that are moved by some ulp make of it
    orders     what becomes of them when the errors that they were found from move by their tolerances
    limits     the same, and no less than their own uncertainty
    means      of ensembles: the confidence interval of the difference between two draws

No tolerance is a share of the figure: an engine that is exact to 1e-12 is held to 1e-12.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scenarios import Scenario

Array = NDArray[np.float64]

NEGLIGIBLE = 3e-8
"""Errors as small as this, of the metric's own scale, are put down to rounding and to the residues of iterative solvers."""
ULPS_A_STEP = 16.0
PERTURBATION = 16.0
"""By how many ulp of the engine's precision each number of a start is moved, up or down, to see what becomes of rounding."""
_FIRST, _SECOND = np.random.default_rng(0).choice([-1.0, 1.0], (2, 13))
SIGNS = (_FIRST, -_FIRST, _SECOND, -_SECOND)
"""Which of them up, which down: two ways, and their opposites."""
FEW_DRAWS = 10.0
"""What a few nudges have moved a figure by tells what others would by its order of magnitude only."""
TRUTH = 1e-12
"""How far truths may be from each other that are computed with other libraries."""
OF_TWO_DRAWS = math.sqrt(2.0)
"""The interval of a difference between two means, of one mean's."""


def rounding(scene: Scenario, unit: str, precision: type, steps: Array) -> Array:
    """What rounding alone may bring about in so many steps of an engine, solvers' residues included, in a metric's unit."""
    rounded: Array = _scale(scene, unit) * (NEGLIGIBLE + ULPS_A_STEP * float(np.finfo(precision).eps) * steps)
    return rounded


def tolerance(scene: Scenario, unit: str, precision: type, steps: int, sampling_noise: float) -> float:
    """How far a metric may move: by sampling_noise, and by rounding that goes now up, now down; without a floor no solver leaves a residue."""
    residue = 0.0 if scene.floor is None else NEGLIGIBLE
    rounded = ULPS_A_STEP * float(np.finfo(precision).eps) * math.sqrt(steps)
    return sampling_noise + _scale(scene, unit) * (residue + TRUTH + rounded)


def perturbed(scene: Scenario, starts: Sequence[Scenario], precision: type) -> list[list[Scenario]]:
    """A scene's starts, moved by a few ulp, set by set; none where there are many starts and none touches the floor.

    A body that touches the floor stays at its height, but for ulps of double precision: those of single would put it somewhere else.
    Whether it touches is then rounding's to say, for all starts alike; so for each set there is one that goes the other way.
    """
    if len(starts) == 1:
        return [[_moved(scene, signs, precision)] for signs in SIGNS]
    if scene.floor is None or scene.starts_above_floor:
        return []
    # It rolls about its corner: by ulps of single precision it would slip, and be another scene.
    return [[_moved(start, signs, np.float64) for start in starts] for signs in SIGNS[:2]]


def _moved(scene: Scenario, signs: Array, precision: type) -> Scenario:
    start, sizes = scene.initial_state, np.full(13, PERTURBATION * float(np.finfo(precision).eps))
    if scene.floor is not None and not scene.starts_above_floor:
        sizes[:7] = PERTURBATION * float(np.finfo(float).eps)
    return scene.starting_at(start * (1.0 + sizes * signs))


def _scale(scene: Scenario, unit: str) -> float:
    """What rounding is relative to: the scene's own lengths, speeds and duration; 1 for ratios and angles."""
    length = scene.body.size + float(np.linalg.norm(scene.start.position))
    if unit == "m/s":
        return math.sqrt(float(np.linalg.norm(scene.acceleration)) * length) + float(np.linalg.norm(scene.start.velocity))
    return {"m": length, "1/s": 1.0 / scene.duration}.get(unit, 1.0)
