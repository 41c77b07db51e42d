"""Tolerances: how much a result may differ between two runs before it counts as changed. They follow from how it was measured.

    metrics              rounding over the time steps, and sampling noise: the impact of one start phase may move to the neighbouring step.
                         If there is only one start, or if the body starts on the floor, sampling noise is replaced by the effect of
                         perturbing the initial states by some eps
    orders               the change of the order if the errors to which it is fitted change by their tolerances
    asymptotic errors    the width of their interval; unresolved ones are not compared
    ensemble means       the confidence interval of the difference between the means of two random ensembles

No tolerance is a share of the value: an engine that is exact to 1e-12 is compared to 1e-12.
"""

import math

import numpy as np

from dropspin.scenarios import Scenario
from dropspin.scenarios.state import Array

NEGLIGIBLE = 3e-8
"""Errors below this, relative to the metric's scale, are attributed to rounding and to the residuals of iterative solvers."""
MATTERS = 1e-5
"""Errors below this, relative to the metric's scale, do not matter to any use of an engine: contact solvers stop at such residuals."""
EPS_PER_STEP = 16.0
FEW_DRAWS = 10.0
"""Factor on the largest effect of a few perturbations, because others may have ten times the effect."""
TRUTH_ACCURACY = 1e-12
"""Largest difference between exact solutions that are computed with different versions of libraries."""
OF_TWO_DRAWS = math.sqrt(2.0)
"""Width of the interval of a difference between two means, relative to that of one mean."""


def rounding(scene: Scenario, unit: str, precision: type, steps: Array) -> Array:
    """The largest error that rounding and the residuals of solvers may cause in a number of steps, in the unit of the metric."""
    return scale(scene, unit) * (NEGLIGIBLE + EPS_PER_STEP * float(np.finfo(precision).eps) * steps)


def negligible(scene: Scenario, unit: str) -> float:
    """The largest negligible error in the unit of a metric, which is the same share of the metric's scale for every engine."""
    return MATTERS * scale(scene, unit)


def tolerance(scene: Scenario, unit: str, precision: type, steps: int, sampling_noise: float) -> float:
    """The tolerance of a metric: sampling noise and rounding of random sign; residuals of solvers occur only with a floor."""
    residual = 0.0 if scene.floor is None else NEGLIGIBLE
    rounded = EPS_PER_STEP * float(np.finfo(precision).eps) * math.sqrt(steps)
    return sampling_noise + scale(scene, unit) * (residual + TRUTH_ACCURACY + rounded)


def scale(scene: Scenario, unit: str) -> float:
    """The scale of rounding errors: the scene's lengths, speeds and duration; 1 for ratios and angles."""
    length = scene.body.size + float(np.linalg.norm(scene.start.position))
    if unit == "m/s":
        return math.sqrt(float(np.linalg.norm(scene.acceleration)) * length) + float(np.linalg.norm(scene.start.velocity))
    return {"m": length, "1/s": 1.0 / scene.duration}.get(unit, 1.0)
