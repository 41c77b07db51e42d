"""How far a figure may move before it says that something has changed: a tolerance for each, from how it was measured.

    metrics    rounding over so many steps, and what luck may do: one of the start phases falling into the neighbouring step,
               or, where there is one start only, what a start that is moved by some ulp makes of the figure
    orders     what becomes of them when the errors that they were found from move by their tolerances
    limits     the same, and no less than their own uncertainty
    means      of ensembles: the confidence interval of the difference between two draws

No tolerance is a share of the figure: an engine that is exact to 1e-12 is held to 1e-12.
"""

import math

import numpy as np
from numpy.typing import NDArray

from scenarios import Scenario

Array = NDArray[np.float64]

NEGLIGIBLE = 3e-8
"""Errors as small as this, of the metric's own scale, are put down to rounding and to the residues of iterative solvers."""
ULPS_A_STEP = 16.0
NUDGE = 16.0 * float(np.finfo(float).eps)
"""By how much of itself each number of a start is moved, up or down, to see what becomes of rounding."""
ONE_DRAW = 10.0
"""What one nudge has moved a figure by tells what another would by its order of magnitude only."""
OF_TWO_DRAWS = math.sqrt(2.0)
"""The interval of a difference between two means, of one mean's."""


def rounding(scene: Scenario, unit: str, precision: type, steps: float | Array) -> float | Array:
    """What rounding alone may bring about in so many steps of an engine, solvers' residues included, in a metric's unit."""
    return _scale(scene, unit) * (NEGLIGIBLE + _of_steps(precision, steps))


def tolerance(scene: Scenario, unit: str, precision: type, steps: int, luck: float) -> float:
    """How far a metric may move: by luck, and by rounding; without contact there is no iterative solver to leave a residue."""
    residue = 0.0 if scene.floor is None else NEGLIGIBLE
    return luck + _scale(scene, unit) * float(residue + _of_steps(precision, steps))


def nudged(scene: Scenario) -> Scenario:
    """The scene from a start that a few ulp tell from its own."""
    signs = np.where(np.arange(13) % 3 == 0, -1.0, 1.0)  # not all alike: that would be a change of units
    return scene.starting_at(scene.initial_state * (1.0 + NUDGE * signs))


def _of_steps(precision: type, steps: float | Array) -> float | Array:
    return ULPS_A_STEP * float(np.finfo(precision).eps) * steps


def _scale(scene: Scenario, unit: str) -> float:
    """What rounding is relative to: the scene's own lengths, speeds and duration; 1 for ratios and angles."""
    length = scene.body.size + float(np.linalg.norm(scene.start.position))
    if unit == "m/s":
        return math.sqrt(float(np.linalg.norm(scene.acceleration)) * length) + float(np.linalg.norm(scene.start.velocity))
    return {"m": length, "1/s": 1.0 / scene.duration}.get(unit, 1.0)
