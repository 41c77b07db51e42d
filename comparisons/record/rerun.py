"""Measure one cell of a record again, and compare its motions, bit for bit, and its values with those of the record."""

import math
from collections.abc import Mapping
from pathlib import Path
from threading import Event
from typing import NamedTuple

from dropspin.comparisons.engines.registry import parsed
from dropspin.comparisons.record.environments import measured
from dropspin.comparisons.record.findings import Case, Release, read, release_of, rounding
from dropspin.comparisons.record.plan import Plan
from dropspin.comparisons.record.store import BLANK, MACHINE, machine
from dropspin.comparisons.running.driving import Breakdown
from dropspin.scenarios import DropspinError
from dropspin.scenarios.errors import verify_known

NONE = Case("not measured", "", "", {})


class OtherValue(NamedTuple):
    """A value of a metric that differs although the motion is the same: as recorded, and as measured now (NaN if it no longer is)."""

    dt: float
    metric: str
    was: float
    now: float
    is_rounding: bool


class Again(NamedTuple):
    """A cell that was measured again.

    Attributes:
        scene: The scene.
        cases: By time step [s]: as recorded, and as measured now.
        differing: What the motions depend on and is not as in the record, by name: as recorded, and now.
    """

    scene: str
    cases: Mapping[float, tuple[Case, Case]]
    differing: Mapping[str, tuple[str, str]]

    @property
    def moved(self) -> list[float]:
        """The time steps [s] at which the motion or the verdict differs."""
        return [dt for dt, (was, now) in self.cases.items() if (was.verdict, was.trajectory) != (now.verdict, now.trajectory)]

    @property
    def other_values(self) -> list[OtherValue]:
        """The recorded values that differ in a bit where verdict and motion do not."""
        return [
            OtherValue(dt, metric, value, found, abs(found - value) <= rounding(self.scene, dt, metric, value))
            for dt, (was, now) in self.cases.items()
            if dt not in self.moved
            for metric, value in was.values.items()
            if repr(found := now.values.get(metric, math.nan)) != repr(value)
        ]

    @property
    def recomputed(self) -> list[OtherValue]:
        """Those of them that differ by more than rounding."""
        return [value for value in self.other_values if not value.is_rounding]


def rerun(folder: str | Path, plan: Plan, label: str, release: str, scene: str, *, time_limit: float) -> Again:
    """Install a release into an environment of its own, and simulate a scene at the time steps of the plan.

    Args:
        folder: The folder of the record.
        plan: The plan of the record.
        label: The engine with its options, as in the record.
        release: The release.
        scene: The scene.
        time_limit: Processor time that the engine may use for one simulation [s].

    Raises:
        DropspinError: The record has no such cell, or the release cannot be installed or run.
    """
    engine, _ = parsed(label)
    recorded = _recorded(folder, engine, label, release, scene)
    try:
        found = measured(plan.only(engine, label, scene), engine, release, time_limit, Event())
    except Breakdown as failure:
        raise DropspinError(f"{engine} {release}: {failure}.") from None
    common = {"engine": engine, "release": release, "versions": found["versions"]} | machine()
    now = release_of([{**BLANK, **row, **common} for row in found["rows"]])
    was, given = _surroundings(recorded), _surroundings(now)
    differing = {name: (was.get(name, "none"), given.get(name, "none")) for name in was | given if was.get(name) != given.get(name)}
    cases = {dt: case for (of, name, dt), case in recorded.cases.items() if (of, name) == (label, scene)}
    return Again(scene, {dt: (case, now.cases.get((label, scene, dt), NONE)) for dt, case in cases.items()}, differing)


def _recorded(folder: str | Path, engine: str, label: str, release: str, scene: str) -> Release:
    """The release in the record.

    Raises:
        DropspinError: The record has no such cell.
    """
    engines = read(folder)
    verify_known("engine of the record", [engine], engines)
    releases = {one.name: one for one in engines[engine]}
    verify_known(f"release of {engine} in the record", [release], releases)
    found = releases[release]
    if not found.cases:
        raise DropspinError(f"{engine} {release} has no results in the record: {found.reason}.")
    verify_known("engine with options in the record", [label], {of for of, _, _ in found.cases})
    verify_known(f"scene of {label} in the record", [scene], {name for of, name, _ in found.cases if of == label})
    return found


def _surroundings(release: Release) -> dict[str, str]:
    """What motions depend on beside the release, by name: the adapter, the versions of packages, and the machine."""
    stamps = dict(stamp.split(" ", 1) for stamp in release.stamps)
    return stamps | {name: release.first[name] for name in MACHINE}
