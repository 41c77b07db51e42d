"""A run: its table, its trajectories and its provenance."""

import html
from collections import ChainMap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from dropspin.comparisons.judging.convergence import ARTEFACTS, JUMPING, STUDIES
from dropspin.comparisons.judging.verdicts import BREAKDOWNS, FAILURES, MARKS, OUTCOMES, VERDICTS, Outcome, with_reason
from dropspin.comparisons.measuring.metrics import leading_metric
from dropspin.comparisons.measuring.tolerances import NEGLIGIBLE, scale
from dropspin.comparisons.results.ensembles import EnsembleOutcome
from dropspin.comparisons.results.provenance import digest
from dropspin.comparisons.results.table import are_among, empty_table
from dropspin.scenarios import Scenario, Trajectory, reference_for
from dropspin.scenarios.errors import verify_known
from dropspin.scenarios.state import Array

TrajectoryKey = tuple[str, str, float]
FRAMES = ("table", "predictions", "agreements")
"""The tables of a run."""
RISEN = 0.01
"""An error that rises above this from one time step to a finer one, in its unit, leaves the trend undecided."""
SMALLEST_STATED = 1e-4
"""Errors below this, in their units (SI, or ratios), are neither mentioned in summaries and reports nor undecided."""

PARTS = ("angular_momentum_direction_error",)
"""Metrics that another metric contains."""
UNDECIDED, MODEL_ERROR = "trend undecided", "model error"
"""Reasons of a status that the verdict does not have: the time steps leave errors undecided; a known fault does not vanish as dt → 0."""
COUNTED = ("known", "diverged", "crashed", "timed_out", "declined")
"""Verdicts that a title counts beside passed and failed checks."""
MOST_NAMES = 4
"""Scenes or engines that a title names; of more it has the number."""
MOST_ROWS = 60
"""Scenes that a notebook shows; of more it shows the first and the last."""


class Status(NamedTuple):
    """The status of an engine in a scene: its worst verdict, and the reason of its outcome."""

    verdict: str
    reason: str

    @property
    def outcome(self) -> Outcome:
        """The outcome that reports show for the verdict, such as `not judged`."""
        return OUTCOMES[self.verdict][0]

    @property
    def words(self) -> str:
        """The outcome with its reason, such as `passed` or `not judged (declined)`."""
        return with_reason(self.outcome, self.reason)

    @property
    def mark(self) -> str:
        """The status as one character."""
        return "~" if self.reason == UNDECIDED else MARKS[self.verdict]


@dataclass(frozen=True, eq=False)
class Results:
    """The results of a run.

    Attributes:
        table: One row per measurement, with the columns of `Measurement`. A row without a metric has the outcome of an engine that has no
            motion, or a remark.
        scenes: The scenes, by name, in the order they were run.
        engines: The engines' labels, in order.
        trajectories: For each key (scene, engine, dt), the motion from the initial state of the scene, with every time step.
        ensembles: For each key (scene, engine, dt), the results of each initial state, if the scene has an ensemble.
        provenance: The arguments of the run, the versions, the machine, the settings of each engine in each scene, and the hashes of the
            motions.
        predictions: The errors that theory predicts, with the same columns as `table`; only few scenes and methods have a prediction.
        agreements: The differences between each two engines, with the same columns as `table`; `truth` has the label of the other engine.
    """

    table: pd.DataFrame
    scenes: Mapping[str, Scenario]
    engines: tuple[str, ...]
    trajectories: Mapping[TrajectoryKey, Trajectory]
    ensembles: Mapping[TrajectoryKey, EnsembleOutcome] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    predictions: pd.DataFrame = field(default_factory=empty_table)
    agreements: pd.DataFrame = field(default_factory=empty_table)

    @cached_property
    def by_scene(self) -> Mapping[str, "Results"]:
        """The run of each scene alone, by name, with text columns as Python objects, from which pandas selects rows faster.

        Without this separation, selecting the rows of each scene from the whole table would take most of the time of a report.
        """
        texts: dict[str, Any] = dict.fromkeys(self.table.select_dtypes("str"), object)
        frames = {name: getattr(self, name).astype(texts) for name in FRAMES}
        rows = {name: dict(iter(frame.groupby("scene"))) for name, frame in frames.items()}
        parts = {
            scene: replace(self, scenes={scene: self.scenes[scene]}, **{name: rows[name].get(scene, frames[name][:0]) for name in FRAMES})
            for scene in self.scenes
        }
        for part in parts.values():
            vars(part)["undecided"] = self.undecided[part.table.index]
        return parts

    @cached_property
    def undecided(self) -> "pd.Series[bool]":
        """For each row of `table`, whether `is_undecided` holds."""
        return is_undecided(self.table)

    def __repr__(self) -> str:
        return f"<Results: {self._title}>"

    def _repr_html_(self) -> str:
        """For notebooks: the status of each engine in each scene, and its leading error."""
        statuses, rows = self.statuses(), []
        for scene in self.scenes:
            errors = self.leading_errors(scene)
            first = errors.iloc[0] if len(errors) else None
            unit = "" if first is None or first["unit"] == "1" else f" {first['unit']}"
            sizes = {engine: f", {size:.2g}{unit}" for engine, size in errors["value"].abs().items()}
            cells = {engine: f"{statuses[scene][engine].words}{sizes.get(engine, '')}" for engine in self.engines}
            rows.append({"leading error": "–" if first is None else first["metric"].replace("_", " ")} | cells)
        table = pd.DataFrame(rows, index=list(self.scenes))
        return f"<p>{html.escape(self._title)}</p>{table.to_html(max_rows=MOST_ROWS)}"

    @property
    def _title(self) -> str:
        """Scenes, engines, time steps and verdicts in a line."""
        scenes, engines = (
            ", ".join(names) if len(names) <= MOST_NAMES else f"{len(names)} {kind}"
            for names, kind in ((self.scenes, "scenes"), (self.engines, "engines"))
        )
        steps = ", ".join(f"{1e3 * dt:.3g}" for dt in sorted(self.table["dt"].dropna().unique(), reverse=True))
        counts = self.table["verdict"].value_counts()
        others = [f"{counts[one]} {one.replace('_', ' ')}" for one in COUNTED if one in counts]
        checks = f"{counts.get('passed', 0)} checks passed, {sum(counts.get(one, 0) for one in FAILURES)} failed"
        return f"{scenes} with {engines} at dt = {steps} ms: {'; '.join([checks, *others])}"

    def statuses(self) -> dict[str, dict[str, Status]]:
        """The status of each engine in each scene.

        Returns:
            For each scene and engine, the worst verdict and its reason.
        """
        table, verdicts = self.table, self.table["verdict"]
        is_small = (verdicts == "known") & ~(table["value"].abs() > SMALLEST_STATED)
        explains_nothing = (verdicts == "limited") & (table["metric"] == "")
        # Beside a recording, errors pass by expectations alone: no engine converges to it.
        recorded = table["scene"].isin(self.recorded)
        is_law = recorded & (verdicts == "passed") & table["kind"].isin(STUDIES)
        of_rows = {
            "severity": verdicts.map(VERDICTS.index).where(~(is_small | explains_nothing | is_law)),
            "of_model": (verdicts == "known") & (table["cause"] == "model"),
            "undecided": self.undecided & ~table["metric"].isin(JUMPING) & ~recorded,
        }
        by_pair = table[["scene", "engine"]].assign(**of_rows).groupby(["scene", "engine"])
        found = {
            (str(scene), str(engine)): _status(VERDICTS[int(severity)], *flags)
            for (scene, engine), severity, *flags in by_pair.agg({"severity": "min"} | dict.fromkeys(list(of_rows)[1:], "any")).itertuples()
        }
        absent = _status("missing")
        return {scene: {engine: found.get((scene, engine), absent) for engine in self.engines} for scene in self.scenes}

    def leading_errors(self, scene: str) -> pd.DataFrame:
        """The errors of all engines in one metric of a scene, at the finest time step.

        If checks fail, or errors are known faults or limitations, the metric is that of the largest of these errors, relative to its scale.
        Otherwise it is the metric by which the scene is summarised: bounce height if it applies, else orientation if the body rotates,
        else position.

        Args:
            scene: Name of the scene.

        Returns:
            The columns of `table`, with the engine as index; empty if the scene has no reference or no engine has a motion.

        Raises:
            UnknownName: The run has no such scene.
        """
        verify_known("scene", [scene], self.scenes)
        if reference_for(self.scenes[scene]) is None:
            return self.measurements.iloc[:0].set_index("engine")
        found = self.measurements
        mine = found[(found["scene"] == scene) & found["value"].notna()]
        metric = self._metric_of_findings(mine[mine["dt"] == mine["dt"].min()]) or leading_metric(self.scenes[scene])
        shown = mine[mine["metric"] == metric]
        return shown[shown["dt"] == shown["dt"].min()].set_index("engine")

    def _metric_of_findings(self, rows: pd.DataFrame) -> str:
        """The metric of the largest error, relative to its scale, among those that set a status; empty if there is none.

        An error that fails at another time step, or as dt → 0 alone, is one of them, however small it is.
        """
        failed = are_among(rows, self.table[self.table["verdict"].isin(FAILURES)], ["scene", "engine", "metric"])
        findings = rows[failed | (rows["verdict"].isin(["known", "limited"]) & (rows["value"].abs() > SMALLEST_STATED))]
        findings = findings[~findings["metric"].isin([*JUMPING, *ARTEFACTS, *PARTS])]
        if findings.empty:
            return ""
        return str(findings["metric"].iloc[int(np.argmax(relative_sizes(findings, self.scenes)))])

    @property
    def recorded(self) -> list[str]:
        """The scenes that are compared with a recording."""
        return [name for name, scene in self.scenes.items() if scene.recording is not None]

    def not_repeated(self, engine: str) -> list[str]:
        """The scenes in which an engine does not repeat its own motion."""
        rows = self.table[(self.table["engine"] == engine) & (self.table["basis"] == "not_repeated")]
        return list(rows["scene"].unique())

    @property
    def measurements(self) -> pd.DataFrame:
        """The rows that compare an engine at a single time step with an exact solution, a recording or a conservation law."""
        return self.table[self.table["kind"].isin(["truth", "invariant"])]

    def asymptotic_errors(self, *causes: str) -> pd.DataFrame:
        """The rows of the asymptotic errors that have one of the given causes.

        Args:
            causes: The causes, such as `model` or `setting`.
        """
        return self.table[(self.table["kind"] == "asymptotic_error") & self.table["cause"].isin(causes)]

    @property
    def breakdowns(self) -> "pd.Series[bool]":
        """For each row of `table`, whether the engine crashed, timed out or diverged, or was requested by name and is not installed."""
        verdicts = self.table["verdict"]
        return verdicts.isin(BREAKDOWNS) | ((verdicts == "missing") & self.table["engine"].isin(self.provenance.get("named", [])))

    @property
    def is_quick(self) -> bool:
        """Whether the run was made with `quick`, so that it cannot be compared with other runs; False for files without this entry."""
        return bool(self.provenance["asked"].get("quick"))

    def exit_code(self) -> int:
        """0: nothing failed; 1: a check failed; 3: an engine broke down, or was requested by name and is not installed."""
        return 3 if self.breakdowns.any() else int(self.table["verdict"].isin(FAILURES).any())


def relative_sizes(rows: pd.DataFrame, scenes: Mapping[str, Scenario]) -> Array:
    """The absolute values of rows, relative to the scales of their scenes."""
    columns = zip(rows["value"].abs(), rows["scene"], rows["unit"], strict=True)
    return np.array([value / scale(scenes[scene], unit) for value, scene, unit in columns])


def is_undecided(rows: pd.DataFrame) -> "pd.Series[bool]":
    """Which rows are asymptotic errors whose interval contains 0 and values that are not negligible, or is unknown: no cause is stated.

    An error within rounding at the finest time step is not undecided, unless it rises from one time step to a finer one, to more than 0.01.
    """
    of, reach = ["scene", "engine", "metric"], rows[["lower", "upper"]].abs().max(axis=1)
    errors = rows[rows["kind"].isin(["truth", "invariant"])].sort_values("dt", ascending=False)
    errors = errors.assign(size=errors["value"].abs().where(lambda size: ~(size <= NEGLIGIBLE), 0.0))
    errors["rises"] = (errors["size"] > RISEN) & (errors["size"] > errors.groupby(of)["size"].shift())
    rises, finest = errors.groupby(of)["rises"].any(), errors.drop_duplicates(of, keep="last").set_index(of)["size"]
    rounded = finest.index[(finest == 0.0) & ~rises.reindex(finest.index)]
    is_open = (rows["kind"] == "asymptotic_error") & (rows["cause"] == "unresolved") & ~(reach <= SMALLEST_STATED)
    return is_open & ~pd.MultiIndex.from_frame(rows[of]).isin(rounded)


def _status(worst: str, of_model: bool = False, undecided: bool = False) -> Status:
    """The status of an engine in a scene.

    Args:
        worst: Its worst verdict.
        of_model: Whether a known error is a model error.
        undecided: Whether the time steps leave an asymptotic error undecided.
    """
    if worst == "known" and of_model:
        return Status(worst, MODEL_ERROR)
    return Status(worst, UNDECIDED if undecided and worst in ("passed", "measured") else OUTCOMES[worst][1])


def joined(parts: Sequence[Results], provenance: Mapping[str, Any]) -> Results:
    """The runs of several scenes as one run, in order; their settings and motions are collected in the provenance."""
    settings: dict[str, dict[str, Any]] = {}
    motions: dict[str, Any] = {}
    for part in parts:
        motions |= part.provenance["motions"]
        for engine, stamped in part.provenance["settings"].items():
            settings.setdefault(engine, {}).update(stamped)
    digests = {engine: digest(stamped) for engine, stamped in settings.items()}
    stamp = {**provenance, "settings": settings, "settings_digests": digests, "motions": motions}
    mappings = ("scenes", "trajectories", "ensembles")
    united: dict[str, Any] = {name: dict(ChainMap(*(getattr(part, name) for part in reversed(parts)))) for name in mappings}
    united |= {name: pd.concat([getattr(part, name) for part in parts], ignore_index=True) for name in FRAMES}
    return Results(engines=parts[0].engines, provenance=stamp, **united)
