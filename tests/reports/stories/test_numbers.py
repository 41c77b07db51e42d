"""Numbers as text."""

import math

import pytest

from dropspin.reports.pages import with_minus, with_names
from dropspin.reports.stories.matrix import level
from dropspin.reports.stories.numbers import duration, explained_by, failing, formatted, left_out


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.18, "0.180"),
        (-0.1796, "-0.180"),
        (2.0, "2.00"),
        (12.0, "12.0"),
        (123.0, "123"),
        (999.7, "1.00e+03"),
        (0.01, "0.0100"),
        (0.00999, "9.99e-03"),
        (0.0, "0"),
        (-0.0, "0"),
        (math.nan, "–"),
        (math.inf, "inf"),
    ],
)
def test_three_significant_digits(value, text):
    """Also where the last ones are zero, so that the numbers of a column have the same precision."""
    assert formatted(value) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.9997, "1 s"), (0.123456, "123 ms"), (1234.0, "1230 s"), (9.999e-7, "1 µs"), (3e-8, "30 ns"), (1.5, "1.5 s"), (0.0, "0 ns")],
)
def test_durations_have_no_exponent(seconds, text):
    assert duration(seconds) == text


def test_sizes_of_errors_that_are_infinite_have_the_largest_level():
    assert [level(error) for error in (0.0, 1e-8, 2e-8, 0.1, 0.11, math.inf, math.nan)] == [0, 0, 1, 7, 8, 8, None]


def test_counts_and_reasons_are_sentences():
    assert [failing(*counts, "check") for counts in ((1, 1), (1, 2), (2, 1200))] == [
        "1 of 1 check fails",
        "1 of 2 checks fails",
        "2 of 1,200 checks fail",
    ]
    assert left_out({"rapier": "rapier is not installed: pip install x.", "a": "diverged"}) == [
        "Left out: rapier is not installed: pip install x.",
        "Left out: a, diverged.",
    ]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("-0.3", "−0.3"),
        ("energy error is -0.96, -0.95 → -0.94", "energy error is −0.96, -0.95 → −0.94"),
        ("-1.2 to -0.3 (-2 … -1)", "−1.2 to −0.3 (−2 … −1)"),
        ("-0.2, -0.47 to 0.06", "−0.2, −0.47 to 0.06"),
        ("center_of_mass = [0.1, -0.2, -3]", "center_of_mass = [0.1, -0.2, -3]"),
        ('solref="-400 -0.5"', 'solref="-400 -0.5"'),
        ("x = -0.3; drop-box-2, 1e-3", "x = -0.3; drop-box-2, 1e-3"),
    ],
)
def test_negative_numbers_on_pages_have_a_minus_sign_but_what_may_be_copied_has_a_hyphen(text, shown):
    assert with_minus(text) == shown


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("wang: mujoco[integrator=rk4] at 2 ms, dominated by mujoco.", "Wang's method: MuJoCo (RK4) at 2 ms, dominated by MuJoCo."),
        (
            "rapier-js and rapier; integrated-newton, my_newton:Newton",
            "Rapier (JavaScript) and Rapier; integrated-newton, my_newton:Newton",
        ),
        ("dropspin run x -e mujoco -e 'mujoco[cone=elliptic]'", "dropspin run x -e mujoco -e 'mujoco[cone=elliptic]'"),
    ],
)
def test_sentences_of_pages_name_engines_but_commands_have_their_labels(text, shown):
    assert with_names(text) == shown


@pytest.mark.parametrize(
    ("shares", "text"),
    [
        ({"a": 1.04}, "a explains 104 % of it"),
        ({"a, b": 1.04}, "a and b together explain 104 % of it; neither alone explains 90 %"),
        ({"a": 1.0, "b": 1.0}, "either a, or b explains 100 % of it"),
        ({"a": 0.7, "b": 0.3}, "a explains 70 % of it, and b 30 %"),
        ({"a": 0.897, "b": 0.148}, "a explains 89.7 % of it, and b 14.8 %"),
    ],
)
def test_alternatives_are_named_where_there_are_several(shares, text):
    assert explained_by(shares, "of it") == text
