"""Calibration: the settings that give a coefficient of restitution, ready to paste, and results measured with them.

The program to paste is executed here, and its motion is measured.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.running.adapter_output import verified_settings
from dropspin.comparisons.running.arguments import EngineEntry, verify_time_step
from dropspin.comparisons.running.driving import Breakdown, verify_accepted
from dropspin.comparisons.running.engine_entries import present_entry
from dropspin.comparisons.running.process_limits import FIVE_MINUTES, ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.start_phases import START_PHASES
from dropspin.scenarios import DropspinError, Scenario, load
from dropspin.scenarios.state import Array

Motion = Callable[[float, int, float], tuple[list[float], list[float]]]
"""A function of the height of a fall [m], the number of steps and the time step [s], that returns heights of the lowest point [m] and
vertical speeds [m/s].
"""
Shape = Literal["ball", "box"]

HALF_HEIGHT = 0.1  # m
BODIES: Mapping[Shape, Mapping[str, Any]] = {
    "ball": {"shape": "sphere", "radius": HALF_HEIGHT, "mass": 1.0},
    "box": {"shape": "box", "half_extents": [0.15, HALF_HEIGHT, 0.25], "mass": 1.0},
}
GRAVITY = 9.81
DROP = 1.0  # m
IMPACT = math.sqrt(2.0 * GRAVITY * DROP)  # m/s
LOW_DROP = 0.01  # m
SETTLING, WATCHED = 5.0, 1.0  # s; the body is measured at rest in the last second of settling
LARGEST_STEP = 0.1  # s; the search for the largest stable step ends here
LONG = 3.0  # s
DROPS = 8
SUNK, SUNK_FOR = 0.1, 1.0  # m, s
GAIN = 1.02
"""Height, relative to the drop height, above which a body counts as having gained energy."""
FINELY = 1.01
"""The ratio to which the largest stable time step is bisected."""


@dataclass(frozen=True)
class Measured:
    """A measured value: its name, value and unit, and how it was measured."""

    name: str
    value: float
    unit: str
    how: str


@dataclass(frozen=True)
class Calibration:
    """The settings that give an engine a coefficient of restitution, and the results measured with them.

    Attributes:
        engine: The engine's label.
        settings: The settings that the engine is built with, by name.
        reasons: The reason for the value of each setting, by name.
        programs: Programs and models with these settings, as text by language; the text in `python` is a complete program.
        measured: The results that the program in `python` gives.
    """

    engine: str
    settings: Mapping[str, Any]
    reasons: Mapping[str, str]
    programs: Mapping[str, str]
    measured: tuple[Measured, ...]


def calibrate(
    engine: Engine | str,
    restitution: float,
    dt: float,
    friction: str | float = "none",
    shape: Shape = "ball",
    *,
    resources: ResourceLimits = FIVE_MINUTES,
) -> Calibration:
    """Compute the settings that give a coefficient of restitution at a time step, and measure their effect.

    Args:
        engine: The engine or its name; its options choose among its contact models.
        restitution: Coefficient of restitution, from 0 to 1.
        dt: Time step [s].
        friction: `none`, `infinite` or a Coulomb coefficient.
        shape: The body that falls flat onto a floor: `ball` or `box`.
        resources: The processor time [s] and memory [bytes] that the measurement may use.

    Returns:
        The settings, the reason for each, programs to paste, and the results measured with them.

    Raises:
        DropspinError: The engine has no such settings, broke down with them, or is unstable at this time step.
    """
    entry, scene = present_entry(engine), drop(restitution, friction, shape)
    verify_time_step(scene, dt)
    with EngineProcesses(resources) as processes:
        result = processes.call(entry, _calibrated, scene, dt)
    if isinstance(result, Breakdown):
        failure = "cannot be calibrated" if result.verdict == "declined" else "broke down with these settings"
        raise DropspinError(f"{entry.label} {failure}: {result.reason}.")
    if result is None:
        raise DropspinError(f"{entry.label} has no settings to calibrate; use mujoco or pybullet.")
    stable = result.measured[-1]
    if math.isnan(stable.value):
        raise DropspinError(f"{entry.label} has no usable settings for this time step: {stable.how}; give a smaller one.")
    return result


def drop(restitution: float, friction: str | float = "none", shape: Shape = "ball") -> Scenario:
    """The scene of a calibration: a body that falls flat onto a floor from 1 m."""
    return load(
        {
            "name": f"a {shape} on a floor",
            "duration": LONG,
            "body": dict(BODIES[shape]),
            "start": {"position": [0.0, DROP + HALF_HEIGHT, 0.0]},
            "gravity": {"acceleration": [0.0, -GRAVITY, 0.0]},
            "floor": {"restitution": restitution, "friction": friction},
        }
    )


def _calibrated(entry: EngineEntry, scene: Scenario, dt: float) -> Calibration | None:
    """The settings of the engine, the programs and their measurements; None if it has none; runs in its process."""
    engine = entry.adapter
    verify_accepted(engine, scene)
    programs = engine.programs(scene, dt)
    if not programs:
        return None
    with engine.prepare(scene, dt) as simulation:
        settings = verified_settings(simulation.settings)
    names: dict[str, Any] = {"__name__": "pasted"}
    exec(compile(programs["python"], "pasted", "exec"), names)
    measured = tuple(measurements(cast(Motion, names["motion"]), dt))
    return Calibration(entry.label, settings, engine.reasons, programs, measured)


def measurements(motion: Motion, dt: float) -> list[Measured]:
    """The measurements of drops with settings made for a time step [s]."""
    speeds, heights, deepest = _bounces(motion, dt)
    settling, watched = math.ceil(SETTLING / dt), math.ceil(WATCHED / dt)
    low, slow = (np.array(values[settling - watched :]) for values in motion(LOW_DROP, settling, dt))
    rests = float(np.ptp(low)) < 0.1 * LOW_DROP
    if not rests:
        low, slow = np.full_like(low, np.nan), np.full_like(slow, np.nan)
    times = dt * np.arange(len(low))
    line = np.polyfit(times, low, 1) if rests else np.full(2, np.nan)  # a single position may be anywhere in the jitter
    half, _, _ = _bounces(motion, dt / 2.0)
    at_impact = f"over {START_PHASES} drops from {DROP:g} m, whose impacts are spread evenly within a time step"
    at_rest = f"dropped from {1e3 * LOW_DROP:g} mm, in the fifth second" if rests else "the body does not come to rest within 5 s"
    step, how = _largest_step(motion, dt)
    return [
        Measured("restitution", float(speeds.mean()), "1", f"speed just after the impact over the speed just before, mean {at_impact}"),
        Measured("restitution, least", float(speeds.min()), "1", "of these drops"),
        Measured("restitution, most", float(speeds.max()), "1", "of these drops"),
        Measured("restitution by height", float(heights.mean()), "1", "√(rebound height / drop height), mean over these drops"),
        Measured("penetration", deepest, "m", f"largest of these drops; at impact the body falls {IMPACT * dt:.3g} m in one step"),
        Measured("depth at rest", float(-low.mean()), "m", at_rest),
        Measured("sinking at rest", -float(line[0]), "m/s", f"mean speed downwards, {at_rest}"),
        Measured(
            "jitter at rest",
            float(np.ptp(low - np.polyval(line, times))),
            "m",
            f"highest minus lowest position beside this motion, {at_rest}",
        ),
        Measured("speed at rest", float(np.abs(slow).max()), "m/s", f"greatest, {at_rest}"),
        Measured("restitution at half the step", float(half.mean()), "1", "with the same settings, which may be valid for one step only"),
        Measured("largest stable step", step, "s", how),
    ]


def _bounces(motion: Motion, dt: float) -> tuple[Array, Array, float]:
    """Ratios of speeds, roots of ratios of heights, and the largest depth [m], of drops that strike at different times in a step."""
    ratios, roots, deepest = [], [], 0.0
    for part in (np.arange(START_PHASES) + 0.5) / START_PHASES:
        drop = DROP + IMPACT * dt * part
        # The fall, the time of the highest rebound to its apex, and some steps for impacts that take several.
        heights, speeds = map(np.array, motion(drop, math.ceil(2.0 * IMPACT / GRAVITY / dt) + START_PHASES, dt))
        down = int(np.argmin(speeds))
        up = down + int(np.argmax(speeds[down:]))
        ratios.append(max(0.0, speeds[up]) / -speeds[down])
        roots.append(math.sqrt(max(0.0, heights[up:].max()) / drop))
        deepest = max(deepest, -float(heights.min()))
    return np.array(ratios), np.array(roots), deepest


def _largest_step(motion: Motion, dt: float) -> tuple[float, str]:
    """The largest time step at which a body neither gains energy nor sinks, and how it was found."""
    if not _is_stable(motion, dt):
        return math.nan, f"at {dt:g} s the body gains 2 % of its height, or stays {SUNK:g} m below the floor"
    stable = dt
    while (longer := min(2.0**0.125 * stable, LARGEST_STEP)) > stable and _is_stable(motion, longer):
        stable = longer
    if stable >= LARGEST_STEP:
        return LARGEST_STEP, "the largest step tested: the body gains no energy and does not sink"
    unstable = longer
    while unstable > FINELY * stable:
        middle = math.sqrt(stable * unstable)
        stable, unstable = (middle, unstable) if _is_stable(motion, middle) else (stable, middle)
    return stable, f"with the same settings; beyond it a drop from {DROP:g} m gains 2 % of its height or stays {SUNK:g} m below the floor"


def _is_stable(motion: Motion, dt: float) -> bool:
    steps = math.ceil(LONG / dt)
    drops = [np.array(motion(DROP + IMPACT * dt * part, steps, dt)[0]) for part in (np.arange(DROPS) + 0.5) / DROPS]
    last = math.ceil(SUNK_FOR / dt)  # at a single time it may be deep in an impact
    return all(bool(np.isfinite(height).all() and height.max() <= GAIN * height[0] and height[-last:].max() > -SUNK) for height in drops)
