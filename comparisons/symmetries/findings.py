"""What the comparison of two motions that should be equal finds, and whether rounding explains their difference.

Rounding breaks every symmetry a little, and a sensitive motion amplifies that. So the initial state of the transformed scene is perturbed
by a few eps, and the nominal scene is run from there: a difference is attributed to rounding as long as it is not larger than the largest
recent effect of the perturbations, times a factor that allows for a rounding error in each time step. An effect that has passed, such as
that of a contact that is missed at the start, explains no later difference. Repeated runs must be equal bit for bit.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal, get_args

import numpy as np
import pandas as pd
from pydantic import Field, PlainValidator

from dropspin.comparisons.judging.verdicts import BREAKDOWNS, Judgement, Verdict
from dropspin.comparisons.measuring.differences import differences
from dropspin.comparisons.measuring.symmetries import BITWISE, kind_of
from dropspin.comparisons.measuring.tolerances import EPS_PER_STEP, FEW_DRAWS, MATTERS
from dropspin.comparisons.results.results import Results
from dropspin.comparisons.results.table import Case, Measurement, as_table
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.perturbed_starts import PERTURBATION
from dropspin.scenarios import Scenario
from dropspin.scenarios.state import POSITION, VELOCITY, Array

Effects = Callable[[], list[Array]]
"""A function that runs an engine from perturbed starts and returns the differences from its motion, each of shape (n,)."""
Pairs = Sequence[tuple[Array, Array]]
"""Motions that should be equal, states of shape (n, 13)."""
Status = Literal["kept", "rounding", "nearly kept", "lost", "not run"]
STATUSES: tuple[Status, ...] = get_args(Status)
"""From the best to the worst. Kept: rounding explains the difference, which is up to 1e-5 of the motion's sizes and speeds. Rounding:
rounding explains it, but it is larger. Nearly kept: rounding does not explain it, but it is up to 1e-5. Lost: it is larger. Not run: the
engine does not run the transformed scene, or breaks down in it.
"""

STEP_MULTIPLE = 1000.0
"""Rounding errors of a single time step, in eps of the scene's sizes and speeds, which some engines make in their transformations."""
SUB_STEPS = 64
"""The most sub-steps of a time step in which an engine may round a position."""
BY_CHANCE = 3.0
"""Factor on the largest effect of a few perturbations, if it is so large that it is due to chance."""


@dataclass(frozen=True)
class Finding:
    """Whether an engine keeps one symmetry, or repeats its result, in one scene.

    Attributes:
        scene: Name of the scene.
        engine: Label of the engine.
        symmetry: The symmetry, or the way in which the run was repeated.
        status: One of `STATUSES`.
        difference: The largest difference of the two motions, of angles [rad] and relative to sizes and speeds; NaN if there is none.
        step: The first time step at which rounding does not explain the difference; None if it does at all steps.
        time: The time of this step [s]; NaN if there is none.
        reason: Why there is no motion to compare; otherwise empty.
        verdict: The verdict on the run that gave no motion, such as `declined` or `crashed`; otherwise empty.
        motions: If the symmetry is lost, the engine's motion and the one that should equal it, states of shape (n, 13); a stored study does
            not have them.
    """

    scene: str
    engine: str
    symmetry: str
    status: Status
    difference: float = math.nan
    step: int | None = None
    time: float = math.nan
    reason: str = ""
    verdict: Verdict | Literal[""] = ""
    motions: Annotated[tuple[Array, Array] | None, PlainValidator(lambda motions: None), Field(exclude=True)] = field(
        default=None, repr=False, compare=False
    )


def not_run(none: Finding, broken: Breakdown) -> Finding:
    """The finding where a run gave no motion."""
    return replace(none, reason=broken.reason, verdict=broken.verdict)


def judged(none: Finding, scene: Scenario, dt: float, pairs: Pairs, effects: Effects | None, precision: type, away: float = 0.0) -> Finding:
    """A finding with its status; where rounding has no effect, the motions of each pair must be equal bit for bit.

    Args:
        none: The finding without a status.
        scene: The scene.
        dt: Time step [s].
        pairs: The motions that should be equal.
        effects: The function that measures effects of rounding; None if it has none.
        precision: Of the engine's states.
        away: How much farther from the origin a translation moves the start, over the size of the body. An engine with sub-steps rounds its
            position there more often than once in a step; the rotation depends on the position only if there is a floor.
    """
    of_pairs = [differences(scene, *pair) for pair in pairs]
    difference: Array = np.max(of_pairs, axis=0)
    largest, steps = float(difference.max()), np.arange(len(difference), dtype=float)
    allowed, eps = np.zeros_like(difference), float(np.finfo(precision).eps)
    if effects is not None:
        allowed = rounding(steps, precision)
    if effects is not None and not (difference <= allowed).all():  # most engines need no perturbed runs
        grown = _recent_maximum(np.max([np.zeros_like(difference), *effects()], axis=0))
        # A large effect is one of chance, such as a contact that is missed in a time step: it does not add up, and others are as large.
        small = np.minimum(grown * (FEW_DRAWS + steps / PERTURBATION), MATTERS * eps / np.finfo(float).eps)
        allowed = BY_CHANCE * grown + small + allowed
    beyond = np.flatnonzero(~(difference <= allowed))
    if not len(beyond):
        return replace(none, status="kept" if largest <= MATTERS else "rounding", difference=largest)
    first = int(beyond[0])
    # What perturbations explain does not count, even if it is large.
    unexplained = float(difference[beyond].max())
    far: Array = allowed + 0.5 * eps * away * SUB_STEPS * steps
    if unexplained > MATTERS and (difference <= far).all() and (scene.floor is not None or _turn_alike(scene, pairs, allowed)):
        return replace(none, status="rounding", difference=largest)
    status: Status = "nearly kept" if unexplained <= MATTERS else "lost"
    motions = pairs[int(np.argmax([values.max() for values in of_pairs]))] if status == "lost" else None
    return replace(none, status=status, difference=unexplained, step=first, time=first * dt, motions=motions)


def _turn_alike(scene: Scenario, pairs: Pairs, allowed: Array) -> bool:
    """Whether orientations and spins differ by no more than is allowed: without a floor, no rounding of a position changes them."""
    for first, second in pairs:
        turned = second.copy()
        turned[:, POSITION], turned[:, VELOCITY] = first[:, POSITION], first[:, VELOCITY]
        if not (differences(scene, first, turned) <= allowed).all():
            return False
    return True


def rounding(steps: Array, precision: type) -> Array:
    """The difference that rounding explains after some steps, if the motion does not amplify it."""
    return float(np.finfo(precision).eps) * (STEP_MULTIPLE + EPS_PER_STEP * steps)


def _recent_maximum(values: Array) -> Array:
    """The largest value of the last half, at least, and of the last three quarters, at most, of the steps so far, shape (n,)."""
    maxima = values.copy()
    for start in (2**power for power in range((len(values) - 1).bit_length())):
        since = start // 2
        maxima[start : 2 * start] = np.maximum.accumulate(values[since : 2 * start])[start - since :]
    return maxima


def with_symmetries(results: Results, findings: Sequence[Finding], dt: float) -> Results:
    """A run with a row for each finding that compares two motions.

    A repeated run passes if it gives the same bits, a symmetry if rounding explains the difference, or if it is up to 1e-5. A run that
    breaks down, for an engine that ran the scene itself, has a row with this verdict; scenes that are declined have none.

    Args:
        results: The run.
        findings: The findings for its scenes and engines.
        dt: Their time step [s], one of the run.
    """
    ran = results.measurements.groupby(["scene", "engine"]).size().index
    having = [finding for finding in findings if finding.status != "not run" or finding.verdict in BREAKDOWNS]
    rows = as_table([_row(finding, dt) for finding in having if (finding.scene, finding.engine) in ran])
    return replace(results, table=pd.concat([results.table, rows], ignore_index=True))


def _row(finding: Finding, dt: float) -> Measurement:
    kind, bound = kind_of(finding.symmetry), 0.0 if finding.symmetry in BITWISE else MATTERS
    assert kind is not None
    if finding.status == "not run":
        assert finding.verdict
        judgement = Judgement(math.nan, finding.verdict, upper=bound, reason=finding.reason)
    else:
        fails = finding.status == "lost" or (finding.status == "nearly kept" and bound == 0.0)
        differ = "the motions differ" if bound == 0.0 else "rounding does not explain the difference"
        reason = f"{differ} from step {finding.step} on, at {finding.time:.4g} s"
        reason = {"kept": "", "rounding": "rounding explains the difference"}.get(finding.status, reason)
        # What perturbations explain is due to chance, and is of another size on another machine.
        tolerance = max(MATTERS, BY_CHANCE * finding.difference * (finding.status == "rounding"))
        judgement = Judgement(finding.difference, "failed" if fails else "passed", upper=bound, reason=reason, tolerance=tolerance)
    return Case(finding.scene, finding.engine, dt).measurement(kind, finding.symmetry, "1", judgement)
