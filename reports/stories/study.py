"""The base class of studies, as `section.json` stores them: the results with all digits, without sentences."""

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from pydantic import BaseModel, ConfigDict

from dropspin.comparisons.judging.verdicts import BREAKDOWNS
from dropspin.reports.document import Document

Records = list[dict[str, Any]]
"""The rows of a table of results."""


class Study(BaseModel):
    """The results of a study. Numbers may be infinite or NaN.

    Attributes:
        study: The name of the command; the files are named after it.
    """

    model_config = ConfigDict(extra="forbid", ser_json_inf_nan="strings")

    study: str

    @abstractmethod
    def rows(self) -> Records:
        """The rows of the CSV and JSON tables; undefined numbers are NaN or None."""

    @abstractmethod
    def document(self) -> Document:
        """The document that becomes the page, a section of a report, or the output on a terminal."""


def exit_code(verdicts: Iterable[str | None], *, named: bool = False) -> int:
    """3 if an engine broke down, or is missing although it was named; otherwise 0."""
    return 3 if (BREAKDOWNS | ({"missing"} if named else set())).intersection(verdicts) else 0


def with_all_columns(rows: Sequence[Mapping[str, Any]], left_out: Mapping[str, str] = MappingProxyType({})) -> Records:
    """Rows of several kinds, each with the columns of all kinds, and a row with the reason for each engine that is left out."""
    every = [*rows, *({"row": "left out", "engine": engine, "reason": why} for engine, why in left_out.items())]
    columns = dict.fromkeys(name for row in every for name in row)
    return [{name: row.get(name) for name in columns} for row in every]
