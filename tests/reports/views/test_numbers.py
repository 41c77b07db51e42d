"""Numbers as text."""

import math

import pytest

from reports.views.numbers import formatted


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
