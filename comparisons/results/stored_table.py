"""`results.parquet`: the columns and types of `COLUMNS`, and in them only what a run writes."""

import io
from collections.abc import Collection, Mapping
from typing import get_args

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from dropspin.comparisons.judging.verdicts import VERDICTS, Basis
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.symmetries import kind_of
from dropspin.comparisons.results.earlier import with_basis
from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS
from dropspin.comparisons.results.measurement import COLUMNS, Kind
from dropspin.scenarios import Scenario
from dropspin.scenarios.validation import shown

_ARROW = {"str": (pa.string(), pa.large_string()), "float64": (pa.float64(),), "int64": (pa.int64(),)}


OF_SYMMETRIES = ("symmetry", "determinism")
"""Kinds whose rows have the name of a symmetry, or of a repeated run, for a metric."""


def loaded_table(
    content: bytes, scenes: Mapping[str, Scenario], engines: Collection[str], dts: Collection[float], *, is_earlier: bool = False
) -> pd.DataFrame:
    """The table in a file.

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
    """
    file = pq.ParquetFile(io.BytesIO(content))
    types = dict(zip(file.schema_arrow.names, file.schema_arrow.types, strict=True))
    columns = {name: kind for name, kind in COLUMNS.items() if name != "basis"} if is_earlier else COLUMNS
    if list(types) != list(columns) or not all(types[name] in _ARROW[kind] for name, kind in columns.items()):
        raise ValueError("has other columns or types than a run's table")
    table = file.read(use_threads=False).replace_schema_metadata(None)
    if any(table[name].null_count for name, kind in columns.items() if kind != "float64"):  # null is NaN
        raise ValueError("has gaps")
    rows = table.to_pandas().astype(columns)
    if is_earlier:
        rows = with_basis(rows)[list(COLUMNS)]
    _verify_rows(rows, scenes, engines, dts)
    return rows


def _verify_rows(rows: pd.DataFrame, scenes: Mapping[str, Scenario], engines: Collection[str], dts: Collection[float]) -> None:
    """Raise `ValueError` if a table has rows that no such run writes."""
    allowed: dict[str, Collection[object]] = {
        "scene": scenes,
        "engine": engines,
        "verdict": VERDICTS,
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
        _verify_kind(kind, metric, unit)
    of_studies = rows["kind"].isin(["order", "asymptotic_error"])
    of_ensembles = rows["metric"].isin(list(ENSEMBLE_METRICS))
    with_ensembles = [name for name, scene in scenes.items() if scene.ensemble is not None]
    texts = {text for name, kind in COLUMNS.items() if kind == "str" for text in rows[name].unique()}
    problems = {
        "two rows of one result": rows[rows["metric"] != ""].duplicated(["scene", "engine", "dt", "metric", "kind", "truth"]).any(),
        "results without a time step, or fits with one": (rows["dt"].isna() & (rows["metric"] != "") != of_studies).any(),
        "differences from engines that the run does not have": (~rows.loc[rows["kind"] == "agreement", "truth"].isin(list(engines))).any(),
        "means of scenes without an ensemble": (of_ensembles & ~rows["scene"].isin(with_ensembles)).any(),
        "negative steps or times": (rows["steps"] < 0).any() or (rows["time_per_step"] < 0.0).any(),
        "tolerances that are not above 0": not rows["tolerance"].dropna().between(0.0, np.inf, inclusive="neither").all(),
        "control characters": not all(map(str.isprintable, texts)),
    }
    if found := [problem for problem, is_one in problems.items() if is_one]:
        raise ValueError(f"has {found[0]}")


def _verify_kind(kind: str, metric: str, unit: str) -> None:
    """Raise `ValueError` if no row has this kind of this metric in this unit."""
    if metric == "":
        kinds, own = {""}, ""
    elif (of_symmetry := kind_of(metric)) is not None:
        kinds, own = {of_symmetry}, "1"
    elif metric in ENSEMBLE_METRICS:
        kinds, own = {"ensemble", "agreement"}, ENSEMBLE_METRICS[metric].unit
    else:
        kinds, own = {METRICS[metric].kind, "prediction", "other_law", "agreement", "order", "asymptotic_error"}, METRICS[metric].unit
    if kind not in kinds or unit != ("1" if kind == "order" else own):
        raise ValueError(f"has {metric or 'a remark'} of the kind {kind!r} in the unit {shown(unit)}")
