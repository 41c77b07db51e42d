"""A table of engines: the error of each engine in each scene, and the time of its steps."""

import math
from dataclasses import dataclass

import numpy as np

from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.tolerances import scale
from dropspin.comparisons.results.results import Results


@dataclass(frozen=True)
class Leading:
    """The errors of a scene in one metric at its finest time step.

    Attributes:
        scene: Name of the scene.
        metric: The metric, as chosen by `Results.leading_errors`.
        unit: Unit of the errors.
        dt: Time step [s].
        scale: The scale of the errors, in their unit.
        sizes: The size of the error, by engine; NaN where it is undefined.
        levels: The decade of the error relative to its scale, by engine, from 0 (up to 1e-8) over 1 (up to 1e-7) to 8 (above 0.1); None if
            undefined.
        least: The engines whose error is within 1 % of the smallest error, or is within rounding.
    """

    scene: str
    metric: str
    unit: str
    dt: float
    scale: float
    sizes: dict[str, float]
    levels: dict[str, int | None]
    least: list[str]


def leading_errors(results: Results) -> dict[str, Leading]:
    """The leading error of each scene with an exact solution, by scene."""
    found = {}
    for name, one in results.by_scene.items():
        finest = one.leading_errors(name)
        if finest.empty:
            continue
        metric, dt = str(finest["metric"].iloc[0]), float(finest["dt"].iloc[0])
        values = finest["value"].abs()
        sizes = {engine: float(values.get(engine, math.nan)) for engine in results.engines}
        rounded = set(finest.index[finest["cause"] == "rounding"])
        least = [engine for engine, size in sizes.items() if (engine in rounded if rounded else size <= 1.01 * values.min())]
        unit = METRICS[metric].unit
        of = scale(results.scenes[name], unit)
        levels = {engine: level(size / of) for engine, size in sizes.items()}
        found[name] = Leading(name, metric, unit, dt, of, sizes, levels, least)
    return found


def step_times(results: Results) -> dict[str, float]:
    """The time per step [s], by engine: the geometric mean over the scenes and time steps in which all engines were timed.

    Ratios of these times are therefore the geometric means of the ratios. NaN for an engine that was not timed, and for all if there are no
    scenes and time steps in which all engines were timed.
    """
    timed = results.table[results.table["time_per_step"] > 0.0].drop_duplicates(["scene", "engine", "dt"])
    times = timed.pivot(index=["scene", "dt"], columns="engine", values="time_per_step")
    means = np.exp(np.log(times.dropna()).mean())
    return {engine: float(means.get(engine, math.nan)) for engine in results.engines}


def level(error: float) -> int | None:
    """The decade of a relative error, from 0 (up to 1e-8) over 1 (up to 1e-7) to 8 (above 0.1)."""
    if math.isnan(error):
        return None
    if error > 0.1:  # it may be infinite
        return 8
    return 0 if error <= 1e-8 else min(8, 8 + math.ceil(math.log10(error) - 1e-9))
