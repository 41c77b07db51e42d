"""What comes of some jobs, in arrays, and how a recorded motion becomes a row."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparisons.measuring.comparison import Comparison, Unresolved
from comparisons.measuring.metrics import METRICS
from comparisons.running.recording import Breakdown
from reference_impl.summary import FIGURES, Moved, summarise
from scenarios import Scenario, Trajectory, truth_for

Array = NDArray[np.float64]

STATE = (
    *(f"position_{axis}" for axis in "xyz"),
    *(f"orientation_{axis}" for axis in "xyzw"),
    *(f"velocity_{axis}" for axis in "xyz"),
    *(f"angular_velocity_{axis}" for axis in "xyz"),
)
"""The columns of the state at the end."""


@dataclass(frozen=True)
class Outcomes:
    """What came of n jobs; NaN where nothing did.

    Attributes:
        verdict: As in the results of a run, shape (n,).
        reason: Why, in words, shape (n,).
        state: The last one, shape (n, 13).
        figures: Of `reference_impl.summary`, shape (n, 5).
        metrics: Of the truth, by name, shape (n, len(metrics)).
        steps: How many, shape (n,).
        time_per_step: Recorded, [s], shape (n,).
    """

    verdict: NDArray[Any]
    reason: NDArray[Any]
    state: Array
    figures: Array
    metrics: Array
    steps: NDArray[np.int64]
    time_per_step: Array

    @classmethod
    def blank(cls, size: int, metrics: int) -> "Outcomes":
        """Nothing yet."""
        verdict, reason = (np.full(size, "", dtype=object) for _ in range(2))
        state, figures, of_truth = (np.full((size, width), np.nan) for width in (len(STATE), len(FIGURES), metrics))
        return cls(verdict, reason, state, figures, of_truth, np.zeros(size, dtype=np.int64), np.full(size, np.nan))

    def __getitem__(self, places: slice) -> "Outcomes":
        """Of some of them."""
        return Outcomes(*(column[places] for column in vars(self).values()))

    def set_breakdown(self, place: int, breakdown: Breakdown) -> None:
        """Record why a job has no motion."""
        self.verdict[place], self.reason[place] = breakdown.verdict, " ".join(breakdown.reason.split())

    def take(self, places: NDArray[np.intp], motions: Array, moved: Moved, floor: bool, damped: bool) -> None:
        """What became of the jobs at some places, by their motions, shape (len(places), n, 13)."""
        figures, bad = summarise(motions, moved, floor, damped)
        self.steps[places] = moved.rows - 1
        self.figures[places] = figures
        self.state[places] = motions[np.arange(len(places)), moved.rows - 1]
        self.verdict[places] = "measured"
        for place in np.flatnonzero(bad >= 0):
            self.set_breakdown(places[place], Breakdown("diverged", f"the state is not finite at t = {bad[place] * moved.dt[place]:g} s"))
            self.state[places[place]] = np.nan


def joined(parts: Sequence[Outcomes]) -> Outcomes:
    """Those of several lots of jobs, in order."""
    return Outcomes(*(np.concatenate(columns) for columns in zip(*(vars(part).values() for part in parts), strict=True)))


def moved_alone(scene: Scenario, dt: float, lag: float, rows: int) -> Moved:
    """A scene's body, as the one that moved."""
    body = scene.body
    return Moved(
        mass=np.array([body.mass]),
        inertia=body.inertia_tensor[np.newaxis],
        points=body.vertices[np.newaxis],
        radius=np.array([body.rounding]),
        size=np.array([body.size]),
        origin=origins(scene.initial_state[np.newaxis], np.array([body.resting_height]), scene.floor is not None),
        clearance=np.array([scene.clearance]),
        gravity=scene.acceleration[np.newaxis],
        damping=np.array([0.0 if scene.damping is None else scene.damping.linear]),
        dt=np.array([dt]),
        lag=np.array([lag]),
        rows=np.array([rows]),
    )


def origins(starts: Array, resting_heights: Array, floor: bool) -> Array:
    """Where potential energy is 0 [m], shape (B, 3): at rest on the floor, or at the start."""
    if not floor:
        return np.ascontiguousarray(starts[:, 0:3])
    return np.stack([np.zeros(len(starts)), resting_heights, np.zeros(len(starts))], axis=1)


def truth_metrics(scene: Scenario, motion: Trajectory, names: Sequence[str]) -> list[float]:
    """Metrics of one motion beside the truth; NaN where the scene has not got one, or the step is too coarse for it."""
    truth = truth_for(scene)
    case = Comparison.with_truth(scene, motion, truth)
    return [_value(METRICS[name].measure, case) if METRICS[name].applies(scene, truth) else np.nan for name in names]


def _value(measure: Any, case: Comparison) -> float:
    """The part of largest size, with its sign."""
    try:
        parts = np.atleast_1d(measure(case)).ravel()
    except Unresolved:
        return np.nan
    return float(parts[np.argmax(np.abs(parts))])
