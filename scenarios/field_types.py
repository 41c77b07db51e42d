"""Types of the numbers and the tables of a scene's file."""

import math
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainSerializer

from dropspin.scenarios.state import Array

LARGEST = 1e50
"""Largest magnitude of a number of a scene: energies and inertias, products of up to five of them, stay finite."""

Number = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
Vector = Annotated[tuple[Number, ...], Field(min_length=3, max_length=3)]
PositiveVector = Annotated[tuple[Positive, ...], Field(min_length=3, max_length=3)]


AS_LISTS = PlainSerializer(lambda array: array.tolist())
"""How a field that is an array is written."""


def rows(content: str, *width: int, kind: type = float) -> BeforeValidator:
    """Rows of finite numbers, or numbers alone, as an array that does not change; `content` says in messages what the list has."""

    def array(raw: Any) -> Any:
        try:
            values: Array = np.array(raw, dtype=kind)
        except (TypeError, ValueError, OverflowError):
            values = np.empty(0)
        if values.ndim != 1 + len(width) or values.shape[1:] != width or not len(values) or not (np.abs(values) <= LARGEST).all():
            raise ValueError(f"must be a list of {content} of up to {LARGEST:g}")
        values.setflags(write=False)
        return values

    return BeforeValidator(array)


class Table(BaseModel):
    """A table of a file: immutable, without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def unit(vector: tuple[float, ...]) -> tuple[float, ...]:
    """The vector or quaternion normalised to length 1; one whose length is 1 up to rounding is returned unchanged."""
    length = math.hypot(*vector)
    if length == 0.0:
        raise ValueError("must not be all zeros")
    if abs(length - 1.0) < 4e-16:  # a saved scene loads with the same digits
        return vector
    return tuple(component / length for component in vector)
