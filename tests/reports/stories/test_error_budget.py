"""Error budgets in words, of results that are made up so that the asymptotic error is known."""

import math

import pytest

from dropspin.comparisons.results.results import Results
from dropspin.comparisons.results.table import Measurement, as_table
from dropspin.reports.stories.error_budget import error_budgets


def made(value, unit="1", asymptotic=None, order=None, spread=0.5, judged="measured"):
    """A run of one engine with this error at the finest step.

    `asymptotic` is its asymptotic error, the interval's ends and the cause; `spread` is the order's.
    """
    metric = "orientation_error" if unit == "rad" else "energy_error"

    def row(metric=metric, **content):
        return Measurement(scene="made", engine="made", metric=metric, unit=unit, **{"verdict": "measured", **content})

    rows = [row(dt=1e-3, kind="truth", value=value), row("penetration", dt=1e-3, kind="truth", value=1e-5)]
    rows.append(row("penetration", kind="asymptotic_error", value=0.0, lower=-1e-9, upper=1e-9, cause="discretisation"))
    if asymptotic is not None:
        error, lower, upper, cause = asymptotic
        reason = "the time steps leave it open"
        rows.append(row(kind="asymptotic_error", value=error, lower=lower, upper=upper, cause=cause, reason=reason, verdict=judged))
    if order is not None:
        rows.append(row(kind="order", value=order, lower=order - spread, upper=order + spread))
    return Results(as_table(rows), {}, ("made",), {})


def budget(results):
    [found] = error_budgets(results)
    return found


@pytest.mark.parametrize(
    ("results", "sentence"),
    [
        (
            made(8e-3, asymptotic=(1e-5, -1e-4, 1e-4, "discretisation"), order=2.0),
            "Discretisation error of order 2.00 (1.50 to 2.50): halving dt gives about 2.00e-03.",
        ),
        (made(8e-3, asymptotic=(1e-5, -1e-4, 1e-4, "discretisation")), "Discretisation error."),
        (made(8e-3, asymptotic=(1e-5, -1e-4, 1e-4, "discretisation"), order=3.9, spread=2.5), "Discretisation error."),
        (
            made(8e-3, asymptotic=(1e-5, -1e-4, 2e-2, "discretisation"), order=4.0),
            "Attributed to discretisation, although the time steps bound the asymptotic error only by 0.0200.",
        ),
        (
            made(4e-2, asymptotic=(3e-2, 2.9e-2, 3.1e-2, "model"), order=1.0),
            "0.0300 is a model error, which no time step removes; the remaining 0.0100 is discretisation error.",
        ),
        (
            made(0.8, asymptotic=(0.9, 0.89, 0.91, "setting")),
            "0.900 is a setting error, of which calibrated settings remove more than half; the remaining -0.100 is discretisation error.",
        ),
        (made(4e-2, asymptotic=(4.05e-2, 3.9e-2, 4.2e-2, "model")), "A model error, which no time step removes."),
        (
            made(4e-2, asymptotic=(4.05e-2, 3.9e-2, 4.2e-2, "model"), judged="known"),
            "A model error, which no time step removes. Expected: the time steps leave it open.",
        ),
        (
            made(4e-2, asymptotic=(3e-2, 2.9e-2, 3.1e-2, "model"), judged="limited"),
            "0.0300 is a model error, which no time step removes; the remaining 0.0100 is discretisation error. "
            "Known limitation: the time steps leave it open.",
        ),
        (made(4e-2, asymptotic=(4e-2, -1e-2, 5e-2, "rounding")), "Within rounding error."),
        (made(4e-2, asymptotic=(4e-2, -1e-2, 5e-2, "unresolved")), "Undecided: the time steps leave it open."),
        (made(4e-2), "Undecided: too few usable time steps."),
        (made(1.0, unit="rad"), "Undecided: too few usable time steps."),
        (made(3.14, unit="rad"), "Undecided: the angle is near π, where it saturates."),
    ],
)
def test_budget_in_a_sentence(results, sentence):
    """An error is discretisation error, or partly or wholly model or setting error, or undecided with the reason."""
    assert budget(results)["sentence"] == sentence


def test_interval_is_stated():
    """The asymptotic error comes with both ends of its interval; without extrapolation all three are NaN."""
    interval = ("value_of_limit", "lower_of_limit", "upper_of_limit")
    found = budget(made(4e-2, asymptotic=(3e-2, 2.9e-2, 3.2e-2, "model")))
    assert [found[name] for name in ("value", *interval, "cause")] == [4e-2, 3e-2, 2.9e-2, 3.2e-2, "model"]
    found = budget(made(4e-2))
    assert all(math.isnan(found[name]) for name in interval)
    assert found["cause"] == "unresolved"


def test_negligible_errors_are_left_out():
    """Errors below the size that summaries mention have no budget."""
    assert error_budgets(made(1e-5, asymptotic=(1e-5, -1e-9, 1e-9, "model"))) == []
