"""One row of a run's table: what was measured of one engine in one scene, and the verdict on it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal

import pandas as pd

from dropspin.comparisons.judging.verdicts import Basis, Cause, Judgement, Verdict

Kind = Literal[
    "",
    "truth",
    "invariant",
    "agreement",
    "prediction",
    "other_law",
    "ensemble",
    "order",
    "asymptotic_error",
    "symmetry",
    "determinism",
    "baseline",
]
"""What a value is compared with; empty for a row without a value, which says what became of an engine in a scene."""


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """A measurement, or the outcome of an engine that has none.

    Attributes:
        scene: Name of the scene.
        engine: Label of the engine.
        dt: Time step [s]; NaN for results of several time steps.
        seed: Number of the start, for sweeps; 0 in a run.
        metric: Name of the metric, or of the symmetry; empty in a row about an engine, without a value.
        value: The value, in `unit`.
        unit: SI unit; '1' for a ratio.
        kind: What the value is compared with.
        truth: Name of the exact solution; for an agreement the other engine's label; for `other_law` the impact law.
        lower: Least value allowed, or the lower end of the 95 % interval of an order or an asymptotic error; NaN where there is none.
        upper: Largest value allowed, or the upper end of that interval; NaN where there is none.
        tolerance: How far the value may move between two runs before it counts as changed, in `unit`; NaN where it is not compared.
        verdict: The verdict.
        cause: What the error is attributed to.
        reason: Why, in words.
        basis: What the verdict is based on, beside value and bounds.
        time_per_step: Wall time of a native step [s].
        steps: How many steps were taken.
    """

    scene: str
    engine: str
    dt: float = math.nan
    seed: int = 0
    metric: str = ""
    value: float = math.nan
    unit: str = ""
    kind: Kind = ""
    truth: str = ""
    lower: float = math.nan
    upper: float = math.nan
    tolerance: float = math.nan
    verdict: Verdict
    cause: Cause = ""
    reason: str = ""
    basis: Basis = ""
    time_per_step: float = math.nan
    steps: int = 0


@dataclass(frozen=True)
class Case:
    """What the measurements of one engine in one scene at one time step share."""

    scene: str
    engine: str
    dt: float = math.nan
    steps: int = 0
    time_per_step: float = math.nan

    def remark(self, verdict: Verdict, reason: str) -> Measurement:
        """A row without a value."""
        return Measurement(**vars(self), verdict=verdict, reason=reason)

    def measurement(self, kind: Kind, metric: str, unit: str, judgement: Judgement, truth: str = "") -> Measurement:
        """A row with a judged value."""
        return Measurement(**vars(self), kind=kind, metric=metric, unit=unit, truth=truth, **vars(judgement))


_DTYPES: dict[Any, str] = {float: "float64", int: "int64"}
COLUMNS = {field.name: _DTYPES.get(field.type, "str") for field in fields(Measurement)}
"""The columns of a run's table and their types, in order."""


def as_table(measurements: Sequence[Measurement]) -> pd.DataFrame:
    """Measurements as a table, one row each, with the columns and types of `COLUMNS`."""
    return pd.DataFrame([vars(one) for one in measurements], columns=list(COLUMNS)).astype(COLUMNS)


def empty_table() -> pd.DataFrame:
    """A table without rows."""
    return as_table([])
