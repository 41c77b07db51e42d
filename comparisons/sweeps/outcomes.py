"""The outcomes of jobs, as arrays: verdicts, final states and metrics; and those of jobs whose scenes are built, by any engine."""

from collections.abc import Hashable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.metrics import METRICS, energy_drift, energy_gain, penetration
from dropspin.comparisons.measuring.motion_quantities import Motions
from dropspin.comparisons.running.adapter_output import verified_refusal
from dropspin.comparisons.running.arguments import verify_time_step
from dropspin.comparisons.running.driving import Breakdown, Recording, divergence, record_batch, try_record
from dropspin.comparisons.sweeps.jobs import Jobs, scene_of
from dropspin.scenarios import DropspinError, Scenario, Trajectory, truth_for
from dropspin.scenarios.state import STATE_COLUMNS, Array

STANDARD_METRICS = ("energy_drift", "energy_gain", "penetration", "rebound", "rest_time")
"""Measured in every sweep; none needs a reference solution."""

Outcomes = np.recarray[Any, Any]
"""The outcomes of jobs, one record each; NaN where there is no value.

Fields:
    verdict: As in the results of a run; empty for a job that has not been run.
    reason: The reason of the verdict, or the known limitations that the engine met.
    state: The final state, 13 numbers.
    standard_metrics: The `STANDARD_METRICS`.
    metrics: The metrics that the spec asks for.
    steps: Number of steps.
    time_per_step: Wall time per step, recording included [s].
"""


def not_run(size: int, metrics: Sequence[str]) -> Outcomes:
    """The outcomes of jobs that have not been run."""
    widths = {"state": len(STATE_COLUMNS), "standard_metrics": len(STANDARD_METRICS), "metrics": len(metrics)}
    arrays = [(name, float, (width,)) for name, width in widths.items()]
    fields = [("verdict", object), ("reason", object), *arrays, ("steps", np.int64), ("time_per_step", float)]
    empty = np.array(("", "", np.nan, np.nan, np.nan, 0, np.nan), dtype=fields)
    return np.repeat(empty, size).view(np.recarray)


def concatenated(parts: Sequence[Outcomes]) -> Outcomes:
    """Several outcomes, in order."""
    return np.concatenate(parts).view(np.recarray)


def set_breakdown(outcome: np.record, breakdown: Breakdown) -> None:
    """Record why a job has no motion."""
    outcome.verdict, outcome.reason = breakdown.verdict, " ".join(breakdown.reason.split())


def standard_metrics(motions: Motions) -> Array:
    """The `STANDARD_METRICS` of motions, shape (..., 5); NaN where one does not apply.

    Energy drift and gain do not apply with damping, nor where there is no energy at all, and drift only to a start in flight; penetration
    needs a floor that does not end. Drift, gain and rebound do not apply to a floor that ends, and rebound not with walls.
    """
    setup, values = motions.setup, np.full((*motions.last_row.shape, len(STANDARD_METRICS)), np.nan)
    with np.errstate(all="ignore"):  # of numbers near the largest, and of an energy scale of 0
        if setup.damping is None and not setup.ends:
            has_energy = motions.energy_scale != 0.0
            in_flight = setup.starts_above_floor if setup.floor else True
            values[..., 0] = np.where(has_energy & in_flight, energy_drift(motions), np.nan)
            values[..., 1] = np.where(has_energy, energy_gain(motions), np.nan)
        if setup.floor and not setup.ends:
            values[..., 2] = penetration(motions)
        if not (setup.ends or setup.walls):
            values[..., 3] = motions.rebound
        values[..., 4] = motions.dt * motions.last_row_in_motion
    return values


def requested_metrics(scene: Scenario, motion: Trajectory, names: Sequence[str]) -> list[float]:
    """Metrics of one motion; NaN where one does not apply to the scene, or the time step is too coarse for it."""
    truth = truth_for(scene)
    case = Comparison.with_truth(scene, motion, truth)
    return [METRICS[name].value_or_nan([case]) if METRICS[name].applies(scene, truth) else np.nan for name in names]


def run_scenes(jobs: Jobs, outcomes: Outcomes, metrics: tuple[str, ...], *, in_batches: bool) -> None:
    """Run the jobs that have no verdict, together in the engine's batches or each by itself; a failure is recorded in its row."""
    groups: dict[Hashable, dict[int, Scenario]] = {}
    for index in np.flatnonzero(outcomes.verdict == "").tolist():
        dt = float(jobs.dts[index])
        try:
            scene, engine = scene_of(jobs, index), jobs.engine_at(index)
            verify_time_step(scene, dt)
        except DropspinError as error:
            set_breakdown(outcomes[index], Breakdown("declined", str(error)))
        else:
            groups.setdefault((_alike(scene, engine, dt) if in_batches else None) or index, {})[index] = scene
    for scenes in groups.values():
        first = next(iter(scenes))
        engine, dt = jobs.engine_at(first), float(jobs.dts[first])
        for index, recording in zip(scenes, _recorded(engine, list(scenes.values()), dt), strict=True):
            _set_recorded(outcomes[index], recording, scenes[index], dt, metrics)


def _alike(scene: Scenario, engine: Engine, dt: float) -> Hashable:
    """What jobs have in common that an engine may simulate together; None for a job that it declines."""
    try:
        if verified_refusal(engine.refusal(scene)) is not None:
            return None
    except Exception:  # reported when the job runs by itself
        return None
    shared = scene.structure if engine.mixes_scenes else (scene.body, scene.gravity, scene.floor, scene.wall, scene.damping)
    return engine.label, dt, scene.steps(dt), shared


def _recorded(engine: Engine, scenes: Sequence[Scenario], dt: float) -> Sequence[Recording | Breakdown]:
    """The motions of scenes that an engine may simulate together."""
    if len(scenes) > 1:
        with suppress(Exception):  # each then runs by itself, which gives the reason
            return record_batch(engine, scenes, dt, limitations=True)
    return [try_record(engine, scene, dt) for scene in scenes]


def _set_recorded(outcome: np.record, recording: Recording | Breakdown, scene: Scenario, dt: float, metrics: tuple[str, ...]) -> None:
    """Record the outcome of a job that was simulated."""
    outcome.steps = scene.steps(dt)
    if isinstance(recording, Breakdown):
        outcome.steps *= recording.verdict != "declined"
        set_breakdown(outcome, recording)
        return
    motion, outcome.time_per_step = recording.motion, recording.seconds / outcome.steps
    if (diverged := divergence(motion)) is not None:
        set_breakdown(outcome, diverged)
        return
    outcome.verdict, outcome.state, outcome.standard_metrics = "measured", motion.states[-1], standard_metrics(Motions.of(scene, motion))
    outcome.reason = "; ".join(limitation.message for limitation in recording.limitations if not limitation.is_minor)
    outcome.metrics = requested_metrics(scene, motion, metrics) if metrics else []
