"""The outcomes of jobs, as arrays: verdicts, final states and metrics; and those of jobs whose scenes are built, by any engine."""

from collections.abc import Hashable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.measuring.batch import motions_side_by_side
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.metrics import METRICS, energy_drift, energy_gain, penetration
from dropspin.comparisons.measuring.motions import Motions, Setup
from dropspin.comparisons.running.inputs import verify_time_step
from dropspin.comparisons.running.recording import Breakdown, Recording, divergence, record_batch, try_record
from dropspin.comparisons.running.verification import UNIT_TOLERANCE, verified_refusal
from dropspin.comparisons.sweeps.jobs import Jobs, scene_of
from dropspin.scenarios import DropspinError, Scenario, Trajectory, truth_for

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

    def __setitem__(self, index: int, outcome: "Outcomes") -> None:
        """Replace the outcome of a job by that of one job."""
        for column, value in zip(vars(self).values(), vars(outcome).values(), strict=True):
            column[index] = value[0]

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
    return [METRICS[name].value_or_nan([case]) if METRICS[name].applies(scene, truth) else np.nan for name in names]


class _Built(NamedTuple):
    """A job whose scene and engine are built."""

    row: int
    scene: Scenario
    engine: Engine
    dt: float


def run_scenes(jobs: Jobs, outcomes: Outcomes, metrics: tuple[str, ...], *, in_batches: bool) -> None:
    """Run the jobs that have no verdict, together in the engine's batches or each by itself; a failure is recorded in its row."""
    groups: dict[Hashable, list[_Built]] = {}
    for index in np.flatnonzero(outcomes.verdict == "").tolist():
        dt = float(jobs.dts[index])
        try:
            job = _Built(index, scene_of(jobs, index), jobs.engine_at(index), dt)
            verify_time_step(job.scene, dt)
        except DropspinError as error:
            outcomes.set_breakdown(index, Breakdown("declined", str(error)))
        else:
            groups.setdefault((_alike(job) if in_batches else None) or index, []).append(job)
    for group in groups.values():
        for job, recording in zip(group, _recorded(group), strict=True):
            _set_recorded(outcomes, job, recording, metrics)


def _alike(job: _Built) -> Hashable:
    """What jobs have in common that an engine may simulate together; None for a job that it declines."""
    scene, engine = job.scene, job.engine
    try:
        if verified_refusal(engine.refusal(scene)) is not None:
            return None
    except Exception:  # reported when the job runs by itself
        return None
    return (
        engine.label,
        job.dt,
        scene.steps(job.dt),
        scene.structure if engine.mixes_scenes else (scene.body, scene.gravity, scene.floor, scene.damping),
    )


def _recorded(group: list[_Built]) -> Sequence[Recording | Breakdown]:
    """The motions of jobs that an engine may simulate together."""
    engine, dt = group[0].engine, group[0].dt
    if len(group) > 1:
        with suppress(Exception):  # each then runs by itself, which gives the reason
            return record_batch(engine, [job.scene for job in group], dt, limitations=True)
    return [try_record(engine, job.scene, dt) for job in group]


def _set_recorded(outcomes: Outcomes, job: _Built, recording: Recording | Breakdown, metrics: tuple[str, ...]) -> None:
    """Record the outcome of a job that was simulated."""
    index, steps = job.row, job.scene.steps(job.dt)
    if isinstance(recording, Breakdown):
        outcomes.steps[index] = 0 if recording.verdict == "declined" else steps
        outcomes.set_breakdown(index, recording)
        return
    motion = recording.motion
    outcomes.steps[index], outcomes.time_per_step[index] = steps, recording.seconds / steps
    if (diverged := divergence(motion)) is not None:
        outcomes.set_breakdown(index, diverged)
        return
    setup, states, lag = Setup.of_starts([job.scene]), motion.states[np.newaxis], np.array([motion.velocity_lag])
    motions, _ = motions_side_by_side(setup, states, np.array([job.dt]), lag, np.array([steps]), UNIT_TOLERANCE)
    outcomes.set_measured(np.array([index]), states, motions)
    outcomes.reason[index] = "; ".join(limitation.message for limitation in recording.limitations if not limitation.is_minor)
    if metrics:
        outcomes.metrics[index] = requested_metrics(job.scene, motion, metrics)
