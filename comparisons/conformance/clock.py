"""Checks of time: steps have the length asked for, all parts of a row belong to its time, and `velocity_lag` is right."""

import math
from collections.abc import Callable

import numpy as np
from numpy.polynomial.polynomial import polyfit
from numpy.typing import NDArray

from dropspin.comparisons.conformance.outcomes import CheckFailed, CheckResult, Declined
from dropspin.comparisons.conformance.short_runs import A_FEW_STEPS, accepted_scene, few_steps, recorded
from dropspin.comparisons.engines.base import Engine
from dropspin.scenarios import Scenario, Trajectory, truth_for
from dropspin.scenarios.rotations import angle_between_orientations
from dropspin.scenarios.state import ORIENTATION, POSITION, VELOCITY

Array = NDArray[np.float64]

STEPS_TRIED = (0.01, 0.0025, 0.00025)
NEAR_ENOUGH = 0.02
"""The share of a step by which a row may be off its time; an engine with some damping is still on time."""
LATE = 0.3
"""The share of a step by which attitude or velocity may be off the time of their row."""
LARGEST_LAG = 0.75
"""In steps; the schemes of first order have ±1/2."""
STARTED = 6
"""The first step that counts: multistep methods begin with others."""
MOST_SUBSTEPS = 8
NO_SCHEME = "no known scheme has this lag: gravity, the time step or the precision of the state is wrong"
LAG_TOLERANCE = 0.02
"""In steps: eight sub-steps have a lag of 1/16."""


def check_time(engine: Engine, check: str) -> CheckResult:
    """Intervals between rows have the length asked for, and all parts of a row one time; free motions measure both."""
    ticks = {dt: _ticks(engine, "coasting", dt, _by_position) for dt in STEPS_TRIED}
    asked = ", ".join(f"{dt:g}" for dt in STEPS_TRIED)
    lengths = np.array([float(np.diff(times).mean()) * dt for dt, times in ticks.items()])
    for dt, times in ticks.items():
        between = np.diff(times)
        late = float(np.median(np.arange(len(times)) - times))
        if np.ptp(between[1:]) <= NEAR_ENOUGH and abs(late) > LATE and abs(between[1:].mean() - 1.0) <= NEAR_ENOUGH:
            raise CheckFailed(f"position is {_off(late)}")
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
        if abs(late) > LATE and clock is _by_velocity and abs(_runs_ahead(*_fall(engine))[0] + late) < LATE:
            count = "more steps than were taken, such as twice in the first one" if late < 0.0 else "fewer steps than were taken"
            side = "ahead" if late < 0.0 else "behind"
            raise CheckFailed(f"velocity and position of a fall run {side} by {_steps(late)}: gravity acts in {count}")
        if abs(late) > LATE and (clock is not _by_velocity or abs(late - _velocity_lag(*_fall(engine))[1]) > LATE):
            raise CheckFailed(f"{what} is {_off(late)}")
    return CheckResult(check, "passed", f"steps have the length asked for, {asked} s")


def _steps(count: float) -> str:
    return "1 step" if f"{abs(count):.2g}" == "1" else f"{abs(count):.2g} steps"


def _off(late: float) -> str:
    return f"{_steps(late)} {'late' if late > 0.0 else 'early'}: it does not belong to the time of its row"


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


def check_velocity_lag(engine: Engine, check: str) -> CheckResult:
    """`velocity_lag` is the time by which velocity lags position: how much faster a falling body moves than its velocity says, over g."""
    fall = _fall(engine)
    measured, stated = _velocity_lag(*fall)
    ahead, noise = _runs_ahead(*fall)
    if noise > LAG_TOLERANCE:
        return CheckResult(check, "noted", f"a fall does not lag by the same time throughout, but by {noise:.2g} steps more or less")
    if abs(measured) > LARGEST_LAG:
        return CheckResult(check, "noted", f"velocity lags position by {measured:.3g} steps; known schemes have at most half a step")
    if abs(measured - stated) > LAG_TOLERANCE:
        raise CheckFailed(
            f"velocity_lag is {stated:.3g} steps, but velocity lags position by {measured:.3g} steps, by how much faster a falling body "
            f"moves than its velocity says; {_suggested_lag(measured)}"
        )
    if min(abs(ahead), abs(ahead - measured)) > LAG_TOLERANCE:  # one that lags is ahead by its lag, or not, as a leapfrog
        raise CheckFailed(f"a fall runs ahead of the exact one by {ahead:.3g} steps; {NO_SCHEME}")
    return CheckResult(check, "passed", f"velocity lags position by {stated:.3g} steps")


def _fall(engine: Engine) -> tuple[Scenario, Trajectory]:
    """A fall of few steps, so that rounding adds up to little."""
    scene = accepted_scene(engine, "falling", "falling straight")
    motion = few_steps(engine, scene, STEPS_TRIED[0])
    if not np.isfinite(motion.states).all():
        raise CheckFailed("the state is not finite after a fall")
    return scene, motion


def _velocity_lag(scene: Scenario, motion: Trajectory) -> tuple[float, float]:
    """The lag of velocity behind position in a fall, measured and stated, in steps."""
    g, dt = scene.acceleration, STEPS_TRIED[0]
    moved = (motion.position[STARTED + 2 :] - motion.position[STARTED:-2]) / (2.0 * dt)
    return float(np.mean((moved - motion.velocity[STARTED + 1 : -1]) @ g) / (g @ g * dt)), motion.velocity_lag / dt


def _runs_ahead(scene: Scenario, motion: Trajectory) -> tuple[float, float]:
    """By how many steps a fall runs ahead of the exact one, and the largest deviation from a constant number."""
    t, g, truth = motion.t[STARTED:], scene.acceleration, truth_for(scene)
    assert truth is not None
    ahead = (motion.position[STARTED:] - truth(t).position) @ g / (g @ g * STEPS_TRIED[0])
    fitted = polyfit(t, ahead, 2)  # what remains of the first steps is constant; damping and wrong gravity grow with t²
    noise = float(np.abs(ahead - np.polynomial.polynomial.polyval(t, fitted)).max() / t[-1])
    return float(fitted[1]), noise


def _suggested_lag(steps: float) -> str:
    """The assignment that is right, for 0 and the inverse of an even number of sub-steps, of a step; no scheme has another lag."""
    substeps = round(0.5 / abs(steps)) if abs(steps) > LAG_TOLERANCE else 0
    if substeps > MOST_SUBSTEPS:
        return NO_SCHEME
    if not substeps:
        return "set velocity_lag = 0.0"
    is_of_substeps = abs(0.5 / substeps - abs(steps)) < LAG_TOLERANCE
    return f"set self.velocity_lag = {math.copysign(0.5, steps):g} * dt" + (f" / {substeps}" if is_of_substeps and substeps > 1 else "")
