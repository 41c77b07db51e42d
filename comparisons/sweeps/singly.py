"""One job after another, through any engine, as a run would do each."""

import time

import numpy as np

from comparisons.building import assert_built_as_meant, sound_limits, sound_record
from comparisons.engines.base import Diverged
from comparisons.simulating import assert_step_fits
from comparisons.sweeps.fields import with_fields
from comparisons.sweeps.jobs import Jobs
from comparisons.sweeps.outcomes import Outcomes, moved_alone, truth_metrics
from scenarios import DropspinError, Scenario
from scenarios.ensemble import spread_start


def run_singly(jobs: Jobs, place: int, found: Outcomes, metrics: tuple[str, ...]) -> None:
    """Run the job at a place; whatever goes wrong is told in its row."""
    dt = float(jobs.dts[place])
    try:
        scene = scene_of(jobs, place)
        engine = jobs.engine_at(place)
        assert_step_fits(scene, dt)
        refusal = engine.declines(scene)
    except DropspinError as error:
        refusal = str(error)
    if refusal is not None:
        found.tell(place, "declined", refusal)
        return
    steps = scene.steps(dt)
    found.steps[place] = steps
    try:
        with engine.prepare(scene, dt) as simulation:
            assert_built_as_meant(engine, scene, simulation)
            start = time.perf_counter()
            states = sound_record(simulation.record(steps), steps + 1)
            taken = time.perf_counter() - start
            lag = 0.5 * dt if simulation.staggered else 0.0
            limits = sound_limits(simulation.limits)
    except Diverged as error:
        found.tell(place, "diverged", str(error))
        return
    except Exception as error:  # an engine is somebody else's code: whatever it raises costs its own row and is told there
        found.tell(place, "crashed", f"{type(error).__name__}: {error}")
        return
    found.time_per_step[place] = taken / steps
    moved = moved_alone(scene, dt, lag, steps + 1)
    found.take(np.array([place]), states[np.newaxis], moved, scene.floor is not None, scene.damping is not None)
    if found.verdict[place] == "measured":
        found.reason[place] = "; ".join(limit.said for limit in limits)
        if metrics:
            found.metrics[place] = truth_metrics(scene, states, dt, lag, metrics)


def scene_of(jobs: Jobs, place: int) -> Scenario:
    """The scene of a job, with its fields set and from its start.

    Raises:
        SceneError: There is no such scene.
    """
    scene = with_fields(jobs.scene, [(name, column[place]) for name, column in jobs.fields.items()])
    return scene if jobs.seeds is None else scene.starting_at(spread_start(scene, int(jobs.seeds[place])))
