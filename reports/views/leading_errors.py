"""Engines and methods side by side: what each is wrong by where it matters, and what its steps cost."""

import math
from dataclasses import dataclass

from comparisons.measuring.metrics import METRICS, leading_metric
from comparisons.results.results import Results
from scenarios import truth_for


@dataclass(frozen=True)
class Leading:
    """The error that a scene is about, at its finest step.

    Attributes:
        scene: Name of the scene.
        metric: What the scene is about.
        unit: Of the errors.
        dt: The step [s].
        sizes: By engine: the size of the error; NaN where there is none.
        least: The engines whose error is the least, or within 1 % of it; where one is as small as rounding, all that are.
    """

    scene: str
    metric: str
    unit: str
    dt: float
    sizes: dict[str, float]
    least: list[str]


def leading_errors(results: Results) -> list[Leading]:
    """Of each scene with a truth the error that it is about, in each engine."""
    found = []
    for name, scene in results.scenes.items():
        if truth_for(scene) is None:
            continue
        metric = leading_metric(scene)
        frame = results.measurements
        mine = frame[(frame["scene"] == name) & (frame["metric"] == metric) & frame["value"].notna()]
        if mine.empty:
            continue
        dt = float(mine["dt"].min())
        finest = mine[mine["dt"] == dt].set_index("engine")
        values = finest["value"].abs()
        sizes = {engine: float(values.get(engine, math.nan)) for engine in results.engines}
        rounded = set(finest.index[finest["cause"] == "rounding"])
        least = [engine for engine, size in sizes.items() if (engine in rounded if rounded else size <= 1.01 * values.min())]
        found.append(Leading(name, metric, METRICS[metric].unit, dt, sizes, least))
    return found


def step_costs(results: Results) -> dict[str, float]:
    """What a step of each engine costs over the cheapest one's in the same scene at the same dt: the median; NaN where none was timed."""
    timed = results.table[results.table["time_per_step"] > 0.0].drop_duplicates(["scene", "engine", "dt"])
    least = timed.groupby(["scene", "dt"])["time_per_step"].transform("min")
    ratios = (timed["time_per_step"] / least).groupby(timed["engine"]).median()
    return {engine: float(ratios.get(engine, math.nan)) for engine in results.engines}
