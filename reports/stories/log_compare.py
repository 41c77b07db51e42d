"""The output of `dropspin log compare`: errors of engines beside measured tosses, groups that the tosses do not tell apart, and parts."""

import math
from collections.abc import Sequence
from typing import Any

from dropspin.comparisons.logs.compare import Error, LogComparison, Pair
from dropspin.reports.document import Document, Heading, Sentences, Table
from dropspin.reports.stories.numbers import formatted, grouped, left_out

DEGREES = 180.0 / math.pi


def as_data(found: LogComparison) -> dict[str, Any]:
    """The results, with all digits."""
    parts = ("tosses", "length", "dt", "errors", "pairs", "groups", "parts", "left_out")
    return {part: getattr(found, part) for part in parts}


def document(found: LogComparison) -> Document:
    """The errors, the groups, the differences and the parts."""
    legend = (
        f"Means over {found.tosses} tosses with 95 % intervals; in brackets the noise floor, due to the errors of the measured start. "
        f"Distances are shares of {1e3 * found.length:.4g} mm, the largest extent of the body; energies are shares of that at the start."
    )
    return Document(
        "Engines compared with measured tosses",
        [
            Table(_error_rows(found.errors), left_out_first=["at impact", "0.1 s later"]),
            Sentences([legend]),
            Heading("Differences between engines", on_terminal=True),
            Table([_pair_row(pair) for pair in found.pairs]),
            Sentences([*_group_sentences(found), *left_out(found.left_out)]),
            Heading("Parts of the mean errors over the motion", on_terminal=True),
            Table(_part_rows(found)),
            Sentences(
                [
                    "Parts are what an error loses when one thing after another is improved: the centre of mass by the flights, "
                    "fitted friction and restitution, half of the time step; then the noise floor. The rest is due to the model of contact."
                ]
            ),
        ],
    )


AT = {"impact": "at impact", "+0.1 s": "0.1 s later", "mean": "mean over the motion", "end": "at the end"}


def _error_rows(errors: Sequence[Error]) -> list[dict[str, str]]:
    rows = []
    for (engine, quantity), kinds in grouped(errors, lambda error: (error.engine, error.quantity)).items():
        unit = {"rad": " [°]", "s": " [s]"}.get(kinds[0].unit, "")
        cells = {error.at: _cell(error) for error in kinds}
        rows.append({"engine": engine, "error": quantity + unit} | {name: cells.get(at, "") for at, name in AT.items()})
    return rows


def _cell(error: Error) -> str:
    factor = DEGREES if error.unit == "rad" else 1.0
    return f"{interval(factor * error.value, factor * error.lower, factor * error.upper)} ({formatted(factor * error.noise_floor)})"


def interval(value: float, lower: float, upper: float) -> str:
    """A value and its interval; without one, the value alone."""
    return formatted(value) if math.isnan(lower) else f"{formatted(value)}, {formatted(lower)} to {formatted(upper)}"


def _pair_row(pair: Pair) -> dict[str, str]:
    factor, unit = (DEGREES, " [°]") if pair.quantity == "orientation" else (1.0, "")
    return {
        "engines": f"{pair.first} − {pair.second}",
        "error": pair.quantity + unit,
        "difference": interval(factor * pair.difference, factor * pair.lower, factor * pair.upper),
        "differ": "yes" if pair.differs else "not significantly",
    }


def _group_sentences(found: LogComparison) -> list[str]:
    """The groups by quantity, and what they mean."""
    sentences = [
        f"By {quantity}, these tosses do not tell apart: {'; '.join(' and '.join(group) for group in groups if len(group) > 1)}."
        for quantity, groups in found.groups.items()
        if any(len(group) > 1 for group in groups)
    ]
    meaning = (
        "The intervals of the differences hold for all pairs at once. Within a group there is no order; an engine may be in two groups, "
        "whose other members differ."
    )
    return [*sentences, meaning] if found.pairs else []


def _part_rows(found: LogComparison) -> list[dict[str, str]]:
    rows = []
    for (engine, quantity), parts in grouped(found.parts, lambda part: (part.engine, part.quantity)).items():
        factor, unit = (DEGREES, " [°]") if quantity == "orientation" else (1.0, "")
        cells = {part.part: interval(factor * part.value, factor * part.lower, factor * part.upper) for part in parts}
        rows.append({"engine": engine, "error": quantity + unit, **cells})
    return rows
