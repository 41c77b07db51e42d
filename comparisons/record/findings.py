"""What a record says: the digits of each engine, the releases in which results changed, and performance profiles.

A result changed if two successive releases that were measured differ by more than rounding (`tolerance`); equal hashes of the motions mean
that nothing changed. A record has one motion of each scene and no tolerances that were measured, so that a motion that multiplies rounding
errors, such as that of a body that rocks, may differ by more than that without a change of the engine.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dropspin.comparisons.engines.packages import numbers_of
from dropspin.comparisons.judging.convergence import ARTEFACTS, JUMPING
from dropspin.comparisons.measuring.metrics import METRICS, leading_metric
from dropspin.comparisons.measuring.tolerances import NEGLIGIBLE, scale, tolerance
from dropspin.comparisons.record.plan import load_plan
from dropspin.comparisons.record.store import MACHINE, NAME, OTHERS, OWN, Record, Row, machine, stored
from dropspin.scenarios import DropspinError, load
from dropspin.scenarios.loading import names
from dropspin.scenarios.state import Array

MOST_DIGITS = 15.0
"""Digits of an error of 0: double precision has no more."""


class Case(NamedTuple):
    """One engine in one scene at one time step.

    Attributes:
        verdict: `measured`, or why there are no values.
        reason: That in words.
        trajectory: The hash of the motion.
        values: The value of each metric.
        low, high: The least and the largest size of the leading error over start phases; NaN for a scene without.
        cost: The least wall time of the steps [s per simulated second].
        median_cost: The median of the repeated timings of it.
        relative_cost: The cost over that of a step of `wang` in free flight.
    """

    verdict: str
    reason: str
    trajectory: str
    values: Mapping[str, float]
    low: float = math.nan
    high: float = math.nan
    cost: float = math.nan
    median_cost: float = math.nan
    relative_cost: float = math.nan


class Release(NamedTuple):
    """A release: its cases by label, scene and time step [s]; without a case, the reason; and one of its rows, with machine and date.

    `stamps` is what else the results depend on: the adapter, and the versions of other packages.
    """

    name: str
    cases: Mapping[tuple[str, str, float], Case]
    reason: str
    stamps: frozenset[str]
    first: Row

    def at(self, label: str, dt: float) -> dict[str, Case]:
        """The cases of a label at a time step, by scene."""
        return {scene: case for (of, scene, step), case in self.cases.items() if (of, step) == (label, dt)}


class Change(NamedTuple):
    """A result that differs between two successive releases that were measured; `metric` is empty if only one has values."""

    before: str
    release: str
    label: str
    scene: str
    dt: float
    was: Case
    now: Case
    metric: str = ""
    old: float = math.nan
    new: float = math.nan


def read(folder: str | Path) -> dict[str, list[Release]]:
    """The releases of each engine that were measured here, oldest first; of several machines, those of the one with most releases.

    Rows of scenes that the catalogue defines differently today are left out.

    Raises:
        DropspinError: The folder has no release that was measured here, or a file is refused.
    """
    files = [stored(path)[1] for path in sorted((Path(folder) / OWN).glob("*.parquet"))]
    if not files:
        raise DropspinError(f"{folder}: has no release that was measured here; give a folder that dropspin record wrote.")
    found: dict[str, list[Release]] = {}
    for engine in dict.fromkeys(rows[0]["engine"] for rows in files):
        own = [rows for rows in files if rows[0]["engine"] == engine]
        machines = [tuple(rows[0][name] for name in MACHINE) for rows in own]
        [(most, _)] = Counter(machines).most_common(1)
        of_one_machine = [release_of(rows) for rows, machine in zip(own, machines, strict=True) if machine == most]
        found[engine] = sorted(of_one_machine, key=lambda release: numbers_of(release.name))
    if not any(release.cases for releases in found.values() for release in releases):
        raise DropspinError(f"{folder}: has no result of a scene as the catalogue defines it today; dropspin record measures them again.")
    return found


def on_other_machines(folder: str | Path, shown: Mapping[str, Sequence[Release]]) -> dict[str, list[str]]:
    """The releases of each engine that were measured here on other machines alone than those that `read` returned."""
    found: dict[str, list[str]] = {}
    for path in sorted((Path(folder) / OWN).glob("*.parquet")):
        named = NAME.fullmatch(path.name)
        assert named is not None  # or `read` refuses the file
        if named[2] not in {release.name for release in shown[named[1]]}:
            found.setdefault(named[1], []).append(named[2])
    return found


def in_order(record: Record, engine: str, names: Iterable[str]) -> list[Release]:
    """The releases of an engine that this machine measured, in the order of their names."""
    here = machine()
    files = [rows for name in names for _, rows in record.own(engine, name)]
    return [release_of(rows) for rows in files if all(rows[0][name] == here[name] for name in MACHINE)]


class Other(NamedTuple):
    """A release that somebody else measured; the record cannot verify its results.

    Attributes:
        name: The release.
        first: One of its rows, with machine and date.
        common: The number of simulations that were measured here too.
        same: The number of these whose motion is the same, bit for bit.
    """

    name: str
    first: Row
    common: int
    same: int


def others(folder: str | Path, own: Mapping[str, Sequence[Release]]) -> dict[str, list[Other]]:
    """What others measured of each engine, oldest release first, compared with what was measured here.

    Raises:
        DropspinError: A file is refused.
    """
    found: dict[str, list[Other]] = {}
    for path in sorted((Path(folder) / OTHERS).glob("*.parquet")):
        _, rows = stored(path)
        engine, sent = rows[0]["engine"], release_of(rows)
        here = next((release.cases for release in own.get(engine, ()) if release.name == sent.name), {})
        pairs = [(case, here[key]) for key, case in sent.cases.items() if key in here]
        same = sum((case.verdict, case.trajectory) == (mine.verdict, mine.trajectory) for case, mine in pairs)
        found.setdefault(engine, []).append(Other(sent.name, sent.first, len(pairs), same))
    return {engine: sorted(sent, key=lambda other: numbers_of(other.name)) for engine, sent in found.items()}


def release_of(rows: Sequence[Row]) -> Release:
    """A release of which there are rows; those of scenes that the catalogue defines differently today are left out."""
    known = [row for row in rows if row["scene_digest"] == _digests().get(row["scene"])]
    by_case: dict[tuple[str, str, float], list[Row]] = {}
    for row in known:
        by_case.setdefault((row["label"], row["scene"], row["dt"]), []).append(row)
    cases = {key: _case(own) for key, own in by_case.items()}
    name = rows[0]["release"]
    versions = (text for text in rows[0]["versions"].split(", ") if text and text.rpartition(" ")[2] != name)
    adapters = {f"adapter {row['adapter']}" for row in known}
    return Release(name, cases, "" if cases else rows[0]["reason"], frozenset([*versions, *adapters]), rows[0])


def _case(rows: Sequence[Row]) -> Case:
    """The rows of one simulation; the range over start phases is in that of the leading error."""
    first = rows[0]
    values = {row["metric"]: row["value"] for row in rows if row["metric"]}
    banded = next((row for row in rows if not math.isnan(row["low"])), first)
    same = {name: first[name] for name in ("verdict", "reason", "trajectory", "cost", "median_cost", "relative_cost")}
    return Case(**same, values=values, low=banded["low"], high=banded["high"])


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
    return abs(case.values.get(metric, math.nan) if case else math.nan) / scale(problem(scene), METRICS[metric].unit)


def digits(error: float) -> float:
    """The number of correct digits of a result with a relative error: -log10 of the error, from 0 to `MOST_DIGITS`; NaN for NaN."""
    if math.isnan(error):
        return math.nan
    return min(MOST_DIGITS, max(0.0, -math.log10(error))) if error > 0.0 else MOST_DIGITS


def changes(engine: str, releases: Iterable[Release]) -> list[Change]:
    """The results that changed between releases, oldest release first; a release without a case is passed over."""
    of_plan = load_plan().engines.get(engine)
    precision = np.float32 if of_plan is not None and of_plan.single_precision else np.float64
    found: list[Change] = []
    last: dict[tuple[str, str, float], tuple[str, Case]] = {}
    for release in releases:
        for key, now in release.cases.items():
            if key in last:
                before, was = last[key]
                change = Change(before, release.name, *key, was, now)
                if was.verdict != now.verdict:
                    found.append(change)
                elif was.trajectory != now.trajectory:
                    found += [change._replace(metric=one, old=was.values[one], new=now.values[one]) for one in _moved(change, precision)]
            last[key] = release.name, now
    return found


def _moved(change: Change, precision: type) -> list[str]:
    """The metrics that differ by more than rounding, the largest difference first."""
    old, new = change.was.values, change.now.values
    sizes = {
        metric: abs(new[metric] - old[metric]) / rounding(change.scene, change.dt, metric, old[metric], precision)
        for metric in old.keys() & new.keys() - ARTEFACTS - JUMPING
    }
    return sorted((metric for metric, size in sizes.items() if size > 1.0), key=lambda metric: (-sizes[metric], metric))


def rounding(name: str, dt: float, metric: str, value: float, precision: type = np.float64) -> float:
    """By how much rounding may change a value of a metric; an error that is larger than its scale is rounded in proportion to itself."""
    scene, unit = problem(name), METRICS[metric].unit
    return tolerance(scene, unit, precision, scene.steps(dt), 0.0) * max(1.0, abs(value) / scale(scene, unit))


def periods(label: str, releases: Sequence[Release], changed: Iterable[Change]) -> list[list[Release]]:
    """Successive releases between which no result of a label changed, oldest first; releases without the label are passed over."""
    moved = {change.release for change in changed if change.label == label}
    found: list[list[Release]] = []
    for release in releases:
        if any(key[0] == label for key in release.cases):
            if release.name in moved or not found:
                found.append([])
            found[-1].append(release)
    return found


def profile(errors: Mapping[str, Sequence[float]]) -> dict[str, tuple[Array, Array]]:
    """Performance profiles: for each engine, the share of scenes in which its error is at most τ times the smallest of all engines.

    Dolan & Moré (2002), "Benchmarking optimization software with performance profiles", Math. Program. 91, eq. (2.1) and (2.2), with the
    relative error as the measure. Errors below `NEGLIGIBLE` are rounding, and count as equal to it.

    Args:
        errors: The relative error of each engine in each scene; infinite where it failed, which counts as a ratio that no τ reaches; NaN
            where it was not measured. Such a scene does not count for the engine.

    Returns:
        The ratios τ at which the share rises, and the share there, shape (n,) each; both begin with τ = 1. Engines that were measured in no
        scene are left out.
    """
    table = np.maximum(np.array(list(errors.values())), NEGLIGIBLE)  # NaN stays NaN
    least = np.min(np.nan_to_num(table, nan=np.inf, posinf=np.inf), axis=0)
    all_ratios = np.divide(table, least, out=table.copy(), where=np.isfinite(table))  # infinite and NaN stay so
    profiles = {}
    for label, row in zip(errors, all_ratios, strict=True):
        ratios = row[~np.isnan(row)]
        if len(ratios):
            at = np.unique([1.0, *ratios[np.isfinite(ratios)]])
            profiles[label] = at, np.mean(ratios[None, :] <= at[:, None], axis=1)
    return profiles


def successive(releases: Sequence[Release]) -> dict[str, list[str]]:
    """For each release but the first, what else differs from the one before it: the adapter and versions of packages."""
    return {later.name: sorted(earlier.stamps ^ later.stamps) for earlier, later in pairwise(releases)}
