"""A study as `section.json` keeps it: what was found, with all digits, and no sentence."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from pydantic import BaseModel, ConfigDict

from dropspin.reports.document import Document


class Study(BaseModel):
    """What a study found. Numbers may be infinite or NaN.

    Attributes:
        study: The command, after which the files are named.
    """

    model_config = ConfigDict(extra="forbid", ser_json_inf_nan="strings")

    study: str

    @abstractmethod
    def rows(self) -> list[dict[str, Any]]:
        """The tables as CSV and JSON; numbers that are not defined are NaN or None."""

    @abstractmethod
    def document(self) -> Document:
        """The page, which is also a section of a report and the output on a terminal."""


def with_all_columns(rows: Sequence[Mapping[str, Any]], left_out: Mapping[str, str] = MappingProxyType({})) -> list[dict[str, Any]]:
    """Rows of several kinds, each with the columns of all; and one for each engine that is left out, with the reason."""
    every = [*rows, *({"row": "left out", "engine": engine, "reason": why} for engine, why in left_out.items())]
    columns = dict.fromkeys(name for row in every for name in row)
    return [{name: row.get(name) for name in columns} for row in every]
