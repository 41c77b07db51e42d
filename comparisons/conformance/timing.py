"""Checks of time: of the length of steps, the time of each part of a row, `velocity_lag`, steps that are not awaited, and compilation."""

import math
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise

import numpy as np
from numpy.polynomial.polynomial import polyfit, polyval

from dropspin.comparisons.conformance.outcomes import CheckFailed, Declined, Noted
from dropspin.comparisons.conformance.probes import A_FEW_STEPS, DT, accepted_scene, few_steps, recorded, state_after
from dropspin.comparisons.conformance.protocol import relative_difference
from dropspin.comparisons.engines.base import Engine, Simulation
from dropspin.comparisons.running.timing import time_steps
from dropspin.scenarios import Scenario
from dropspin.scenarios.rotations import angle_between_orientations
from dropspin.scenarios.state import ORIENTATION, POSITION, VELOCITY, Array
from dropspin.scenarios.text import rounded
from dropspin.scenarios.truths import exact_solution

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
NO_SCHEME = "no known scheme has this lag: gravity, the time step or the precision of the state is wrong, or the fall is damped"
NO_LAG = "no constant lag explains the displacements of a fall by its velocity: a step may not be as long as dt, or the fall may be damped"
DRIFT = 0.1
"""In steps, during the fall: the lag of a scheme is constant, and steps 1 % too short give 0.16."""
HARDLY_FALLS = 0.1
"""Share of the scene's gravity below which the acceleration of a fall gives no lag."""
EXPLICIT_EULER = (
    "the position is updated before the velocity, as in explicit Euler, which adds energy in each step; update the velocity first"
)
LAG_TOLERANCE = 0.02
"""In steps: eight sub-steps have a lag of 1/16."""
LONG_ENOUGH = 0.02
"""Wall time of the steps [s]; a shorter one could be hidden by the time that it takes to read a state."""
MOST_STEPS = 1 << 16
REPEATS = 2
LARGEST_SHARE = 0.5
"""Largest share of the time that may be spent waiting for the state."""
PIECE = 32
"""Steps of a short call."""
FAR = 1e-3
"""The difference, relative to the largest number, of states that are not of the same time; an adaptive integrator may differ by less."""
MUCH = 10.0
"""Compilation that should be stated [s], because it counts against limits of processor time otherwise."""


def check_time(engine: Engine) -> str:
    """Intervals between rows have the length asked for, and all parts of a row one time; free motions measure both."""
    ticks = _coasting(engine)
    late = _late(ticks)
    for dt, times in ticks.items():
        between = np.diff(times)
        if np.ptp(between[1:]) <= NEAR_ENOUGH and abs(late) > LATE and abs(between[1:].mean() - 1.0) <= NEAR_ENOUGH:
            raise CheckFailed(f"position is {_off(late)}")
        if np.ptp(between) > NEAR_ENOUGH * max(abs(between.mean()), 1.0):
            shortest, longest = dt * between.min(), dt * between.max()
            found = f"rows are not uniform in time: at dt = {dt:g} s intervals are {shortest:.4g} to {longest:.4g} s long"
            if (np.diff(between) < 0.0).all():
                found = f"a free ball slows down, as with damping, or {found} (if its velocity is constant)"
            raise CheckFailed(found)
    lengths = np.array([float(np.diff(times).mean()) * dt for dt, times in ticks.items()])
    asked = ", ".join(f"{dt:g}" for dt in STEPS_TRIED)
    if not np.allclose(lengths, STEPS_TRIED, rtol=NEAR_ENOUGH):
        if np.ptp(lengths) <= NEAR_ENOUGH * abs(lengths[0]):
            raise CheckFailed(f"a step is {lengths[0]:.5g} s long for every dt ({asked} s)")
        measured = ", ".join(f"{length:.5g}" for length in lengths)
        raise CheckFailed(f"steps of {asked} s are {measured} s long, according to the motion of a free ball")
    with suppress(Declined):
        late = _late({dt: _ticks(engine, "turning", dt, _by_attitude) for dt in STEPS_TRIED})
        if abs(late) > LATE:
            raise CheckFailed(f"the attitude is {_off(late)}")
    with suppress(Declined):
        late = _late({dt: _ticks(engine, "falling straight", dt, _by_velocity) for dt in STEPS_TRIED})
        if abs(late) > LATE:
            _, stated_lag, ahead, _ = _fall(engine)
            if abs(ahead + late) < LATE:
                count = "more steps than were taken, such as twice in the first one" if late < 0.0 else "fewer steps than were taken"
                side = "ahead" if late < 0.0 else "behind"
                raise CheckFailed(f"velocity and position of a fall run {side} by {_steps(late)}: gravity acts in {count}")
            if abs(late - stated_lag) > LATE:
                raise CheckFailed(f"velocity is {_off(late)}")
    return f"steps have the length asked for, {asked} s"


def _coasting(engine: Engine) -> dict[float, Array]:
    """The time of each row by the positions of a free body, by time step."""
    return {dt: _ticks(engine, "coasting", dt, _by_position) for dt in STEPS_TRIED}


def _late(ticks: dict[float, Array]) -> float:
    """By how many steps rows are later than they should be.

    0 if by other numbers for other steps, as states with a constant error are, or for ever later rows, as those of another acceleration.
    """
    each = [np.arange(len(times)) - times for times in ticks.values()]
    late = [float(np.median(of_rows)) for of_rows in each]
    is_constant = max(np.ptp(of_rows[len(of_rows) // 2 :]) for of_rows in each) <= LATE
    return late[0] if is_constant and np.ptp(late) <= LATE else 0.0


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


def check_velocity_lag(engine: Engine) -> str:
    """`velocity_lag` is the time by which velocity lags position, from the displacement and the velocity of a falling body."""
    measured, stated, ahead, noise = _fall(engine)
    if noise > LAG_TOLERANCE:
        raise Noted(f"the time by which velocity lags position is not constant in a fall: it varies by {noise:.2g} steps")
    if abs(measured) > LARGEST_LAG:
        if not math.isfinite(measured):
            raise CheckFailed(NO_LAG)
        raise Noted(f"velocity lags position by {measured:.3g} steps; known schemes have at most half a step")
    explicit = f"{EXPLICIT_EULER}; " if abs(measured + 0.5) <= LAG_TOLERANCE else ""
    if explicit:
        with suppress(Declined):  # without gravity no scheme is late
            if abs(late := _late(_coasting(engine))) > LATE:
                raise CheckFailed(f"position is {_off(late)}")
    if abs(measured - stated) > LAG_TOLERANCE:
        raise CheckFailed(
            f"{explicit}velocity_lag is {stated:.3g} steps, but velocity lags position by {measured:.3g} steps, from the "
            f"displacement of a falling body; {_suggested_lag(measured)}"
        )
    if min(abs(ahead), abs(ahead - measured)) > LAG_TOLERANCE:  # a leapfrog scheme is not ahead, others by their lag
        raise CheckFailed(f"a fall is {abs(ahead):.3g} steps {'ahead of' if ahead > 0.0 else 'behind'} the exact one; {NO_SCHEME}")
    if explicit:
        raise Noted(EXPLICIT_EULER)
    return f"velocity lags position by {stated:.3g} steps"


def _fall(engine: Engine) -> tuple[float, float, float, float]:
    """Measurements of a fall, in steps: of few steps, so that rounding adds up to little.

    By how much velocity lags position, infinite if that drifts, that by `velocity_lag`, by how much the fall runs ahead of the exact one,
    and the largest deviation of that from a constant number.
    """
    scene, dt = accepted_scene(engine, "falling", "falling straight"), STEPS_TRIED[0]
    motion = few_steps(engine, scene, dt)
    if not np.isfinite(motion.states).all():
        raise CheckFailed("the state is not finite after a fall")
    t = motion.t[STARTED:]
    g = (motion.velocity[-1] - motion.velocity[STARTED]) / (t[-1] - t[0])  # the engine's own, which other checks compare
    if np.linalg.norm(g) < HARDLY_FALLS * np.linalg.norm(scene.acceleration):
        raise CheckFailed("the velocity of a falling body hardly changes, so that its lag cannot be measured")
    moved = (motion.position[STARTED + 2 :] - motion.position[STARTED:-2]) / (2.0 * dt)
    lags = (moved - motion.velocity[STARTED + 1 : -1]) @ g / (g @ g * dt)
    lag = float(np.mean(lags)) if abs(lags[-1] - lags[0]) <= DRIFT else math.inf
    ahead = (motion.position[STARTED:] - exact_solution(scene)(t).position) @ g / (g @ g * dt)
    fitted = polyfit(t, ahead, 2)  # what remains of the first steps is constant; damping and wrong gravity grow with t²
    return lag, motion.velocity_lag / dt, float(fitted[1]), float(np.abs(ahead - polyval(t, fitted)).max() / t[-1])


def _suggested_lag(steps: float) -> str:
    """The assignment that is right, for 0 and the inverse of an even number of sub-steps, of a step; no scheme has another lag."""
    substeps = round(0.5 / abs(steps)) if abs(steps) > LAG_TOLERANCE else 0
    if substeps > MOST_SUBSTEPS:
        return NO_SCHEME
    if not substeps:
        return "set velocity_lag = 0.0"
    is_of_substeps = abs(0.5 / substeps - abs(steps)) < LAG_TOLERANCE
    return f"set self.velocity_lag = {math.copysign(0.5, steps):g} * dt" + (f" / {substeps}" if is_of_substeps and substeps > 1 else "")


def check_waiting(engine: Engine) -> str:
    """Most of the time of a run passes in `advance`, not in the first `state` after it, and a long call takes all of its steps."""
    scene = accepted_scene(engine, "turning", "coasting", "falling straight")
    with engine.prepare(scene, DT) as simulation:
        _timed(simulation, 1)  # the first step may compile
        steps, stepping, waiting = 64, 0.0, 0.0
        while stepping + waiting < LONG_ENOUGH and steps < MOST_STEPS:
            steps *= 4
            stepping, waiting = _timed(simulation, steps)
        # Other processes may delay a call now and then.
        stepping, waiting = min([(stepping, waiting), *(_timed(simulation, steps) for _ in range(REPEATS))], key=lambda times: times[1])
    if waiting > LARGEST_SHARE * (stepping + waiting) and waiting > LARGEST_SHARE * LONG_ENOUGH:
        returned, took = (f"{rounded(1e3 * seconds, 2)} ms" for seconds in (stepping, waiting))
        raise CheckFailed(
            f"advance({steps}) returned after {returned}, and state() then took {took}: the steps were not done; wait for them in advance "
            "(JAX: block_until_ready; Warp: synchronize)"
        )
    short_calls = [PIECE] * (steps // PIECE)
    difference = relative_difference(state_after(engine, scene, [steps]), state_after(engine, scene, short_calls))
    if not difference <= FAR:  # a state that is read too early, or after fewer steps, is another
        raise CheckFailed(
            f"the state after advance({steps}) is not that after {len(short_calls)} calls of advance({PIECE}), by {difference:.2g} of the "
            "largest number: the long call takes fewer steps, or state() does not wait for them"
        )
    return f"advance({steps}) returns when its steps are done"


def _timed(simulation: Simulation, steps: int) -> tuple[float, float]:
    """The wall times of `advance`, and of the first `state` after it beyond that of the second one [s]."""
    times = [time.perf_counter()]
    for call in (lambda: simulation.advance(steps), simulation.state, simulation.state):
        call()
        times.append(time.perf_counter())
    stepping, first, second = (later - earlier for earlier, later in pairwise(times))
    return stepping, max(first - second, 0.0)


def check_compilation(engine: Engine) -> str:
    """An engine that compiles for long says so, and compiles a scene once."""
    scene = accepted_scene(engine, "turning", "coasting", "falling straight")
    first, second, other = (time_steps(engine, scene, DT, steps) for steps in (A_FEW_STEPS, A_FEW_STEPS, A_FEW_STEPS + 1))
    later, compiling, again = second.whole, first.whole - second.whole, other.whole - second.whole
    if not engine.compiles:
        if compiling < MUCH:
            return "the engine takes no noticeable time to compile"
        raise Noted(f"the first simulation takes {compiling:.2g} s longer than the second; set compiles = True")
    cost = f"a scene compiles in {max(compiling, 0.0):.2g} s; a simulation of {A_FEW_STEPS} steps then takes {rounded(1e3 * later, 2)} ms"
    if again > 0.25 * compiling and again > MUCH / 10.0:  # the first simulation may compile for two numbers of steps, 1 and others
        raise Noted(f"{cost}; with another number of steps it compiles again, for {again:.2g} s")
    return cost
