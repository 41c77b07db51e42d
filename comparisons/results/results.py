"""A run: its table, its trajectories and its provenance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from comparisons.judging.verdicts import BREAKDOWNS, FAILURES
from comparisons.results.ensembles import EnsembleOutcome
from comparisons.results.provenance import digest
from scenarios import Scenario, Trajectory

TrajectoryKey = tuple[str, str, float]
NEGLIGIBLE = 1e-4
"""Errors below this (relative to the scene's scale, in m or in rad) are not mentioned in summaries and reports."""


@dataclass(frozen=True, eq=False)
class Results:
    """A run.

    Attributes:
        table: One row per measurement, with the columns of `Measurement`; dt and time_per_step in s.
        scenes: The scenes, by name, in the order they were run.
        engines: The engines' labels, in order.
        trajectories: By (scene, engine, dt): the motion from the scene's own start, every step.
        ensembles: By (scene, engine, dt): the results of each start, if the scene has an ensemble.
        provenance: The arguments of the run, versions, machine, settings per engine and scene.
    """

    table: pd.DataFrame
    scenes: Mapping[str, Scenario]
    engines: tuple[str, ...]
    trajectories: Mapping[TrajectoryKey, Trajectory]
    ensembles: Mapping[TrajectoryKey, EnsembleOutcome] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        counts = self.table["verdict"].value_counts()
        verdicts = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
        return f"<Results: scenes {', '.join(self.scenes)}; engines {', '.join(self.engines)}; {len(self.table)} measurements: {verdicts}>"

    def summary(self) -> str:
        """A line for each engine: how many checks passed and failed, how many runs broke down, and the scenes with model errors."""
        return "\n".join(self._summary_of(engine) for engine in self.engines)

    def _summary_of(self, engine: str) -> str:
        verdicts = self.table.loc[self.table["engine"] == engine, "verdict"]
        passed, failed = int((verdicts == "passed").sum()), int(verdicts.isin(FAILURES).sum())
        parts = [f"{passed} checks passed, {failed} failed"]
        parts += [
            f"{count} {verdict}"
            for verdict in ("known", "diverged", "crashed", "timed_out", "declined")
            if (count := int((verdicts == verdict).sum()))
        ]
        errors = self.asymptotic_errors("model")
        scenes = errors.loc[(errors["engine"] == engine) & (errors["value"].abs() > NEGLIGIBLE), "scene"].unique()
        if len(scenes):
            parts.append(f"model errors in {', '.join(scenes)}")
        return f"{engine}: {'; '.join(parts)}."

    @property
    def measurements(self) -> pd.DataFrame:
        """The rows that compare an engine with exact solutions and conservation laws, at one time step each."""
        return self.table[self.table["kind"].isin(["truth", "invariant"])]

    def asymptotic_errors(self, *causes: str) -> pd.DataFrame:
        """The rows of asymptotic errors with these causes, such as `model` or `setting`."""
        return self.table[(self.table["kind"] == "asymptotic_error") & self.table["cause"].isin(causes)]

    @property
    def breakdowns(self) -> "pd.Series[bool]":
        """For each row, whether an engine broke down, or is missing though it was named."""
        verdicts = self.table["verdict"]
        return verdicts.isin(BREAKDOWNS) | ((verdicts == "missing") & self.table["engine"].isin(self.provenance.get("named", [])))

    def exit_code(self) -> int:
        """0: nothing failed; 1: a verdict failed; 3: an engine broke down, or is missing though it was named."""
        return 3 if self.breakdowns.any() else int(self.table["verdict"].isin(FAILURES).any())


def joined(parts: Sequence[Results], provenance: Mapping[str, Any]) -> Results:
    """The runs of several scenes as one run, in order; their settings are collected in the provenance."""
    settings: dict[str, dict[str, Any]] = {}
    for part in parts:
        for engine, stamped in part.provenance["settings"].items():
            settings.setdefault(engine, {}).update(stamped)
    digests = {engine: digest(stamped) for engine, stamped in settings.items()}
    return Results(
        pd.concat([part.table for part in parts], ignore_index=True),
        dict(item for part in parts for item in part.scenes.items()),
        parts[0].engines,
        dict(item for part in parts for item in part.trajectories.items()),
        dict(item for part in parts for item in part.ensembles.items()),
        {**provenance, "settings": settings, "settings_digests": digests},
    )
