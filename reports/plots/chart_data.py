"""A chart as JSON for the script of the report, which draws it."""

import base64
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from dropspin.reports.plots.chart import Chart, Line
from dropspin.reports.plots.colours import human_label
from dropspin.scenarios.state import Array

DIGITS = 6
"""Number of significant digits of positions along an axis."""


def chart_data(chart: Chart) -> dict[str, Any]:
    """The data of a chart, ready for JSON.

    Values are float32. Lines with the same times as the reference line are stored as differences from it, so that the differences have
    seven digits.
    """
    reference = next((line for line in chart.lines if chart.reference and line.label == chart.reference), None)
    xs: list[Array] = []
    lines = [_line(line, reference, xs) for line in chart.lines if len(line.x)]
    rows = list(map(human_label, chart.rows))
    drawn = {"is_flat": chart.is_flat, "rows": rows, "x": list(map(_positions, xs)), "lines": lines}
    return _given(vars(chart) | drawn | {"x_name": "", "y_name": ""})


def _given(fields: Mapping[str, Any]) -> dict[str, Any]:
    """The fields that are not empty, 0 or False, with the names that the script uses: `xLog` for `x_log`, `map` for `is_map`."""
    given = {name.removeprefix("is_"): value for name, value in fields.items() if value or (isinstance(value, int) and name == "x")}
    return {re.sub("_(.)", lambda letter: letter[1].upper(), name): value for name, value in given.items()}


def _line(line: Line, reference: Line | None, xs: list[Array]) -> dict[str, Any]:
    number = next((number for number, x in enumerate(xs) if np.array_equal(x, line.x)), len(xs))
    if number == len(xs):
        xs.append(line.x)
    common = 0 if reference is None or line is reference else int(np.sum(_at_the_same(line.x, reference.x)))
    y = line.y.copy()
    if reference is not None and common:
        y[:common] -= reference.y[:common]
    arrays = {"y": None if line.is_fill else y, "low": line.low, "high": line.high}
    packed = {part: None if values is None else _packed(values) for part, values in arrays.items()}
    name = human_label(line.label)
    drawn = {"name": name if name != line.label else "", "x": number, "common": common, "is_fill": False}
    return _given(vars(line) | packed | drawn)


def _at_the_same(x: Array, reference: Array) -> Array:
    """For each position, whether it and all previous ones equal those of the reference, shape (n,)."""
    count = min(len(x), len(reference))
    same = np.isclose(x[:count], reference[:count], rtol=1e-12, atol=0.0)
    return np.logical_and.accumulate(same).astype(float)


def _positions(x: Array) -> Any:
    """Positions along an axis: first position, spacing and number if they are evenly spaced, otherwise the rounded positions."""
    if len(x) > 2 and np.allclose(np.diff(x), x[1] - x[0], rtol=1e-6, atol=0.0):
        return {"first": float(x[0]), "step": float((x[-1] - x[0]) / (len(x) - 1)), "count": len(x)}
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in x]


@np.errstate(over="ignore")  # an engine may return 1e300
def _packed(values: Array) -> str:
    """Values as float32 in base 64; NaN and infinity are gaps."""
    return base64.b64encode(np.where(np.isfinite(values), values, np.nan).astype("<f4").tobytes()).decode()
