"""Printed digits: rounding to them, bounds and tolerances."""

import math

import pytest

from dropspin.comparisons.published.results import Result, compared
from dropspin.comparisons.published.sources import Case, Source, sources
from dropspin.scenarios import DropspinError
from dropspin.scenarios.validation import validated


def _beside(printed, value, significant=0):
    return compared(Result("source", "tool", "quantity", printed, "", "engine", "not run"), value, significant)


@pytest.mark.parametrize(
    ("printed", "value", "here"),
    [
        ("0.0130708", 0.01307084999, "0.0130708"),
        ("-5.25321665064", -5.253216650644, "-5.25321665064"),
        ("93", 93.4, "93"),
        ("5e-3", 0.0047645, "5e-3"),
        ("1.86413e-06", 1.864129e-6, "1.86413e-6"),
        ("0.5600215", 0.5600215, "0.5600215"),
        ("37475e-4", 3.74750001, "3.7475e0"),
    ],
)
def test_a_value_is_rounded_to_the_printed_digits(printed, value, here):
    found = _beside(printed, value)
    assert found.here == here
    assert found.difference == value - float(printed)
    assert (found.status == "reproduced") is (abs(float(here) - float(printed)) < 1e-15)


@pytest.mark.parametrize(
    ("printed", "value"),
    [("0.0130708", 0.01307086), ("0.0130708", 0.01307074), ("93", 93.6), ("5e-3", 0.0044), ("5e-3", 0.0056), ("0.93", math.nan)],
)
def test_half_a_unit_of_the_last_digit_is_the_limit(printed, value):
    assert _beside(printed, value).status == "differs"


def test_dropped_zeros_are_compared_too():
    """A source with six significant digits prints 0.049 for 0.0490000."""
    assert _beside("0.049", 0.049000001, significant=6).status == "reproduced"
    assert _beside("0.049", 0.0490001, significant=6).status == "differs"
    assert _beside("0.049", 0.0490001).status == "reproduced"


@pytest.mark.parametrize(
    ("printed", "inside", "outside"),
    [
        ("< 1.01", 1.0099, 1.01),
        ("> 0.7", 0.7001, 0.7),
        ("≤ 1.8e-15", 1.8e-15, 1.81e-15),
        ("≤ 3.7475", 3.7475 + 9e-15, 3.74751),
        ("0.25±0.0025", 0.24751, 0.2474),
        ("0.25±0.0025", 0.25249, 0.2526),
    ],
)
def test_bounds_and_tolerances_of_the_source(printed, inside, outside):
    assert _beside(printed, inside).status == "reproduced"
    assert _beside(printed, outside).status == "differs"
    assert _beside(printed, math.nan).status == "differs"


@pytest.mark.parametrize(
    "printed", ["3,7475", "3.7475 m", "nan", "inf", "", "3.75±5%", "< x", "1±2±3", "0.25±inf", "0.25±-0.0025", "< 1±2"]
)
def test_digits_that_are_no_number_are_refused(printed):
    with pytest.raises(DropspinError, match=r"must be a number such as 3\.75 or 5e-3, a bound such as < 1\.01, a tolerance"):
        validated(Case, "mine.toml", {"case": "a", "dt": 1e-3, "printed": [printed]})


@pytest.mark.parametrize("printed", [["1.0"], ["1.0", "2.0", "3.0"]])
def test_a_case_has_digits_for_each_quantity(printed):
    content = sources(["fmi-bouncing-ball"])[0].model_dump(mode="json")
    content["groups"][0] |= {"quantities": ["height at 0.1 s", "height at 0.2 s"]}
    content["groups"][0]["cases"][0]["printed"] = printed
    with pytest.raises(DropspinError) as error:
        validated(Source, "mine.toml", content)
    shown = f"{printed}; must be one for each of quantities, ['height at 0.1 s', 'height at 0.2 s']."
    assert str(error.value) == f"mine.toml: groups[0]: cases[0].printed: got {shown}"
