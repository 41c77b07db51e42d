"""The error budget of the length of a vector from its components: synthetic series, whose asymptotic error is known."""

import numpy as np
import pytest
from support import interval_coverage

from dropspin.comparisons.judging.error_budget import error_budget, vector_budget

H = np.array([4e-3, 2e-3, 1e-3])
FIVE = 1e-3 * 2.0 ** np.arange(4, -1, -1)
OPPOSED = np.array([3.0, -4.0, 12.0])
"""A vector of length 13."""


def budget_of(components, h=FIVE):
    return vector_budget(h, components, None, np.zeros_like(components), np.zeros_like(h), 0.0)


@pytest.mark.parametrize("order", [1, 2])
def test_components_find_an_asymptotic_error_where_the_length_has_a_minimum(order):
    """The vanishing part has the opposite direction and is as large at the middle step, where the length is almost 0."""
    share = (FIVE / FIVE[2])[:, None] ** order
    components = OPPOSED - share * (OPPOSED + np.array([0.01, 0.0, 0.0]))
    assert error_budget(FIVE, np.linalg.norm(components, axis=1), signed=False).cause != "model"
    found = budget_of(components)
    assert (found.cause, found.asymptotic_error) == ("model", pytest.approx(13.0, rel=1e-3))
    assert found.lower <= 13.0 <= found.upper
    assert found.upper - found.lower < 1.0
    assert found.order == pytest.approx(order, abs=0.02)


def test_components_that_vanish_are_no_model_error():
    """The interval of the length contains 0, and reaches no farther than the length at the finest step."""
    components = FIVE[:, None] * OPPOSED
    found = budget_of(components)
    assert (found.cause, found.lower) == ("discretisation", 0.0)
    assert found.upper <= 13.0 * FIVE[-1]
    assert found.order == pytest.approx(1.0, abs=1e-6)


def test_components_at_three_steps_prove_no_model_error():
    """However clear it seems: series with a kink look the same."""
    components = OPPOSED + 1e-3 * np.outer(FIVE / FIVE[0], OPPOSED)
    assert budget_of(components).cause == "model"
    three = budget_of(components[-3:], H)
    assert (three.cause, three.lower) == ("unresolved", 0.0)
    assert three.upper >= 13.0


def test_errors_that_are_judged_together_take_more_evidence():
    """Each interval is wider, and an asymptotic error that is barely a model error alone is none of three."""
    for h in (H, FIVE):
        alone, together = (error_budget(h, 1.0 + h / h[0], judged_together=count) for count in (1, 3))
        assert together.upper - together.lower > alone.upper - alone.lower
    barely = 18e-3 + H + 0.3 * H**2 / H[0]
    assert [error_budget(H, barely, judged_together=count).cause for count in (1, 3)] == ["model", "unresolved"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("family", "steps"),
    [("vectors by their components", 3), ("vectors by their components", 5), ("vectors with kinks by their components", 3)],
)
def test_intervals_of_vectors_contain_the_asymptotic_error(family, steps):
    """In at least 95 % of 2000 series; at most .2 % of those that vanish are called a model error."""
    found = interval_coverage.outcomes(family, 2000, steps)
    assert np.mean([one.is_covered for one in found]) >= 0.95
    assert np.mean([one.cause == "model" for one in found if one.asymptotic == 0.0]) <= 0.002
