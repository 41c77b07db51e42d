"""The comparison of speed with an earlier run. Speeds are ratios between engines of one run, because absolute times depend on the machine.

An engine counts as slower only if it became slower relative to every other engine. Otherwise all others would count as slower if one engine
became faster.
"""

from itertools import permutations
from typing import NamedTuple

import numpy as np
import pandas as pd

from dropspin.comparisons.results.results import Results

CONFIDENCE = 0.95


class SpeedChange(NamedTuple):
    """The change of an engine's time per step relative to that of another engine.

    Attributes:
        engine: Label of the engine.
        other: Label of the other engine.
        ratio: The ratio of the two times per step, divided by the earlier ratio; the median over scenes and time steps.
        least: Lower end of the median's confidence interval.
        most: Upper end of this interval.
        cases: Number of scenes and time steps.
    """

    engine: str
    other: str
    ratio: float
    least: float
    most: float
    cases: int


def speed_changes(old: Results, new: Results) -> list[SpeedChange]:
    """For each engine of both runs, the smallest slowdown relative to any other engine, with that engine."""
    before, after = (_times(results) for results in (old, new))
    pairs = [
        _change(engine, other, before, after)
        for engine, other in permutations([engine for engine in new.engines if engine in before and engine in after], 2)
    ]
    found = [change for change in pairs if change.cases > 0]
    engines = dict.fromkeys(change.engine for change in found)
    return [min((change for change in found if change.engine == engine), key=lambda change: change.least) for engine in engines]


def _times(results: Results) -> pd.DataFrame:
    """Seconds per step, one row for each scene and time step, one column for each engine."""
    rows = results.table.dropna(subset=["time_per_step", "dt"])
    return rows.pivot_table("time_per_step", ["scene", "dt"], "engine", aggfunc="first")


def _change(engine: str, other: str, before: pd.DataFrame, after: pd.DataFrame) -> SpeedChange:
    """The median ratio and its exact confidence interval, which is unbounded with fewer than six cases."""
    ratios = (after[engine] / after[other] / (before[engine] / before[other])).dropna().to_numpy()
    if len(ratios) == 0:
        return SpeedChange(engine, other, np.nan, np.nan, np.nan, 0)
    from scipy import stats

    interval = stats.quantile_test(ratios, q=1.0).confidence_interval(CONFIDENCE)
    least, most = (float(np.nan_to_num(end, nan=missing)) for end, missing in zip(interval, (0.0, np.inf), strict=True))
    return SpeedChange(engine, other, float(np.median(ratios)), least, most, len(ratios))
