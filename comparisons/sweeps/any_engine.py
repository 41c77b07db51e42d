"""Jobs of any engine, whose scenes are built: together in the engine's batches, or each by itself."""

from collections.abc import Hashable, Iterator

import numpy as np

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.measuring.batch import motions_side_by_side
from dropspin.comparisons.measuring.motions import Setup
from dropspin.comparisons.running.inputs import verify_time_step
from dropspin.comparisons.running.recording import Breakdown, Recording, divergence, record_batch, try_record
from dropspin.comparisons.running.verification import UNIT_TOLERANCE, verified_refusal
from dropspin.comparisons.sweeps.fields import with_fields
from dropspin.comparisons.sweeps.jobs import Jobs
from dropspin.comparisons.sweeps.outcomes import Outcomes, requested_metrics
from dropspin.scenarios import DropspinError, Scenario
from dropspin.scenarios.ensemble import spread_start


def run_in_batches(jobs: Jobs, outcomes: Outcomes, metrics: tuple[str, ...]) -> None:
    """Run the jobs that the engine can simulate in batches; the verdicts of all others stay empty."""
    for engine, dt, members in _batches(jobs):
        try:
            recordings = record_batch(engine, list(members.values()), dt, limitations=True)
        except Exception:
            continue
        for (index, scene), recording in zip(members.items(), recordings, strict=True):
            _set_recorded(outcomes, index, scene, dt, recording, metrics)


def _batches(jobs: Jobs) -> Iterator[tuple[Engine, float, dict[int, Scenario]]]:
    """The jobs that an engine may simulate together: with their indices, those of one time step that it does not decline."""
    groups: dict[Hashable, tuple[Engine, float, dict[int, Scenario]]] = {}
    for index in range(len(jobs)):
        dt = float(jobs.dts[index])
        try:
            scene, engine = scene_of(jobs, index), jobs.engine_at(index)
            verify_time_step(scene, dt)
            if verified_refusal(engine.refusal(scene)) is not None:
                continue
        except Exception:
            continue
        alike = scene.structure if engine.mixes_scenes else (scene.body, scene.gravity, scene.floor, scene.damping)
        _, _, members = groups.setdefault((engine.label, dt, scene.steps(dt), alike), (engine, dt, {}))
        members[index] = scene
    return (group for group in groups.values() if len(group[2]) > 1)


def run_single(jobs: Jobs, index: int, outcomes: Outcomes, metrics: tuple[str, ...]) -> None:
    """Run the job at an index; a failure is recorded in its row."""
    dt = float(jobs.dts[index])
    try:
        scene = scene_of(jobs, index)
        engine = jobs.engine_at(index)
        verify_time_step(scene, dt)
    except DropspinError as error:
        outcomes.set_breakdown(index, Breakdown("declined", str(error)))
        return
    recording = try_record(engine, scene, dt)
    if isinstance(recording, Breakdown):
        outcomes.steps[index] = 0 if recording.verdict == "declined" else scene.steps(dt)
        outcomes.set_breakdown(index, recording)
        return
    _set_recorded(outcomes, index, scene, dt, recording, metrics)


def _set_recorded(outcomes: Outcomes, index: int, scene: Scenario, dt: float, recording: Recording, metrics: tuple[str, ...]) -> None:
    """Record the outcome of a job that was simulated."""
    motion, steps = recording.motion, scene.steps(dt)
    outcomes.steps[index], outcomes.time_per_step[index] = steps, recording.seconds / steps
    diverged = divergence(motion)
    if diverged is not None:
        outcomes.set_breakdown(index, diverged)
        return
    states = motion.states[np.newaxis]
    motions, _ = motions_side_by_side(
        Setup.of(scene).as_batch(), states, np.array([dt]), np.array([motion.velocity_lag]), np.array([steps]), UNIT_TOLERANCE
    )
    outcomes.set_measured(np.array([index]), states, motions)
    outcomes.reason[index] = "; ".join(limitation.message for limitation in recording.limitations if not limitation.is_minor)
    if metrics:
        outcomes.metrics[index] = requested_metrics(scene, motion, metrics)


def scene_of(jobs: Jobs, index: int) -> Scenario:
    """The scene of a job, with its fields set and from its start.

    Raises:
        SceneError: The fields do not make a valid scene.
    """
    scene = with_fields(jobs.scene, [(name, column[index]) for name, column in jobs.fields.items()])
    return scene if jobs.seeds is None else scene.starting_at(spread_start(scene, int(jobs.seeds[index])))
