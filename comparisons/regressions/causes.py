"""The search for a single cause with which the asymptotic errors of an engine are consistent: a wrong parameter, or a known fault.

The errors that a cause has are the differences between the exact solutions of the scene with and without it. A cause must have the errors
of the scenes in which asymptotic errors fail, and none in the scenes in which they pass. Where an exact solution with the cause is not
known to the end, or leaves a metric undefined, neither holds; scenes in which it is so for all errors that fail are named.
"""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from dropspin.comparisons.faults.fault_model import FaultModel
from dropspin.comparisons.faults.parameters import FAULT_MODELS
from dropspin.comparisons.judging.convergence import JUMPING
from dropspin.comparisons.measuring.comparison import Comparison, exactly
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.tolerances import negligible
from dropspin.comparisons.regressions.parameters import PARAMETERS, Parameter
from dropspin.comparisons.results.results import Results
from dropspin.scenarios import DropspinError, Scenario, Trajectory, truth_for

Errors = Callable[[str], float]
"""The error in a metric, by its name."""
FIRST_SIZE, SMALLEST_SIZE = 1e-3, 1e-6
LARGEST_SIZE = 0.3
MOST_STEPS = 20_000
"""Largest number of time steps of the sampled exact solutions."""
NEAR = 1.3
"""Largest ratio of two sizes of an error that count as near each other before the first iteration."""
WIDEST = 0.3
"""Largest width of the interval of an error, relative to the error, from which alone a cause is inferred; a wider one tells no size."""
ITERATIONS = 3
"""Number of iterations for the size of an error; each reduces its relative error by a factor of about the size."""


class WrongParameter(NamedTuple):
    """A parameter whose wrong value explains the errors.

    Attributes:
        parameter: The parameter.
        size: Its error, in the unit of the parameter.
        signed: Whether the errors determine if it is too high or too low.
    """

    parameter: Parameter
    size: float
    signed: bool


class Causes(NamedTuple):
    """The causes of which each alone explains the errors: wrong parameters, and known faults.

    Attributes:
        parameters: The wrong parameters.
        faults: The known faults.
        unexamined: For each cause, by its name or message, the scenes whose failed errors could not be compared with those that it has.
    """

    parameters: list[WrongParameter]
    faults: list[FaultModel]
    unexamined: Mapping[str, Sequence[str]]


def causes(results: Results, engine: str) -> Causes:
    """The causes each of which alone explains asymptotic errors of an engine and is excluded by none.

    Those beside a recording may have other causes than an engine's; those of a scene whose motion it does not repeat are random in part.
    Each error must lie within its 95 % interval, widened by the error of sampling the exact solutions at the run's finest time step.
    """
    table = results.table
    mine = table[(table["engine"] == engine) & (table["kind"] == "asymptotic_error") & ~table["metric"].isin(JUMPING)]
    mine = mine[~mine["scene"].isin([*results.recorded, *results.not_repeated(engine)])]
    judged = mine[mine["verdict"].isin(["failed", "passed"]) & (mine["cause"] != "unresolved") & mine["lower"].notna()]
    failed = judged[judged["verdict"] == "failed"]
    if failed.empty:
        return Causes([], [], {})
    dt = min(map(float, results.provenance["asked"]["dts"]))
    absent = _absent(table[table["engine"] == engine])
    scenes = [(results.scenes[str(name)], rows.to_dict("records"), absent.get(str(name), [])) for name, rows in judged.groupby("scene")]
    scenes.sort(key=lambda scene: all(row["verdict"] != "failed" for row in scene[1]))  # those that fail exclude most causes
    widths = (failed["upper"] - failed["lower"]) / failed["value"].abs()
    narrowest = failed.loc[widths.sort_values().index].groupby("scene", sort=False)  # first the scene whose sizes are the most precise

    unexamined: dict[str, list[str]] = {}

    def holds(fault: FaultModel) -> bool:
        widths: list[float] = []
        left = []
        for scene, rows, undefined in scenes:
            found = _explained(scene, fault, rows, undefined, dt)
            if found is None:
                return False
            widths += found[0]
            left += [scene.name] * (found[1] == 0 and any(row["verdict"] == "failed" for row in rows))
        unexamined.setdefault(fault.message, left)
        return len(widths) > 1 or min(widths, default=np.inf) <= WIDEST

    parameters = []
    for parameter in PARAMETERS:
        found = (list(_sizes(results.scenes[str(name)], parameter, rows, dt)) for name, rows in narrowest)
        sizes = [size for size in next(filter(None, found), []) if holds(_with(parameter, size))]
        parameters += [WrongParameter(parameter, sizes[0], len(sizes) == 1)] if sizes else []
    faults: dict[object, FaultModel] = {}  # the first one of those that are the same in all of these scenes
    for fault in FAULT_MODELS:
        if fault.about != "start" and holds(fault):
            faults.setdefault((fault.reported, *(_simulated(fault, scene) for scene, *_ in scenes)), fault)
    return Causes(parameters, list(faults.values()), unexamined)


def _absent(table: pd.DataFrame) -> dict[str, list[str]]:
    """By scene, the metrics of an engine's rows whose event occurs at no time step, such as a bounce that there should be."""
    rows = table[table["kind"].isin(["truth", "invariant"])]
    is_absent = (rows["value"].isna() & (rows["verdict"] == "failed")).groupby([rows["scene"], rows["metric"]]).all()
    return {str(scene): list(found["metric"]) for scene, found in is_absent[is_absent].reset_index().groupby("scene")}


def _sizes(scene: Scenario, parameter: Parameter, failed: pd.DataFrame, dt: float) -> Iterator[float]:
    """The errors of a parameter, positive and negative, that explain the errors of a scene best.

    Each error has a size that explains it. Steps of a metric, such as a contact that is detected or not, may give another one than the
    others: the size is that of the most precise error among those near the median.
    """
    rows = failed.set_index("metric")
    uncertainty = (rows["upper"] - rows["lower"] + [negligible(scene, unit) for unit in rows["unit"]]) / rows["value"].abs()
    for sign in (1.0, -1.0):
        size, lead = sign * FIRST_SIZE, None
        while _simulated(_with(parameter, size), scene) is None and abs(size) > SMALLEST_SIZE:  # as of a restitution of nearly 1
            size *= 0.1
        for _ in range(ITERATIONS):
            caused = rows.index.to_series().map(_caused(scene, _with(parameter, size), dt).error)
            factors = (rows["value"] / caused).abs().replace([0.0, np.inf], np.nan).dropna()
            if lead is None and len(factors):
                near = factors[(factors / factors.median()).between(1.0 / NEAR, NEAR)]
                lead = uncertainty[near.index].idxmin() if len(near) else None
            size *= factors.get(lead, np.nan)
            if not abs(size) <= LARGEST_SIZE:
                break
        else:
            yield size


def _explained(
    scene: Scenario, fault: FaultModel, rows: list[dict[Hashable, Any]], undefined: Sequence[str], dt: float
) -> tuple[list[float], int] | None:
    """The relative widths of the failed asymptotic errors of a scene that a cause has, and how many of them could be compared.

    None if it has another error than one of those that it defines, or has one whose event does not occur.
    """
    fine = _caused(scene, fault, 0.5 * dt)
    if any(not np.isnan(fine.error(metric)) for metric in undefined):
        return None
    halves = [_caused(scene, fault, dt, start) for start in (0.0, 0.5)]  # of its samples: the last one before an impact is in one alone
    widths, compared = [], 0
    for row in rows:
        metric = row["metric"]
        caused = fine.error(metric)
        if np.isnan(caused):
            continue
        # With and without the cause, the sampling has an error, each half as large as that of a half.
        sampling = max(abs(caused - half.error(metric)) + abs(half.sampled(metric)) for half in halves)
        if row["cause"] != "rounding":  # whose interval has all that rounding may hide
            sampling += negligible(scene, row["unit"])
        lower = row["lower"] - sampling
        if not fine.is_whole:  # the largest error so far is a lower bound of the whole one
            lower, caused = (-np.inf, -np.inf if METRICS[metric].signed else caused)
        has_none = row["verdict"] == "failed" and abs(caused) <= sampling  # as it has of an error whose interval begins at 0
        if has_none or not lower <= caused <= row["upper"] + sampling:
            return None
        if row["verdict"] == "failed":
            compared += 1
            widths += [(row["upper"] - row["lower"]) / abs(row["value"])] * fine.is_whole
    return widths, compared


def _with(parameter: Parameter, size: float) -> FaultModel:
    """A parameter with an error as a fault."""
    return FaultModel(parameter.name, lambda scene: parameter.change(scene, size))


@lru_cache(maxsize=32)  # many faults of what is reported simulate the same scene
def _exact(scene: Scenario, step: float, count: int, start: float) -> Trajectory | None:
    """The exact solution at equally spaced times; None if it ends before the second one."""
    truth = truth_for(scene)
    motion = None if truth is None else exactly(truth, step * (start + np.arange(count, dtype=float)))
    return None if motion is None or len(motion) < 2 else motion


class _Caused(NamedTuple):
    """The errors that a cause has, by metric, those of sampling the exact solution, and whether the exact solution with it is as long."""

    error: Errors = lambda metric: np.nan
    sampled: Errors = lambda metric: np.nan
    is_whole: bool = False


def _simulated(fault: FaultModel, scene: Scenario) -> Scenario | None:
    """The scene that a fault simulates instead; None if its body is impossible."""
    try:
        return fault.simulated(scene)
    except (DropspinError, ValueError):
        return None


def _caused(scene: Scenario, fault: FaultModel, dt: float, start: float = 0.0) -> _Caused:
    """The errors that a cause has, sampled from a start within the first step; NaN without an exact solution."""
    step = max(dt, scene.duration / MOST_STEPS)
    count = (1 if start == 0.0 else 0) + scene.steps(step)
    simulated, reference = _simulated(fault, scene), _sampled(scene, step, count, start)
    motion = None if simulated is None else _exact(simulated, step, count, start)
    if reference is None or motion is None:
        return _Caused()
    exact, errors = reference
    common = min(len(motion), len(exact))
    sampled = errors.__getitem__ if common == len(exact) else _measured(scene, exact[:common], exact[:common])
    measured = _measured(scene, Trajectory.from_states(motion.t, fault.reported(motion.states))[:common], exact[:common])
    return _Caused(lambda metric: measured(metric) - sampled(metric), sampled, common == len(exact))


@lru_cache(maxsize=256)  # of each scene it is needed for every cause
def _sampled(scene: Scenario, step: float, count: int, start: float) -> tuple[Trajectory, Mapping[str, float]] | None:
    """The exact solution of a scene at each time step, and the errors that its sampling has."""
    exact = _exact(scene, step, count, start)
    if exact is None:
        return None
    measured = _measured(scene, exact, exact)
    return exact, {metric: measured(metric) for metric in METRICS}


def _measured(scene: Scenario, motion: Trajectory, exact: Trajectory) -> Errors:
    """Measures the errors that are asked for, NaN where a metric does not apply: most causes are excluded by the first ones."""
    truth = truth_for(scene)
    case = Comparison.with_truth(scene, motion, truth, exact)
    return lambda metric: METRICS[metric].value_or_nan([case]) if METRICS[metric].applies(scene, truth) else np.nan
