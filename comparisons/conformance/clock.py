"""Checks of time: steps have the length asked for, all parts of a row belong to its time, and `staggered` is right."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from comparisons.conformance.outcomes import CheckFailed, CheckResult, Declined
from comparisons.conformance.probes import DT
from comparisons.conformance.short_runs import A_FEW_STEPS, accepted_scene, recorded
from comparisons.engines.base import Engine
from comparisons.running.recording import record
from scenarios import Scenario, truth_for
from scenarios.rotations import angle_between_orientations
from scenarios.state import ORIENTATION, POSITION, VELOCITY

Array = NDArray[np.float64]

STEPS_TRIED = (0.01, 0.0025, 0.00025)
NEAR_ENOUGH = 0.02
"""The share of a step by which a row may be off its time; an engine with some damping is still on time."""
LATE = 0.3
"""The share of a step by which attitude or velocity may be off the time of their row."""


def check_time(engine: Engine, check: str) -> CheckResult:
    """Intervals between rows have the length asked for, and all parts of a row one time; free motions measure both."""
    ticks = {dt: _ticks(engine, "coasting", dt, _by_position) for dt in STEPS_TRIED}
    asked = ", ".join(f"{dt:g}" for dt in STEPS_TRIED)
    lengths = np.array([float(np.diff(times).mean()) * dt for dt, times in ticks.items()])
    for dt, times in ticks.items():
        between = np.diff(times)
        if np.ptp(between) > NEAR_ENOUGH * max(abs(between.mean()), 1.0):
            raise CheckFailed(
                f"rows are not uniform in time: at dt = {dt:g} s intervals are {between.min() * dt:.4g} to {between.max() * dt:.4g} s long"
            )
    if not np.allclose(lengths, STEPS_TRIED, rtol=NEAR_ENOUGH):
        if np.ptp(lengths) <= NEAR_ENOUGH * abs(lengths[0]):
            raise CheckFailed(f"a step is {lengths[0]:.5g} s long for every dt ({asked} s)")
        found = ", ".join(f"{length:.5g}" for length in lengths)
        raise CheckFailed(f"steps of {asked} s are {found} s long, by the motion of a free ball")
    for what, probe, clock in (("the attitude", "turning", _by_attitude), ("velocity", "falling straight", _by_velocity)):
        try:
            times = _ticks(engine, probe, STEPS_TRIED[0], clock)
        except Declined:
            continue
        late = float(np.median(np.arange(len(times)) - times))
        if abs(late) > LATE:
            raise CheckFailed(f"{what} is {late:.2g} steps late: it does not belong to the time of its row")
    return CheckResult(check, "passed", f"steps have the length asked for, {asked} s")


def _ticks(engine: Engine, probe: str, dt: float, clock: Callable[[Scenario, Array], Array]) -> Array:
    """The time of each row by a clock, in steps since the start, shape (1 + A_FEW_STEPS,)."""
    scene = accepted_scene(engine, probe)
    ticks = clock(scene, recorded(engine, scene, dt)) / dt
    if not np.isfinite(ticks).all():
        raise CheckFailed(f"the state is not finite after {A_FEW_STEPS} steps of {dt:g} s")
    return ticks


def _by_position(scene: Scenario, rows: Array) -> Array:
    speed = np.array(scene.start.velocity)
    return (rows[:, POSITION] - scene.start.position) @ speed / (speed @ speed)


def _by_attitude(scene: Scenario, rows: Array) -> Array:
    turned = angle_between_orientations(np.broadcast_to(scene.start.orientation, (len(rows), 4)), rows[:, ORIENTATION])
    return turned / np.linalg.norm(scene.start.angular_velocity)


def _by_velocity(scene: Scenario, rows: Array) -> Array:
    g = scene.acceleration
    return (rows[:, VELOCITY] - scene.start.velocity) @ g / (g @ g)


def check_staggered(engine: Engine, check: str) -> CheckResult:
    """`staggered` says whether velocity lags position by half a step; how far a fall runs ahead shows it."""
    scene = accepted_scene(engine, "falling", "falling straight")
    steps, g = scene.steps(DT), scene.acceleration
    motion = record(engine, scene, DT, verify=False).motion
    end, staggered = motion.states[-1], motion.velocity_lag != 0.0
    if not np.isfinite(end).all():
        raise CheckFailed("the state is not finite after a fall")
    truth = truth_for(scene)
    assert truth is not None
    ahead = (end[POSITION] - truth(steps * DT).position[0]) @ g / (0.5 * g @ g * steps * DT * DT)
    lag = round(float(ahead))
    if abs(ahead) > 1.5 or abs(ahead - lag) > 0.25:
        return CheckResult(check, "noted", f"a fall runs ahead by {ahead:.3g} half steps; known schemes give -1, 0 or 1")
    if lag == 1 and not staggered:
        raise CheckFailed(
            "a fall runs ahead by half a step, as under semi-implicit Euler, where velocity lags position; set staggered = True"
        )
    if lag == 0 and staggered:
        raise CheckFailed("staggered is True, but velocity and position belong to the same time; set staggered = False")
    if lag == -1:
        return CheckResult(check, "noted", "a fall lags by half a step, as under explicit Euler")
    return CheckResult(
        check, "passed", "velocity lags position by half a step" if staggered else "velocity and position have the same time"
    )
