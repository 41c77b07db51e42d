"""What the conclusion says of the means over the starts of an ensemble, which no check judges."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from dropspin.comparisons.results.ensembles import EnsembleOutcome
from dropspin.comparisons.results.results import Results
from dropspin.comparisons.results.table import empty_table
from dropspin.reports.stories.findings import ensemble_differences


def differing(*rows, ensembles=()):
    """The sentences of a run with differences between two engines: metric, time step [s], ends of the interval."""
    pairs = [
        {"scene": "anyhow", "engine": "wang", "truth": "mine", "metric": metric, "dt": dt, "unit": "s" if metric == "rest_time" else "1"}
        | {"value": 0.5 * (lower + upper), "lower": lower, "upper": upper, "kind": "agreement"}
        for metric, dt, lower, upper in rows
    ]
    agreements = pd.DataFrame(pairs, columns=empty_table().columns)
    return list(ensemble_differences(replace(EMPTY, agreements=agreements, ensembles=dict(ensembles))))


EMPTY = Results(table=empty_table(), engines=["wang", "mine"], scenes={}, trajectories={}, ensembles={}, provenance={})


def test_means_that_differ_at_every_time_step_are_stated_with_the_values_of_the_finest():
    found = differing(
        ("rest_time", 0.002, 0.1, 0.3),
        ("rest_time", 0.001, 0.05, 0.15),
        ("energy_at_end", 0.002, -2.0, -1.0),
        ("energy_at_end", 0.001, -0.4, -0.2),
    )
    start = "Means over the starts of anyhow, which are not checked one by one, differ: Wang's method and mine in "
    assert found == [f"{start}rest time by 0.1 s, energy at end by 0.3."]


def test_starts_that_still_move_at_the_end_are_counted_at_the_finest_time_step():
    t, nothing = np.linspace(0.0, 2.0, 41), np.zeros(4)

    def outcome(*rest_times):
        return EnsembleOutcome(t, np.zeros((4, 41)), nothing, np.array(rest_times), np.zeros((4, 41)))

    found = differing(
        ("rest_time", 0.002, 0.1, 0.3),
        ("rest_time", 0.001, 0.05, 0.15),
        ensembles={
            ("anyhow", "wang", 0.002): outcome(2.0, 2.0, 2.0, 2.0),
            ("anyhow", "wang", 0.001): outcome(1.0, 2.0, 2.0, 1.5),
            ("anyhow", "mine", 0.001): outcome(1.0, 2.0, 1.2, 1.5),
            ("other", "mine", 0.001): outcome(2.0, 2.0, 2.0, 2.0),
        },
    )
    [sentence] = found
    assert sentence.endswith("by 0.1 s; up to 2 of 4 starts still move at the end, which counts as their rest time.")


@pytest.mark.parametrize("coarser", [(-0.1, 0.3), (-0.3, -0.1)])
def test_means_that_do_not_differ_or_change_their_order_are_not_stated(coarser):
    assert differing(("rest_time", 0.002, *coarser), ("rest_time", 0.001, 0.05, 0.15)) == []


def test_differences_of_rounding_are_not_stated():
    assert differing(("energy_at_end", 0.002, 1e-16, 3e-16), ("energy_at_end", 0.001, 0.5e-15, 1.5e-15)) == []


def test_other_differences_are_not_means():
    assert differing(("position_error", 0.001, 0.05, 0.15)) == []
