"""What a record says: the digits of each engine, the releases in which results changed, and performance profiles.

A result changed if two successive releases that were measured differ by more than rounding (`tolerance`); equal hashes of the motions mean
that nothing changed. A record has one motion of each scene and no tolerances that were measured, so that a motion that multiplies rounding
errors, such as that of a body that rocks, may differ by more than that without a change of the engine.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparisons.engines.mujoco_versions import numbers_of
from comparisons.judging.convergence import ARTEFACTS, JUMPING
from comparisons.measuring.metrics import METRICS, leading_metric
from comparisons.measuring.tolerances import NEGLIGIBLE, scale, tolerance
from comparisons.record.store import OWN, Row, stored
from scenarios import DropspinError, Scenario, load
from scenarios.loading import names

MOST_DIGITS = 15.0
"""Digits of an error of 0: double precision has no more."""
SINGLE = frozenset({"mjx", "newton", "rapier", "sapien"})
"""The engines of the record in single precision: their adapters say so, but cannot be imported where the engine is not installed."""


@dataclass(frozen=True)
class Case:
    """One simulation of a release.

    Attributes:
        verdict: `measured`, or why there are no values.
        reason: The reason in words.
        trajectory: The hash of the motion; empty if there is none.
        values: The value of each metric.
    """

    verdict: str
    reason: str
    trajectory: str
    values: Mapping[str, float]


@dataclass(frozen=True)
class Release:
    """A release of an engine.

    Attributes:
        name: Its version.
        cases: The simulations, by label, scene and time step [s]; empty if it could not be measured.
        reason: Why it could not be measured.
        stamps: What else the results depend on: the adapter, and the versions of other packages.
        first: One of its rows, with machine and date.
    """

    name: str
    cases: Mapping[tuple[str, str, float], Case]
    reason: str
    stamps: frozenset[str]
    first: Row


@dataclass(frozen=True)
class Change:
    """A result that differs between two successive releases that were measured.

    Attributes:
        before, release: The two releases.
        label, scene, dt: What was simulated, and with which time step [s].
        metric: The metric; empty if one of the releases has no motion, or both lack it for different reasons.
        old, new: Its values; NaN without a metric.
        was, now: The cases.
        size: The change in tolerances; infinite without a metric.
    """

    before: str
    release: str
    label: str
    scene: str
    dt: float
    metric: str
    old: float
    new: float
    was: Case
    now: Case
    size: float


def read(folder: str | Path) -> dict[str, list[Release]]:
    """The releases of each engine that were measured here, oldest first; of several machines, those of the one with most releases.

    Rows of scenes that the catalogue defines differently today are left out.

    Raises:
        DropspinError: The folder has no release that was measured here, or a file is refused.
    """
    tables: dict[str, list[list[dict[str, Any]]]] = {}
    for path in sorted((Path(folder) / OWN).glob("*.parquet")):
        one = stored(path)
        tables.setdefault(one.engine, []).append(one.rows())
    if not tables:
        raise DropspinError(f"{folder}: has no release that was measured here; give a folder that dropspin record wrote.")
    found = {engine: _of_one_machine(own) for engine, own in tables.items()}
    if not any(release.cases for releases in found.values() for release in releases):
        raise DropspinError(f"{folder}: has no result of a scene as the catalogue defines it today; dropspin record measures them again.")
    return found


def _of_one_machine(tables: Sequence[list[dict[str, Any]]]) -> list[Release]:
    machines = [tuple(rows[0][name] for name in ("processor", "system", "python")) for rows in tables]
    [(most, _)] = Counter(machines).most_common(1)
    found = [_release(rows) for rows, machine in zip(tables, machines, strict=True) if machine == most]
    return sorted(found, key=lambda one: numbers_of(one.name))


def _release(rows: Sequence[Row]) -> Release:
    known = [row for row in rows if row["scene_digest"] == _digests().get(row["scene"])]
    by_case: dict[tuple[str, str, float], list[Row]] = {}
    for row in known:
        by_case.setdefault((row["label"], row["scene"], row["dt"]), []).append(row)
    cases = {
        key: Case(own[0]["verdict"], own[0]["reason"], own[0]["trajectory"], {row["metric"]: row["value"] for row in own if row["metric"]})
        for key, own in by_case.items()
    }
    name = rows[0]["release"]
    versions = (text for text in rows[0]["versions"].split(", ") if text and text.rpartition(" ")[2] != name)
    adapters = {f"adapter {row['adapter']}" for row in known}
    return Release(name, cases, "" if cases else rows[0]["reason"], frozenset([*versions, *adapters]), rows[0])


problem = cache(load)
"""A scene of the catalogue, by its name."""


@cache
def _digests() -> dict[str, str]:
    return {scene: problem(scene).digest for scene in names()}


@cache
def leading(scene: str) -> str:
    """The metric whose digits are shown for a scene."""
    return leading_metric(problem(scene))


def relative_error(case: Case | None, scene: str) -> float:
    """The size of the leading error of a scene over its scale; NaN if there is none."""
    metric = leading(scene)
    value = math.nan if case is None else case.values.get(metric, math.nan)
    return abs(value) / scale(problem(scene), METRICS[metric].unit)


def digits(error: float) -> float:
    """The number of correct digits of a result with a relative error: -log10 of the error, from 0 to `MOST_DIGITS`; NaN for NaN."""
    if math.isnan(error):
        return math.nan
    return min(MOST_DIGITS, max(0.0, -math.log10(error))) if error > 0.0 else MOST_DIGITS


def changes(engine: str, releases: Iterable[Release]) -> list[Change]:
    """The results that changed between releases, oldest release first; a release without a case is passed over."""
    precision = np.float32 if engine in SINGLE else np.float64
    found: list[Change] = []
    last: dict[tuple[str, str, float], tuple[str, Case]] = {}
    for release in releases:
        for key, now in release.cases.items():
            if key in last:
                before, was = last[key]
                for metric, old, new, size in _compared(was, now, problem(key[1]), key[2], precision):
                    found.append(Change(before, release.name, *key, metric, old, new, was, now, size))
            last[key] = release.name, now
    return found


def _compared(was: Case, now: Case, scene: Scenario, dt: float, precision: type) -> list[tuple[str, float, float, float]]:
    """For each metric that changed between two cases, largest change first: the metric, its values and the change in tolerances."""
    if was.verdict != now.verdict:
        return [("", math.nan, math.nan, math.inf)]
    if was.trajectory == now.trajectory:
        return []
    found = []
    for metric in was.values.keys() & now.values.keys() - ARTEFACTS - JUMPING:
        old, new, unit = was.values[metric], now.values[metric], METRICS[metric].unit
        # An error that is larger than its scale is rounded in proportion to itself.
        rounding = tolerance(scene, unit, precision, scene.steps(dt), 0.0) * max(1.0, abs(old) / scale(scene, unit))
        size = abs(new - old) / rounding
        if size > 1.0:
            found.append((metric, old, new, size))
    return sorted(found, key=lambda change: (-change[-1], change[0]))


def periods(label: str, releases: Sequence[Release], changed: Iterable[Change]) -> list[list[Release]]:
    """Successive releases between which no result of a label changed, oldest first; releases without the label are passed over."""
    moved = {change.release for change in changed if change.label == label}
    found: list[list[Release]] = []
    for release in releases:
        if not any(key[0] == label for key in release.cases):
            continue
        if release.name in moved or not found:
            found.append([])
        found[-1].append(release)
    return found


def profile(errors: Mapping[str, Sequence[float]]) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Performance profiles: for each engine, the share of scenes in which its error is at most τ times the smallest of all engines.

    Dolan & Moré (2002), "Benchmarking optimization software with performance profiles", Math. Program. 91, eq. (2.1) and (2.2), with the
    relative error as the measure. Errors below `NEGLIGIBLE` are rounding, and count as equal to it.

    Args:
        errors: The relative error of each engine in each scene; NaN where it has none, which counts as a ratio that no τ reaches.

    Returns:
        The ratios τ at which the share rises, and the share there, shape (n,) each; both begin with τ = 1.
    """
    table = np.maximum(np.array(list(errors.values())), NEGLIGIBLE)  # NaN stays NaN
    ratios = np.where(np.isnan(table), np.inf, table / np.nanmin(np.where(np.isnan(table), np.inf, table), axis=0))
    found = {}
    for label, own in zip(errors, ratios, strict=True):
        at = np.unique([1.0, *own[np.isfinite(own)]])
        found[label] = at, np.mean(own[None, :] <= at[:, None], axis=1)
    return found


def successive(releases: Sequence[Release]) -> dict[str, list[str]]:
    """For each release that was measured, what else differs from the measured one before it: the adapter and versions of packages."""
    usable = [one for one in releases if one.cases]
    return {later.name: sorted(earlier.stamps ^ later.stamps) for earlier, later in pairwise(usable)}
