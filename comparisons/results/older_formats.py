"""Run folders of format 5: the engine `wang` was `document`, and the basis of a verdict was the beginning of its reason."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from dropspin.scenarios.model import current_label

FORMAT = 5
KINDS = ("trajectories", "ensembles")
_BASES = {
    "the known fault does not occur": "fault_absent",
    "not decided by the few starts of a quick run": "few_starts",
    "no evidence: both are": "same_method",
}


_BY_LABEL = ("names", "adapters", "settings", "settings_digests", "named", "compilation")
"""What the provenance has by the label of the engine."""


def with_current_labels(content: Mapping[str, Any]) -> dict[str, Any]:
    """The content of its `run.json` with the present names of engines."""
    stamp = content["provenance"]
    asked = stamp["asked"] | {"engines": _renamed(stamp["asked"]["engines"])}
    files = {kind: {path: one | {"engine": current_label(one["engine"])} for path, one in content[kind].items()} for kind in KINDS}
    stamp = stamp | {name: _renamed(stamp[name]) for name in _BY_LABEL if name in stamp} | {"asked": asked}
    return {**content, **files, "engines": _renamed(content["engines"]), "provenance": stamp}


def _renamed(found: Any) -> Any:
    """A label, a list of labels, or values by label, with the present names."""
    if isinstance(found, list):
        return [_renamed(one) for one in found]
    if isinstance(found, dict):
        return {current_label(label): current_label(one) if isinstance(one, str) else one for label, one in found.items()}
    return current_label(found)


def with_basis(rows: pd.DataFrame) -> pd.DataFrame:
    """The table of such a folder with the present names of engines and the column `basis`."""
    beginnings = [next((basis for text, basis in _BASES.items() if reason.startswith(text)), "") for reason in rows["reason"]]
    labels = {name: rows[name].map(current_label).astype("str") for name in ("engine", "truth")}
    return rows.assign(**labels, basis=pd.Series(beginnings, rows.index, dtype="str"))
