"""The reasons of expectations: a mechanism, which holds for every engine that they are shown for; the measured value is that of the row."""

import math
import re

import pytest

from dropspin.comparisons.engines.registry import BUILT_IN
from dropspin.scenarios import load, names

NAMES = {engine: engine for engine in BUILT_IN} | {"wang": "wang", "pybullet": "bullet"}
"""What a text calls an engine, in lower case."""


@pytest.mark.parametrize("scene", names())
def test_reason_states_no_measured_value_and_no_other_engine(scene):
    for expectation in load(scene).expect:
        reason, own = expectation.reason.lower(), (expectation.engine or "").partition("[")[0]
        assert "measured" not in reason
        assert [engine for engine, name in NAMES.items() if name in re.findall(r"[a-z_-]+", reason) and engine != own] == []


@pytest.mark.parametrize("scene", names())
def test_bound_is_not_below_the_number_that_its_reason_derives(scene):
    """An engine whose error is the stated one is right. A symbol of one letter that is given, as in `at e = 0.5`, is no result."""
    for expectation in load(scene).expect:
        bound = expectation.below or max(map(abs, expectation.within or (math.inf,)))
        derived = re.findall(r"(?<! [eu]) = (-?[\d.]+(?:e-?\d+)?)", expectation.reason)
        assert [number for number in derived if abs(float(number)) > bound] == []
