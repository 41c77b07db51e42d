"""Error budgets in words, of results that are made up so that the parts are known."""

import math
from dataclasses import dataclass

import pandas as pd
import pytest

from comparisons.results.measurement import Measurement, as_table
from reports.views.error_budget import error_budgets


@dataclass(frozen=True)
class Made:
    """As much of a run as the budget needs: one engine's error at the finest step, and its extrapolation."""

    table: pd.DataFrame


def made(value, unit="1", asymptotic=None, order=None):
    """A run with this error; `asymptotic` is its asymptotic error, uncertainty and cause."""
    metric = "orientation_error" if unit == "rad" else "energy_error"

    def row(metric=metric, **content):
        return Measurement(scene="made", engine="made", metric=metric, unit=unit, **{"verdict": "measured", **content})

    rows = [row(dt=1e-3, kind="truth", value=value), row("penetration", dt=1e-3, kind="truth", value=1e-5)]
    rows.append(row("penetration", kind="asymptotic_error", value=0.0, upper=1e-9, cause="discretisation"))
    if asymptotic is not None:
        error, uncertainty, cause = asymptotic
        reason = "follows no power of dt"
        rows.append(row(kind="asymptotic_error", value=error, upper=uncertainty, cause=cause, reason=reason))
    if order is not None:
        rows.append(row(kind="order", value=order))
    return Made(as_table(rows))


def budget(results):
    [found] = error_budgets(results, "made")
    return found, (found.discretisation, found.model, found.setting)


def test_a_discretisation_error_vanishes_at_its_order():
    found, parts = budget(made(8e-3, asymptotic=(1e-5, 1e-4, "discretisation"), order=2.0))
    assert parts == (8e-3, 0.0, 0.0)
    assert found.sentence == "Discretisation error of order 2.00: halving dt gives about 2.00e-03."


@pytest.mark.parametrize(
    ("cause", "place", "kind"),
    [("model", 1, "model error, which no time step cures"), ("setting", 2, "setting error, which the calibrated profile does not have")],
)
def test_parts_of_an_error_add_up(cause, place, kind):
    """A quarter of the error is discretisation error."""
    found, parts = budget(made(4e-2, asymptotic=(3e-2, 1e-4, cause), order=1.0))
    assert sum(parts) == pytest.approx(4e-2)
    assert parts[place] == 3e-2
    assert found.sentence == f"75 % is a {kind}; the rest is discretisation error of order 1.00."


def test_parts_of_opposite_signs():
    """An asymptotic error of 0.9 and a discretisation error of −0.1: the first is nine tenths of their sizes."""
    found, parts = budget(made(0.8, asymptotic=(0.9, 1e-4, "model"), order=1.0))
    assert parts == (pytest.approx(-0.1), 0.9, 0.0)
    assert found.sentence.startswith("90 % is a model error")


def test_no_shares_without_a_known_asymptotic_error():
    """Errors that grow, follow no power of dt, or vanish without a clear order are not divided into parts."""
    for asymptotic in ((4e-2, 0.0, "model"), (4e-2, 1e-2, "unresolved"), (4e-2, 3e-2, "discretisation")):
        found, (step, *_) = budget(made(4e-2, asymptotic=asymptotic))
        assert math.isnan(step)
        assert "%" not in found.sentence


def test_an_error_that_vanishes_without_a_clear_order():
    found, _ = budget(made(4e-2, asymptotic=(4e-2, 3e-2, "discretisation")))
    assert found.sentence == "Vanishes as dt → 0 within ± 3.00e-02, without a clear order."


@pytest.mark.parametrize(
    ("results", "sentence"),
    [
        (made(4e-2), "Too few usable time steps."),
        (made(3.14), "Too few usable time steps."),
        (made(1.0, unit="rad"), "Too few usable time steps."),
        (made(4e-2, asymptotic=(4e-2, 1e-2, "unresolved")), "The parts are undefined: the error follows no power of dt."),
        (made(3.14, asymptotic=(3.14, 1e-2, "unresolved")), "The parts are undefined: the error follows no power of dt."),
    ],
)
def test_why_parts_are_undefined(results, sentence):
    found, parts = budget(results)
    assert all(map(math.isnan, [*parts, found.uncertainty]))
    assert found.sentence == sentence


def test_an_error_within_rounding_has_no_parts():
    found, parts = budget(made(4e-2, asymptotic=(4e-2, 5e-2, "rounding")))
    assert parts == (0.0, 0.0, 0.0)
    assert found.sentence == "Within rounding."


def test_an_uncertain_asymptotic_error():
    """With an order the rest is discretisation error; without one, only if the asymptotic error is known well."""
    ordered, parts = budget(made(4e-2, asymptotic=(3e-2, 5e-3, "model"), order=1.0))
    assert parts[0] == pytest.approx(1e-2)
    assert ordered.sentence.endswith("the rest is discretisation error of order 1.00.")
    unordered, parts = budget(made(4e-2, asymptotic=(3e-2, 5e-3, "model")))
    assert (math.isnan(parts[0]), parts[1]) == (True, 3e-2)
    assert unordered.sentence == "A model error, which no time step cures; its discretisation part is undefined."
    flat, parts = budget(made(4e-2, asymptotic=(3e-2, 1e-4, "model")))
    assert parts[0] == pytest.approx(1e-2)
    assert flat.sentence.endswith("the rest is discretisation error.")


def test_a_constant_error_is_all_model_error():
    found, parts = budget(made(4e-2, asymptotic=(4e-2, 1e-4, "model")))
    assert parts == (0.0, 4e-2, 0.0)
    assert found.sentence == "A model error, which no time step cures."


def test_a_saturated_angle_is_mentioned():
    """An engine that is as wrong as possible is not left out."""
    found, parts = budget(made(3.14, unit="rad"))
    assert all(map(math.isnan, parts))
    assert found.sentence == "The angle is near π, where it saturates."


def test_negligible_errors_are_left_out():
    assert error_budgets(made(1e-5, asymptotic=(1e-5, 1e-9, "model")), "made") == []
