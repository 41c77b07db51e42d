"""Types of the numbers and the tables of a scene's file."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

LARGEST = 1e50
"""Largest magnitude of a number of a scene: energies and inertias, products of up to five of them, stay finite."""

Number = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
Vector = Annotated[tuple[Number, ...], Field(min_length=3, max_length=3)]
PositiveVector = Annotated[tuple[Positive, ...], Field(min_length=3, max_length=3)]


class Table(BaseModel):
    """A table of a file: immutable, without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)
