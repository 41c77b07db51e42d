"""Run folders of format 5, in which the basis of a verdict was the beginning of its reason."""

import pandas as pd

FORMAT = 5
_BASES = {
    "the known fault does not occur": "fault_absent",
    "not decided by the few starts of a quick run": "few_starts",
    "no evidence: both are": "same_method",
}


def with_basis(rows: pd.DataFrame) -> pd.DataFrame:
    """The table of such a folder with the column `basis`."""
    beginnings = [next((basis for text, basis in _BASES.items() if reason.startswith(text)), "") for reason in rows["reason"]]
    return rows.assign(basis=pd.Series(beginnings, rows.index, dtype="str"))
