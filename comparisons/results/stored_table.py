"""`results.parquet`: the columns and types of `COLUMNS`, and in them only what a run writes."""

import io
from collections.abc import Collection
from typing import get_args

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from comparisons.judging.verdicts import VERDICTS
from comparisons.measuring.metrics import METRICS
from comparisons.results.ensembles import ENSEMBLE_METRICS
from comparisons.results.measurement import COLUMNS, Kind
from scenarios.text import printable

_ARROW = {"str": (pa.string(), pa.large_string()), "float64": (pa.float64(),), "int64": (pa.int64(),)}


def loaded_table(content: bytes) -> pd.DataFrame:
    """The table in a file, by the columns and types of `COLUMNS`.

    Raises:
        ValueError: It has other columns or types, or gaps.
    """
    file = pq.ParquetFile(io.BytesIO(content))
    types = dict(zip(file.schema_arrow.names, file.schema_arrow.types, strict=True))
    if list(types) != list(COLUMNS) or not all(types[name] in _ARROW[kind] for name, kind in COLUMNS.items()):
        raise ValueError("has other columns or types than a run's table")
    table = file.read(use_threads=False).replace_schema_metadata(None)
    if any(table[name].null_count for name, kind in COLUMNS.items() if kind != "float64"):  # null is NaN
        raise ValueError("has gaps")
    return table.to_pandas().astype(COLUMNS)


def verify_rows(rows: pd.DataFrame, scenes: Collection[str], engines: Collection[str], dts: Collection[float]) -> None:
    """Raise `ValueError` if a table has rows that a run with these scenes, engines and time steps [s] does not write."""
    allowed: dict[str, Collection[object]] = {
        "scene": scenes,
        "engine": engines,
        "verdict": VERDICTS,
        "kind": get_args(Kind),
        "metric": {"", *METRICS, *ENSEMBLE_METRICS},
        "dt": {*dts, np.nan},
    }
    for name, known in allowed.items():
        if not (strange := rows.loc[~rows[name].isin(list(known)), name]).empty:
            raise ValueError(f"its table has the {name} {strange.iloc[0]!r}, which the run does not have")
    if lacking := set(scenes) - set(rows["scene"]):
        raise ValueError(f"its table has no rows of the scene {min(lacking)!r}")
    texts = {text for name, kind in COLUMNS.items() if kind == "str" for text in rows[name].unique()}
    if any(printable(text) != text for text in texts):
        raise ValueError("its table has control characters")
    if (rows["steps"] < 0).any() or (rows["time_per_step"] < 0.0).any():
        raise ValueError("its table has negative steps or times")
