"""Speed beside an earlier run: as ratios between engines of one run, for absolute times are the machine's.

An engine has become slower if it has against every other engine; so that of two engines one that has become faster does not make the other
one slower in the face of a third.
"""

from itertools import permutations
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from comparisons.results import Results

CONFIDENCE = 0.95


class SpeedChange(NamedTuple):
    """How the time of an engine's step has changed against that of another engine.

    Attributes:
        engine: Its label.
        beside: The other engine's.
        ratio: Its time over the other's, over what that was before: the median over scenes and steps.
        least: Lower end of the median's confidence interval.
        most: Upper end.
        cases: How many scenes and steps.
    """

    engine: str
    beside: str
    ratio: float
    least: float
    most: float
    cases: int


def speed_changes(old: Results, new: Results) -> list[SpeedChange]:
    """For each engine, of those beside which it can be measured in both runs, the one against which it has lost least."""
    before, after = (_times(results) for results in (old, new))
    pairs = [
        _change(engine, beside, before, after)
        for engine, beside in permutations([engine for engine in new.engines if engine in before and engine in after], 2)
    ]
    found = [change for change in pairs if change.cases > 0]
    engines = dict.fromkeys(change.engine for change in found)
    return [min((change for change in found if change.engine == engine), key=lambda change: change.least) for engine in engines]


def _times(results: Results) -> pd.DataFrame:
    """Seconds a step, one row for each scene and step, one column for each engine."""
    rows = results.frame.dropna(subset=["time_per_step", "dt"])
    return rows.pivot_table("time_per_step", ["scene", "dt"], "engine", aggfunc="first")


def _change(engine: str, beside: str, before: pd.DataFrame, after: pd.DataFrame) -> SpeedChange:
    """Exact interval of the median, from the order of the ratios; with fewer than six of them it has no ends."""
    ratios = (after[engine] / after[beside] / (before[engine] / before[beside])).dropna().to_numpy()
    if len(ratios) == 0:
        return SpeedChange(engine, beside, np.nan, np.nan, np.nan, 0)
    interval = stats.quantile_test(ratios, q=1.0).confidence_interval(CONFIDENCE)
    least, most = (float(np.nan_to_num(end, nan=missing)) for end, missing in zip(interval, (0.0, np.inf), strict=True))
    return SpeedChange(engine, beside, float(np.median(ratios)), least, most, len(ratios))
