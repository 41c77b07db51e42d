"""The search for a single wrong parameter with which the asymptotic errors of an engine are consistent.

The errors that a wrong parameter causes are the differences between the exact solutions of the scene with and without the change.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from comparisons.judging.convergence import JUMPING
from comparisons.measuring.comparison import Comparison, exactly
from comparisons.measuring.metrics import METRICS, metrics_for
from comparisons.measuring.tolerances import negligible
from comparisons.results.results import Results
from scenarios import DropspinError, Scenario, Trajectory, truth_for

Array = NDArray[np.float64]
Change = Callable[[Scenario, float], Scenario | None]
FIRST_SHARE = 1e-3
LARGEST_SHARE = 0.3
MOST_STEPS = 20_000
"""Largest number of time steps of the sampled exact solutions."""
ITERATIONS = 3
"""Number of iterations for the share; each reduces the relative error of the share by a factor of about the share."""


class WrongParameter(NamedTuple):
    """A parameter whose wrong value explains the errors.

    Attributes:
        name: Its name.
        share: The error of the parameter, relative to its value.
        signed: Whether the errors determine if it is too high or too low.
    """

    name: str
    share: float
    signed: bool


def wrong_parameters(results: Results, engine: str) -> list[WrongParameter]:
    """The parameters each of which alone explains all asymptotic errors of an engine in the scenes in which asymptotic errors fail.

    Each error must lie within its 95 % interval, widened by the error of sampling the exact solutions at the run's finest time step.
    """
    table = results.table
    mine = table[(table["engine"] == engine) & (table["kind"] == "asymptotic_error") & ~table["metric"].isin(JUMPING)]
    failed = mine[mine["verdict"] == "failed"]
    if failed.empty:
        return []
    rows = mine[mine["scene"].isin(failed["scene"]) & (mine["cause"] != "unresolved") & mine["lower"].notna()]
    widths = (failed["upper"] - failed["lower"]) / failed["value"].abs()
    lead = failed.to_dict("records")[int(widths.argmin())]
    signed, dt = METRICS[lead["metric"]].signed, min(map(float, results.provenance["asked"]["dts"]))
    scenes = [(results.scenes[str(scene)], some) for scene, some in rows.groupby("scene")]
    return [
        WrongParameter(name, share, signed)
        for name, change in _parameters().items()
        for share in _shares(results.scenes[lead["scene"]], change, lead, dt)
        if all(_explains(scene, change, share, some, dt) for scene, some in scenes)
    ]


def _shares(scene: Scenario, change: Change, lead: Mapping[Any, Any], dt: float) -> Iterator[float]:
    """The relative errors of a parameter that cause an error; for an error without a sign, one of each sign."""
    signs = (1.0,) if METRICS[lead["metric"]].signed else (1.0, -1.0)
    for sign in signs:
        share = sign * FIRST_SHARE
        for _ in range(ITERATIONS):
            caused = _caused(scene, change, share, dt).get(lead["metric"], 0.0)
            share *= lead["value"] / caused if caused else np.nan
            if not abs(share) <= LARGEST_SHARE:
                break
        else:
            yield share


def _explains(scene: Scenario, change: Change, share: float, rows: pd.DataFrame, dt: float) -> bool:
    """Whether a wrong parameter causes the asymptotic errors of a scene."""
    coarse, fine = (_caused(scene, change, share, step) for step in (dt, 0.5 * dt))
    for row in rows.to_dict("records"):
        caused = fine.get(row["metric"], np.nan)
        sampling = abs(caused - coarse.get(row["metric"], np.nan)) + negligible(scene, row["unit"])
        if not row["lower"] - sampling <= caused <= row["upper"] + sampling:
            return False
    return True


def _caused(scene: Scenario, change: Change, share: float, dt: float) -> dict[str, float]:
    """The errors that a wrong parameter causes, by metric; empty where the scene does not have the parameter, or no exact solution."""
    try:
        changed = change(scene, share)
        other = None if changed is None else truth_for(changed)
    except DropspinError:
        return {}
    reference = _sampled(scene, dt)
    if other is None or reference is None:
        return {}
    wrong = _measured(scene, exactly(other, _times(scene, dt)), reference.motion)
    return {name: value - reference.errors[name] for name, value in wrong.items()}


class _Sampled(NamedTuple):
    """The exact solution of a scene at each time step, and the errors that its sampling has."""

    motion: Trajectory
    errors: dict[str, float]


@lru_cache(maxsize=64)  # of each scene it is needed for every parameter
def _sampled(scene: Scenario, dt: float) -> _Sampled | None:
    truth = truth_for(scene)
    if truth is None:
        return None
    motion = exactly(truth, _times(scene, dt))
    return _Sampled(motion, _measured(scene, motion, motion))


def _measured(scene: Scenario, motion: Trajectory, exact: Trajectory) -> dict[str, float]:
    truth = truth_for(scene)
    case = Comparison.with_truth(scene, motion, truth, exact)
    return {metric.name: metric.value_or_nan([case]) for metric in metrics_for(scene, truth)}


def _times(scene: Scenario, dt: float) -> Array:
    step = max(dt, scene.duration / MOST_STEPS)
    return step * np.arange(1 + scene.steps(step), dtype=float)


def _parameters() -> dict[str, Change]:
    """Functions by name that change a parameter of a scene by a share of its value, or return None if the scene does not have it."""
    return {
        "restitution": _restitution,
        "Coulomb coefficient": _friction,
        "gravity": _gravity,
        "linear damping": lambda scene, share: _damping(scene, share, "linear"),
        "angular damping": lambda scene, share: _damping(scene, share, "angular"),
        **{f"moment of inertia about {name}": _moment(axis) for axis, name in enumerate("xyz")},
    }


def _restitution(scene: Scenario, share: float) -> Scenario | None:
    if scene.floor is None or not scene.floor.restitution:
        return None
    return scene.model_copy(update={"floor": scene.floor.model_copy(update={"restitution": (1.0 + share) * scene.floor.restitution})})


def _friction(scene: Scenario, share: float) -> Scenario | None:
    if scene.floor is None or isinstance(scene.floor.friction, str) or not scene.floor.friction:
        return None
    return scene.model_copy(update={"floor": scene.floor.model_copy(update={"friction": (1.0 + share) * scene.floor.friction})})


def _gravity(scene: Scenario, share: float) -> Scenario | None:
    if scene.gravity is None:
        return None
    acceleration = tuple(float(part) for part in (1.0 + share) * scene.acceleration)
    return scene.model_copy(update={"gravity": scene.gravity.model_copy(update={"acceleration": acceleration})})


def _damping(scene: Scenario, share: float, which: str) -> Scenario | None:
    if scene.damping is None or not getattr(scene.damping, which):
        return None
    return scene.model_copy(update={"damping": scene.damping.model_copy(update={which: (1.0 + share) * getattr(scene.damping, which)})})


def _moment(axis: int) -> Change:
    def change(scene: Scenario, share: float) -> Scenario | None:
        tensor = scene.body.inertia_tensor
        if np.count_nonzero(tensor - np.diag(np.diag(tensor))):
            return None
        moments = np.diag(tensor) * (1.0 + share * (np.arange(3) == axis))
        if 2.0 * moments.max() > moments.sum():  # no body has these moments
            return None
        body = type(scene.body)(**scene.body.model_dump() | {"inertia": tuple(map(float, moments))})
        return scene.model_copy(update={"body": body})

    return change
