"""The outcomes of some jobs, as arrays: verdicts, final states and metrics."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.measuring.comparison import Comparison, Unresolved
from dropspin.comparisons.measuring.metrics import METRICS, energy_drift, energy_gain, penetration
from dropspin.comparisons.measuring.motions import Motions
from dropspin.comparisons.running.recording import Breakdown
from dropspin.scenarios import Scenario, Trajectory, truth_for

Array = NDArray[np.float64]

STATE_COLUMNS = (
    *(f"position_{axis}" for axis in "xyz"),
    *(f"orientation_{axis}" for axis in "xyzw"),
    *(f"velocity_{axis}" for axis in "xyz"),
    *(f"angular_velocity_{axis}" for axis in "xyz"),
)
"""The columns of the final state."""
STANDARD_METRICS = ("energy_drift", "energy_gain", "penetration", "rebound", "rest_time")
"""Measured in every sweep; none needs a reference solution."""


@dataclass(frozen=True)
class Outcomes:
    """The outcomes of n jobs; NaN where there is no value.

    Attributes:
        verdict: As in the results of a run, shape (n,); empty for a job that has not been run.
        reason: The reason of the verdict, or the known limitations that the engine met, shape (n,).
        state: The final state, shape (n, 13).
        standard_metrics: The `STANDARD_METRICS`, shape (n, 5).
        metrics: The metrics that the spec asks for, shape (n, len(metrics)).
        steps: Number of steps, shape (n,).
        time_per_step: Wall time per step, recording included [s], shape (n,).
    """

    verdict: NDArray[Any]
    reason: NDArray[Any]
    state: Array
    standard_metrics: Array
    metrics: Array
    steps: NDArray[np.int64]
    time_per_step: Array

    @classmethod
    def empty(cls, size: int, metrics: int) -> "Outcomes":
        """The outcomes of jobs that have not been run."""
        verdict, reason = (np.full(size, "", dtype=object) for _ in range(2))
        state, standard, others = (np.full((size, width), np.nan) for width in (len(STATE_COLUMNS), len(STANDARD_METRICS), metrics))
        return cls(verdict, reason, state, standard, others, np.zeros(size, dtype=np.int64), np.full(size, np.nan))

    def __getitem__(self, indices: slice) -> "Outcomes":
        """The outcomes of some of the jobs."""
        return Outcomes(*(column[indices] for column in vars(self).values()))

    def set_breakdown(self, index: int, breakdown: Breakdown) -> None:
        """Record why a job has no motion."""
        self.verdict[index], self.reason[index] = breakdown.verdict, " ".join(breakdown.reason.split())

    def set_measured(self, indices: NDArray[np.intp], states: Array, motions: Motions) -> None:
        """Record the final states and the standard metrics of some jobs, by the states of their motions, shape (len(indices), n, 13)."""
        self.verdict[indices] = "measured"
        self.steps[indices] = motions.last_row
        self.state[indices] = states[np.arange(len(indices)), motions.last_row]
        self.standard_metrics[indices] = standard_metrics(motions)


def standard_metrics(motions: Motions) -> Array:
    """The `STANDARD_METRICS` of B motions, shape (B, 5); NaN where one does not apply.

    Energy drift and gain do not apply with damping, nor where there is no energy at all, and drift only to a start in flight; penetration
    needs a floor.
    """
    setup, values = motions.setup, np.full((len(motions.last_row), len(STANDARD_METRICS)), np.nan)
    with np.errstate(all="ignore"):  # of numbers near the largest, and of an energy scale of 0
        if setup.damping is None:
            in_flight = setup.starts_above_floor if setup.floor else True
            values[:, 0] = np.where(in_flight, energy_drift(motions), np.nan)
            values[:, 1] = energy_gain(motions)
            values[motions.energy_scale == 0.0, :2] = np.nan
        if setup.floor:
            values[:, 2] = penetration(motions)
        values[:, 3] = motions.rebound
        values[:, 4] = motions.dt * motions.last_row_in_motion
    return values


def concatenated(parts: Sequence[Outcomes]) -> Outcomes:
    """Several outcomes, in order."""
    return Outcomes(*(np.concatenate(columns) for columns in zip(*(vars(part).values() for part in parts), strict=True)))


def requested_metrics(scene: Scenario, motion: Trajectory, names: Sequence[str]) -> list[float]:
    """Metrics of one motion; NaN where one does not apply to the scene, or the time step is too coarse for it."""
    truth = truth_for(scene)
    case = Comparison.with_truth(scene, motion, truth)
    return [_value(METRICS[name].measure, case) if METRICS[name].applies(scene, truth) else np.nan for name in names]


def _value(measure: Callable[[Comparison], float | Array], case: Comparison) -> float:
    """The value of largest magnitude, with its sign."""
    try:
        values = np.atleast_1d(measure(case)).ravel()
    except Unresolved:
        return np.nan
    return float(values[np.argmax(np.abs(values))])
