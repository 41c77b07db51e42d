"""One job of a sweep after another, with any engine."""

import numpy as np

from comparisons.running.recording import Breakdown, try_record, verify_time_step
from comparisons.sweeps.fields import with_fields
from comparisons.sweeps.jobs import Jobs
from comparisons.sweeps.outcomes import Outcomes, moved_alone, truth_metrics
from scenarios import DropspinError, Scenario
from scenarios.ensemble import spread_start


def run_singly(jobs: Jobs, place: int, found: Outcomes, metrics: tuple[str, ...]) -> None:
    """Run the job at a place; what goes wrong is recorded in its row."""
    dt = float(jobs.dts[place])
    try:
        scene = scene_of(jobs, place)
        engine = jobs.engine_at(place)
        verify_time_step(scene, dt)
    except DropspinError as error:
        found.set_breakdown(place, Breakdown("declined", str(error)))
        return
    recording = try_record(engine, scene, dt)
    if isinstance(recording, Breakdown):
        found.steps[place] = 0 if recording.verdict == "declined" else scene.steps(dt)
        found.set_breakdown(place, recording)
        return
    steps, motion = scene.steps(dt), recording.motion
    found.time_per_step[place] = recording.seconds / steps
    moved = moved_alone(scene, dt, motion.velocity_lag, steps + 1)
    found.take(np.array([place]), motion.states[np.newaxis], moved, scene.floor is not None, scene.damping is not None)
    if found.verdict[place] == "measured":
        found.reason[place] = "; ".join(one.message for one in recording.limitations)
        if metrics:
            found.metrics[place] = truth_metrics(scene, motion, metrics)


def scene_of(jobs: Jobs, place: int) -> Scenario:
    """The scene of a job, with its fields set and from its start.

    Raises:
        SceneError: There is no such scene.
    """
    scene = with_fields(jobs.scene, [(name, column[place]) for name, column in jobs.fields.items()])
    return scene if jobs.seeds is None else scene.starting_at(spread_start(scene, int(jobs.seeds[place])))
