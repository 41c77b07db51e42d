"""What a run gives: the table, the trajectories, and where they come from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from comparisons.ensembles import Outcome
from comparisons.provenance import digest
from comparisons.verdicts import BREAKDOWNS, FAILURES
from scenarios import Scenario, Trajectory

COLUMNS = {
    "scene": "str",
    "engine": "str",
    "dt": "float64",
    "seed": "int64",
    "metric": "str",
    "value": "float64",
    "unit": "str",
    "kind": "str",
    "truth": "str",
    "lower": "float64",
    "upper": "float64",
    "verdict": "str",
    "cause": "str",
    "reason": "str",
    "time_per_step": "float64",
    "steps": "int64",
}
KEY = ["scene", "engine", "dt", "seed", "metric", "kind", "truth"]

TrajectoryKey = tuple[str, str, float]


@dataclass(frozen=True, eq=False)
class Results:
    """A run.

    Attributes:
        frame: One row per measurement; the columns of `COLUMNS`, dt and time_per_step in s.
        scenes: The scenes, by name, in the order they were run.
        engines: The engines' labels, in order.
        trajectories: By (scene, engine, dt): the scene as written, every step.
        ensembles: By (scene, engine, dt): what became of each start, where the scene has an ensemble.
        provenance: What was asked, versions, machine, settings per engine and scene.
        tolerances: For each row of the frame, how far its value may move before that says something (`comparisons.tolerances`), in the
            row's unit, shape (rows,); NaN where it is no figure to hold another against.
    """

    frame: pd.DataFrame
    scenes: Mapping[str, Scenario]
    engines: tuple[str, ...]
    trajectories: Mapping[TrajectoryKey, Trajectory]
    ensembles: Mapping[TrajectoryKey, Outcome] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    tolerances: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    @property
    def measurements(self) -> pd.DataFrame:
        """The rows that measure an engine against truth and conservation laws, at one step each."""
        return self.frame[self.frame["kind"].isin(["truth", "invariant"])]

    def lasting_errors(self, *causes: str) -> pd.DataFrame:
        """The rows of errors whose limit as the step goes to 0 is not 0, by their causes: `model`, `setting`."""
        return self.frame[(self.frame["kind"] == "model_error") & self.frame["cause"].isin(causes)]

    @property
    def breakdowns(self) -> "pd.Series[bool]":
        """For each row, whether an engine broke down, or is missing though it was named."""
        verdicts = self.frame["verdict"]
        return verdicts.isin(BREAKDOWNS) | ((verdicts == "missing") & self.frame["engine"].isin(self.provenance.get("named", [])))

    def exit_code(self) -> int:
        """0: nothing failed; 1: a verdict failed; 3: an engine broke down, or is missing though it was named."""
        return 3 if self.breakdowns.any() else int(self.frame["verdict"].isin(FAILURES).any())


def joined(parts: Sequence[Results], provenance: Mapping[str, Any]) -> Results:
    """One run of the runs of its scenes, in order; settings are collected in the provenance."""
    settings: dict[str, dict[str, Any]] = {}
    for part in parts:
        for engine, stamped in part.provenance["settings"].items():
            settings.setdefault(engine, {}).update(stamped)
    digests = {engine: digest(stamped) for engine, stamped in settings.items()}
    return Results(
        pd.concat([part.frame for part in parts], ignore_index=True),
        dict(item for part in parts for item in part.scenes.items()),
        parts[0].engines,
        dict(item for part in parts for item in part.trajectories.items()),
        dict(item for part in parts for item in part.ensembles.items()),
        {**provenance, "settings": settings, "settings_digests": digests},
        np.concatenate([part.tolerances for part in parts]),
    )


def as_frame(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Rows of results as a table with the columns and types of `COLUMNS`; what a row leaves out is empty."""
    blank = {"str": "", "float64": float("nan"), "int64": 0}
    filled = [{name: row.get(name, blank[kind]) for name, kind in COLUMNS.items()} for row in rows]
    return pd.DataFrame(filled, columns=list(COLUMNS)).astype(COLUMNS)
