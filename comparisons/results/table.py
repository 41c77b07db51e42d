"""Tables of results: the columns of runs, sweeps and the record, the row of a run, and reading what somebody else may have written."""

import io
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal, get_args

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from dropspin.comparisons.judging.verdicts import VERDICTS, Basis, Cause, Judgement, Verdict
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.symmetries import kind_of
from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS
from dropspin.comparisons.results.older_formats import with_basis
from dropspin.scenarios import Scenario
from dropspin.scenarios.validation import shown

Kind = Literal[
    "",
    "truth",
    "invariant",
    "agreement",
    "prediction",
    "other_law",
    "setting",
    "uncertainty",
    "ensemble",
    "order",
    "asymptotic_error",
    "symmetry",
    "determinism",
    "baseline",
]
"""What a value is compared with; empty for a row without a value, which says what became of an engine in a scene."""
OF_SYMMETRIES = ("symmetry", "determinism")
"""Kinds whose rows have the name of a symmetry, or of a repeated run, for a metric."""


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """A row of the results: a measured value with its verdict, or the outcome of an engine that has no motion.

    Attributes:
        scene: Name of the scene.
        engine: Label of the engine.
        dt: Time step [s]; NaN for results of several time steps.
        seed: Number of the initial state, for sweeps; 0 in a run.
        metric: Name of the metric or the symmetry; empty in a row that has only the outcome of an engine.
        value: The value, in `unit`.
        unit: SI unit; '1' for a ratio.
        kind: What the value is compared with.
        truth: Name of the exact solution, or `measured` for a recording. If `kind` is `agreement`, the label of the other engine; if it is
            `other_law`, the impact law; if it is `setting`, the settings whose share is the value.
        lower: Smallest allowed value, or the lower end of the 95 % interval of an order or an asymptotic error; NaN if there is neither.
        upper: Largest allowed value, or the upper end of the 95 % interval; NaN if there is neither.
        tolerance: The change of the value between two runs up to which it counts as unchanged, in `unit`; NaN if it is not compared.
        verdict: The verdict.
        cause: The cause to which the error is attributed, such as `discretisation` or `model`.
        reason: The reason for the verdict and the cause, in words.
        basis: The information on which the verdict is based, besides value and bounds.
        time_per_step: Wall time of a time step of the engine [s].
        steps: Number of time steps taken.
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

    def remark(self, verdict: Verdict, reason: str, basis: Basis = "") -> Measurement:
        """A row without a value."""
        return Measurement(**vars(self), verdict=verdict, reason=reason, basis=basis)

    def measurement(self, kind: Kind, metric: str, unit: str, judgement: Judgement, truth: str = "") -> Measurement:
        """A row with a judged value."""
        return Measurement(**vars(self), kind=kind, metric=metric, unit=unit, truth=truth, **vars(judgement))


_DTYPES: dict[Any, str] = {float: "float64", int: "int64"}
COLUMNS = {field.name: _DTYPES.get(field.type, "str") for field in fields(Measurement)}
"""The columns of a run's table and their types, in order."""
_TYPES = COLUMNS | {"job": "int64"}
_ARROW = {"str": pa.string(), "float64": pa.float64(), "int64": pa.int64()}
NULLABLE = frozenset({"seed"})
"""Columns of texts and whole numbers that may have gaps; a gap in a column of numbers is NaN."""


def schema_of(names: Iterable[str], numbers: Iterable[str] = ()) -> pa.Schema:
    """The columns of a table: a name has the type that it has in the table of a run; others are texts, or numbers."""
    return pa.schema([*((name, _ARROW[_TYPES.get(name, "str")]) for name in names), *((name, pa.float64()) for name in numbers)])


def as_table(measurements: Sequence[Measurement]) -> pd.DataFrame:
    """Measurements as a table, one row each, with the columns and types of `COLUMNS`."""
    return pd.DataFrame(map(vars, measurements), columns=list(COLUMNS)).astype(COLUMNS)


def are_among(rows: pd.DataFrame, others: pd.DataFrame, columns: Sequence[str]) -> "pd.Series[bool]":
    """Whether each row of a table has the values that a row of another table has in some columns."""
    keys, known = (pd.MultiIndex.from_frame(table[list(columns)]) for table in (rows, others))
    return pd.Series(keys.isin(known), rows.index)


def empty_table() -> pd.DataFrame:
    """A table without rows."""
    return as_table([])


def stored_table(content: bytes, schema: pa.Schema, *, with_others: bool = False, only: Iterable[str] | None = None) -> pa.Table:
    """A table in a Parquet file that somebody else may have written.

    Args:
        content: The content of the file.
        schema: Its columns.
        with_others: Whether it may have them in any order, and other columns of texts and numbers.
        only: Names of the columns to read; all by default.

    Raises:
        ValueError: It has other columns or types, gaps, control characters, or a verdict that dropspin does not have.
        Exception: Whatever pyarrow raises for a file that is no Parquet file.
    """
    # Without threads of pyarrow: engine processes may be forked in the meantime.
    file = pq.ParquetFile(io.BytesIO(content), page_checksum_verification=True)
    given = file.schema_arrow
    found = [(name, pa.string() if kind == pa.large_string() else kind) for name, kind in zip(given.names, given.types, strict=True)]
    expected = [(field.name, field.type) for field in schema]
    if not {*expected} <= {*found} or {kind for _, kind in found} - {*_ARROW.values()} if with_others else found != expected:
        raise ValueError("has other columns or types than such a table")
    table = file.read(None if only is None else [*only], use_threads=False).replace_schema_metadata(None)
    columns = dict(zip(table.column_names, table.columns, strict=True))
    if any(column.null_count and not pa.types.is_floating(column.type) and name not in NULLABLE for name, column in columns.items()):
        raise ValueError("has gaps")
    texts = {name: {*column.unique().to_pylist()} for name, column in columns.items() if not pa.types.is_primitive(column.type)}
    if not texts.get("verdict", set()) <= {*VERDICTS}:
        raise ValueError("has a verdict that dropspin does not have")
    if not all(map(str.isprintable, set().union(*texts.values()))):
        raise ValueError("has text with control characters")
    return table


def results_table(
    content: bytes, scenes: Mapping[str, Scenario], engines: Collection[str], dts: Collection[float], *, is_earlier: bool = False
) -> pd.DataFrame:
    """The table of a run in the file `results.parquet`.

    Args:
        content: The content of the file.
        scenes: The scenes of the run.
        engines: Labels of its engines.
        dts: Its time steps [s].
        is_earlier: Whether the folder has the format that `earlier` reads.

    Returns:
        The table, with the columns and types of `COLUMNS`.

    Raises:
        ValueError: It has other columns, types or rows than a run of these scenes with these engines and time steps.
        Exception: As `stored_table`.
    """
    names = [name for name in COLUMNS if not (is_earlier and name == "basis")]
    rows = stored_table(content, schema_of(names)).to_pandas().astype({name: COLUMNS[name] for name in names})
    if is_earlier:
        rows = with_basis(rows)[list(COLUMNS)]
    _verify_rows(rows, scenes, engines, dts)
    return rows


def _verify_rows(rows: pd.DataFrame, scenes: Mapping[str, Scenario], engines: Collection[str], dts: Collection[float]) -> None:
    """Raise `ValueError` if a table has rows that no such run writes."""
    allowed: dict[str, Collection[object]] = {
        "scene": scenes,
        "engine": engines,
        "basis": get_args(Basis),
        "kind": [kind for kind in get_args(Kind) if kind != "baseline"],  # which checks add
        "metric": {"", *METRICS, *ENSEMBLE_METRICS, *filter(kind_of, rows["metric"])},
        "dt": {*dts, np.nan},
    }
    for name, known in allowed.items():
        if not (strange := rows.loc[~rows[name].isin(list(known)), name]).empty:
            raise ValueError(f"has the {name} {shown(strange.tolist()[0])}, which the run does not have")
    if lacking := set(scenes) - set(rows.loc[rows["dt"].notna(), "scene"]):
        raise ValueError(f"has no rows of the scene {shown(min(lacking))}")
    for kind, metric, unit in rows[["kind", "metric", "unit"]].drop_duplicates().itertuples(index=False):
        if _units(metric).get(kind) != unit:
            raise ValueError(f"has {metric or 'a remark'} of the kind {kind!r} in the unit {shown(unit)}")
    of_studies = rows["kind"].isin(["order", "asymptotic_error"])
    of_ensembles = rows["metric"].isin(list(ENSEMBLE_METRICS))
    with_ensembles = [name for name, scene in scenes.items() if scene.ensemble is not None]
    problems = {
        "two rows of one result": rows[rows["metric"] != ""].duplicated(["scene", "engine", "dt", "metric", "kind", "truth"]).any(),
        "results without a time step, or fits with one": (rows["dt"].isna() & (rows["metric"] != "") != of_studies).any(),
        "differences from engines that the run does not have": (~rows.loc[rows["kind"] == "agreement", "truth"].isin(list(engines))).any(),
        "means of scenes without an ensemble": (of_ensembles & ~rows["scene"].isin(with_ensembles)).any(),
        "negative steps or times": (rows["steps"] < 0).any() or (rows["time_per_step"] < 0.0).any(),
        "tolerances that are not above 0": not rows["tolerance"].dropna().between(0.0, np.inf, inclusive="neither").all(),
    }
    if found := [problem for problem, is_one in problems.items() if is_one]:
        raise ValueError(f"has {found[0]}")


def _units(metric: str) -> Mapping[str, str]:
    """The unit of a metric by the kinds of rows that have it."""
    if metric == "":
        return {"": ""}
    if metric in ENSEMBLE_METRICS:
        return dict.fromkeys(("ensemble", "agreement"), ENSEMBLE_METRICS[metric].unit)
    if metric in METRICS:
        kinds = METRICS[metric].kind, "prediction", "other_law", "uncertainty", "agreement", "asymptotic_error"
        return dict.fromkeys(kinds, METRICS[metric].unit) | {"order": "1", "setting": "1"}
    return {str(kind_of(metric)): "1"}
