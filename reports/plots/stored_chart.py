"""The data of a chart that a study stored, verified: the script of the report draws it, and a stranger may have written it."""

import base64
import binascii
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from dropspin.scenarios.text import Text

MOST_POINTS = 100_000
FLOAT = 4  # bytes

Number = Annotated[float, Field(allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1, le=MOST_POINTS)]
Colour = Annotated[str, Field(pattern=r"^(#[0-9A-Fa-f]{6})?$")]


def _packed(text: str) -> str:
    """Verify float32 numbers in base 64."""
    try:
        size = len(base64.b64decode(text, validate=True))
    except binascii.Error:
        size = -1
    if size % FLOAT or size > FLOAT * MOST_POINTS:
        raise ValueError("must be float32 numbers in base 64")
    return text


Packed = Annotated[str, AfterValidator(_packed)]


class StoredData(BaseModel):
    """Data of which every key is known and has the type that dropspin writes."""

    model_config = ConfigDict(strict=True, extra="forbid")


class _Even(StoredData):
    """Evenly spaced positions."""

    first: Number
    step: Number
    count: Count


class _Line(StoredData):
    """A line; the keys are those of `chart_data`."""

    label: Text = ""
    x: Annotated[int, Field(ge=0)]
    y: Packed | None = None
    common: Annotated[int, Field(ge=0)] = 0
    colour: Colour = ""
    width: Annotated[float, Field(ge=0.0, le=100.0)] = 0.0
    dashes: Literal["", "dashed", "dotted"] = ""
    marker: Literal["", "o", "s", "D", "^", "v", "P", "X", "x", "*"] = ""
    low: Packed | None = None
    high: Packed | None = None
    step: bool = False


class StoredChart(StoredData):
    """A chart; the keys are those of `chart_data`."""

    x_label: Text = Field("", alias="xLabel")
    y_label: Text = Field("", alias="yLabel")
    x_log: bool = Field(False, alias="xLog")
    y_log: bool = Field(False, alias="yLog")
    flat: bool = False
    map: bool = False
    reference: Text = ""
    rounding: Number = 0.0
    remark: Text = ""
    ticks: list[tuple[Number, Text]] = []
    rows: list[Text] = []
    texts: list[tuple[Number, Number, Text]] = []
    x_range: tuple[Number, Number] | None = Field(None, alias="xRange")
    x: list[_Even | Annotated[list[Number | None], Field(max_length=MOST_POINTS)]] = []
    lines: list[_Line] = []

    @model_validator(mode="after")
    def _lengths(self) -> Self:
        counts = [one.count if isinstance(one, _Even) else len(one) for one in self.x]
        for line in self.lines:
            bands = [line.low, line.high]
            packed = [one for one in (line.y, *bands) if one is not None]
            sizes = {len(base64.b64decode(one)) // FLOAT for one in packed}
            if not packed or (line.low is None) != (line.high is None) or line.x >= len(counts) or sizes != {counts[line.x]}:
                raise ValueError(f"the line {line.label!r} has values of other lengths than its positions")
        named = [line for line in self.lines if self.reference and line.label == self.reference]
        if self.reference and not (named and named[0].y is not None):
            raise ValueError(f"has no line with the label of its reference, {self.reference!r}")
        return self
