"""Run folders of format 5: the engine `wang` was `document`, and the basis of a verdict was the beginning of its reason."""

from typing import Any

import pandas as pd

from dropspin.scenarios.model import current_label

FORMAT = 5
_BASES = {
    "the known fault does not occur": "fault_absent",
    "not decided by the few starts of a quick run": "few_starts",
    "no evidence: both are": "same_method",
}


def with_current_labels(content: Any) -> Any:
    """The content of its `run.json` with the present names of engines."""
    if isinstance(content, dict):
        return {current_label(key): with_current_labels(value) for key, value in content.items()}
    if isinstance(content, list):
        return [with_current_labels(value) for value in content]
    return current_label(content) if isinstance(content, str) else content


def with_basis(rows: pd.DataFrame) -> pd.DataFrame:
    """The table of such a folder with the present names of engines and the column `basis`."""
    beginnings = [next((basis for text, basis in _BASES.items() if reason.startswith(text)), "") for reason in rows["reason"]]
    labels = {name: rows[name].map(current_label).astype("str") for name in ("engine", "truth")}
    return rows.assign(**labels, basis=pd.Series(beginnings, rows.index, dtype="str"))
