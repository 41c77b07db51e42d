"""The names of results and time steps in the file of a baseline."""

from collections.abc import Hashable, Mapping
from typing import Any

from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.symmetries import kind_of
from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS
from dropspin.scenarios import DropspinError
from dropspin.scenarios.errors import did_you_mean

SUFFIXES = {"_order": "order", "_asymptotic_error": "asymptotic_error"}
"""Suffixes of the names of results that are fitted to several time steps, and the kinds of such results."""


def name_of(row: Mapping[Hashable, Any]) -> str:
    """The name of a result in the file."""
    return row["metric"] + next((ending for ending, kind in SUFFIXES.items() if kind == row["kind"]), "")


def metric_and_kind(where: str, name: str) -> tuple[str, str]:
    """The metric and the kind of a result, from its name in the file."""
    if name in METRICS:
        return name, METRICS[name].kind
    if name in ENSEMBLE_METRICS:
        return name, "ensemble"
    if (kind := kind_of(name)) is not None:
        return name, kind
    for ending, of_suffix in SUFFIXES.items():
        if name.removesuffix(ending) in METRICS and name.endswith(ending):
            return name.removesuffix(ending), of_suffix
    raise DropspinError(f"{where}: no such result.{did_you_mean(name, [*METRICS, *ENSEMBLE_METRICS])}")


def assert_steps(where: str, steps: str) -> None:
    """Raise `DropspinError` unless a text is a time step [s], or several, as `values.step_names` writes it."""
    try:
        written = ", ".join(repr(float(step)) for step in steps.split(","))
    except ValueError:
        raise DropspinError(f"{where}: {steps!r} is not a time step or a list of them; write seconds, such as '0.004'.") from None
    if written != steps:
        raise DropspinError(f"{where}: {steps!r}: write it as {written!r}, or runs at this step will not find it.")
