"""Tables of studies as CSV and JSON, and data as JSON."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic_core import to_jsonable_python


def write_table(folder: Path, stem: str, rows: Sequence[Mapping[Any, Any]]) -> None:
    """Write rows as CSV, and as JSON, in which numbers stay numbers."""
    import pandas as pd

    pd.DataFrame(_plain(rows), dtype=object).to_csv(folder / f"{stem}.csv", index=False, lineterminator="\r\n")
    (folder / f"{stem}.json").write_text(json_text(rows), encoding="utf-8")


def json_text(data: object) -> str:
    """Data as JSON with all digits; numbers that are not finite are null."""
    return json.dumps(_plain(data), indent=1, ensure_ascii=False, allow_nan=False)


def _plain(data: object) -> Any:
    return to_jsonable_python(data, inf_nan_mode="null", fallback=lambda number: number.item())  # numbers of NumPy
