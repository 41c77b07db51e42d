"""Tolerances: how far a result may move between two runs before it counts as changed, derived from how it was measured.

    metrics              rounding over the steps, and sampling noise: one of the start phases may fall into the neighbouring step.
                         With one start, or a body that starts on the floor: the effect of perturbing the starts by some ulp instead
    orders               the change when the errors that they were fitted to move by their tolerances
    asymptotic errors    the width of their interval; those that the time steps leave open are not compared
    ensemble means       the confidence interval of the difference between two draws

No tolerance is a share of the value: an engine that is exact to 1e-12 is compared to 1e-12.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scenarios import Scenario

Array = NDArray[np.float64]

NEGLIGIBLE = 3e-8
"""Errors below this, relative to the metric's scale, are attributed to rounding and to the residuals of iterative solvers."""
MATTERS = 1e-5
"""Errors below this, relative to the metric's scale, do not matter to any use of an engine: contact solvers stop at such residuals."""
ULPS_PER_STEP = 16.0
PERTURBATION = 16.0
"""By how many ulp of the engine's precision each number of a start is perturbed, to see the effect of rounding."""
_FIRST, _SECOND = np.random.default_rng(0).choice([-1.0, 1.0], (2, 13))
SIGNS = (_FIRST, -_FIRST, _SECOND, -_SECOND)
"""The signs of the perturbations: two random sets and their opposites."""
FEW_DRAWS = 10.0
"""Factor on the largest effect of a few perturbations: others may have ten times the effect."""
TRUTH_ACCURACY = 1e-12
"""How far exact solutions may differ that are computed with other versions of libraries."""
OF_TWO_DRAWS = math.sqrt(2.0)
"""The interval of a difference between two means, relative to the interval of one mean."""


def rounding(scene: Scenario, unit: str, precision: type, steps: Array) -> Array:
    """The largest error that rounding, solvers' residuals included, may cause in a number of steps, in a metric's unit."""
    rounded: Array = scale(scene, unit) * (NEGLIGIBLE + ULPS_PER_STEP * float(np.finfo(precision).eps) * steps)
    return rounded


def negligible(scene: Scenario, unit: str) -> float:
    """The largest error that does not matter, in a metric's unit: the same share of the metric's scale for every engine."""
    return MATTERS * scale(scene, unit)


def tolerance(scene: Scenario, unit: str, precision: type, steps: int, sampling_noise: float) -> float:
    """How far a metric may move: by sampling noise, and by rounding of random sign; without a floor no solver leaves a residual."""
    residual = 0.0 if scene.floor is None else NEGLIGIBLE
    rounded = ULPS_PER_STEP * float(np.finfo(precision).eps) * math.sqrt(steps)
    return sampling_noise + scale(scene, unit) * (residual + TRUTH_ACCURACY + rounded)


def perturbed(scene: Scenario, starts: Sequence[Scenario], precision: type) -> list[list[Scenario]]:
    """A scene's starts perturbed by a few ulp, set by set; empty where there are many starts and none touches the floor.

    A body that touches the floor is perturbed by ulps of double precision, as those of single precision would lift or sink it. Its
    sign then decides whether all of the starts touch or none; so each set of perturbations is followed by its opposite.
    """
    if len(starts) == 1:
        return [[_moved(scene, signs, precision)] for signs in SIGNS]
    if scene.floor is None or scene.starts_above_floor:
        return []
    # It rolls about its corner: perturbed by ulps of single precision it would slip, which is another motion.
    return [[_moved(start, signs, np.float64) for start in starts] for signs in SIGNS[:2]]


def _moved(scene: Scenario, signs: Array, precision: type) -> Scenario:
    start, sizes = scene.initial_state, np.full(13, PERTURBATION * float(np.finfo(precision).eps))
    if scene.floor is not None and not scene.starts_above_floor:
        sizes[:7] = PERTURBATION * float(np.finfo(float).eps)
    return scene.starting_at(start * (1.0 + sizes * signs))


def scale(scene: Scenario, unit: str) -> float:
    """The scale of rounding errors: the scene's lengths, speeds and duration; 1 for ratios and angles."""
    length = scene.body.size + float(np.linalg.norm(scene.start.position))
    if unit == "m/s":
        return math.sqrt(float(np.linalg.norm(scene.acceleration)) * length) + float(np.linalg.norm(scene.start.velocity))
    return {"m": length, "1/s": 1.0 / scene.duration}.get(unit, 1.0)
