"""A job by itself, with any engine."""

import numpy as np

from comparisons.measuring.batch import motions_side_by_side
from comparisons.measuring.motions import Setup
from comparisons.running.inputs import verify_time_step
from comparisons.running.recording import Breakdown, divergence, try_record
from comparisons.running.verification import UNIT_TOLERANCE
from comparisons.sweeps.fields import with_fields
from comparisons.sweeps.jobs import Jobs
from comparisons.sweeps.outcomes import Outcomes, requested_metrics
from scenarios import DropspinError, Scenario
from scenarios.ensemble import spread_start


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
    recording, steps = try_record(engine, scene, dt), scene.steps(dt)
    if isinstance(recording, Breakdown):
        outcomes.steps[index] = 0 if recording.verdict == "declined" else steps
        outcomes.set_breakdown(index, recording)
        return
    motion = recording.motion
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
