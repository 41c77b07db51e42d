"""Errors taken apart in words: of made-up engines, whose parts are known."""

import math

import pandas as pd
import pytest

from comparisons.results.results import as_frame
from reports.views.error_budget import taken_apart


class Made:
    """As much of a run as is asked for: one engine's error at the finest step, and what several steps say of it."""

    def __init__(self, value, unit="1", limit=None, order=None):
        shared = {"scene": "made", "engine": "made", "metric": "orientation_error" if unit == "rad" else "energy_error", "unit": unit}
        rows = [shared | {"dt": 1e-3, "kind": "truth", "value": value, "verdict": "measured"}]
        rows += [shared | {"metric": "penetration", "dt": 1e-3, "kind": "truth", "value": 1e-5, "verdict": "measured"}]
        rows += [shared | {"metric": "penetration", "kind": "asymptotic_error", "value": 0.0, "upper": 1e-9, "cause": "discretisation"}]
        if limit is not None:
            m, uncertainty, cause = limit
            reason = "follows no power of the step; take finer steps"
            rows += [shared | {"kind": "asymptotic_error", "value": m, "upper": uncertainty, "cause": cause, "reason": reason}]
        if order is not None:
            rows += [shared | {"kind": "order", "value": order}]
        self.table = as_frame(rows)


def parts(made):
    [found] = taken_apart(made, "made")
    return found, (found.of_step, found.of_model, found.of_setting)


def test_of_the_step():
    found, split = parts(Made(8e-3, limit=(1e-5, 1e-4, "discretisation"), order=2.0))
    assert split == (8e-3, 0.0, 0.0)
    assert found.words == "All of it is the step's, at order 2.00: half the step leaves some 2.00e-03."


@pytest.mark.parametrize(("cause", "place", "whose"), [("model", 1, "the model's: no step cures it"), ("setting", 2, "a setting's")])
def test_of_what_stays(cause, place, whose):
    """A quarter of the error is the step's; the parts add up."""
    found, split = parts(Made(4e-2, limit=(3e-2, 1e-4, cause), order=1.0))
    assert sum(split) == pytest.approx(4e-2)
    assert split[place] == 3e-2
    assert f"75 % is {whose}" in found.words
    assert found.words.endswith("the rest is the step's, at order 1.00.")


def test_parts_of_unlike_signs():
    """A limit of 0.9 that a step's part of −0.1 hides: nine tenths of what there is."""
    found, split = parts(Made(0.8, limit=(0.9, 1e-4, "model"), order=1.0))
    assert split == (pytest.approx(-0.1), 0.9, 0.0)
    assert found.words.startswith("90 % is the model's")


def test_no_split_without_a_limit_that_is_known():
    """Errors that grow, follow no power, or go to 0 at no clear order are not shared out."""
    for limit in ((4e-2, 0.0, "model"), (4e-2, 1e-2, "unresolved"), (4e-2, 3e-2, "discretisation")):
        found, (step, *_) = parts(Made(4e-2, limit=limit))
        assert math.isnan(step)
        assert "%" not in found.words
        assert "All" not in found.words


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (Made(4e-2), "Too few of these steps tell it."),
        (Made(3.14), "Too few of these steps tell it."),
        (Made(1.0, unit="rad"), "Too few of these steps tell it."),
        (Made(4e-2, limit=(4e-2, 1e-2, "unresolved")), "Cannot be taken apart: follows no power of the step; take finer steps."),
        (Made(3.14, limit=(3.14, 1e-2, "unresolved")), "Cannot be taken apart: follows no power of the step; take finer steps."),
    ],
)
def test_why_it_cannot_be_told(made, words):
    found, split = parts(made)
    assert all(map(math.isnan, [*split, found.uncertainty]))
    assert found.words == words


def test_of_rounding():
    found, split = parts(Made(4e-2, limit=(4e-2, 5e-2, "rounding")))
    assert split == (0.0, 0.0, 0.0)
    assert found.words == "As small as rounding makes it."


def test_a_limit_that_is_less_sure():
    """With an order the rest is the step's; without one, only if the limit is known well."""
    told, split = parts(Made(4e-2, limit=(3e-2, 5e-3, "model"), order=1.0))
    assert split[0] == pytest.approx(1e-2)
    assert told.words.endswith("the rest is the step's, at order 1.00.")
    untold, split = parts(Made(4e-2, limit=(3e-2, 5e-3, "model")))
    assert (math.isnan(split[0]), split[1]) == (True, 3e-2)
    assert untold.words.endswith("what of it is the step's cannot be told.")
    flat, split = parts(Made(4e-2, limit=(3e-2, 1e-4, "model")))
    assert split[0] == pytest.approx(1e-2)
    assert flat.words.endswith("the rest is the step's.")


def test_flat_is_all_the_models():
    found, split = parts(Made(4e-2, limit=(4e-2, 1e-4, "model")))
    assert split == (0.0, 4e-2, 0.0)
    assert found.words == "All of it is the model's: no step cures it."


def test_half_a_turn_is_told():
    """An engine that is as wrong as can be is not left out."""
    found, split = parts(Made(3.14, unit="rad"))
    assert all(map(math.isnan, split))
    assert found.words == "Near half a turn, where an angle cannot grow on."


def test_small_errors_are_not_worth_a_word():
    made = Made(1e-5, limit=(1e-5, 1e-9, "model"))
    assert isinstance(made.table, pd.DataFrame)
    assert taken_apart(made, "made") == []
