"""The matrix of a run, a row for each scene and a column for each engine: the scenes, the errors, the marks, and the time of the steps."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dropspin.comparisons.judging.verdicts import VERDICTS
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.tolerances import scale
from dropspin.comparisons.results.results import UNDECIDED, Results, Status
from dropspin.reports.stories.numbers import in_ms, quantity, short

MOST_SCENES = 24
"""Largest number of rows on a terminal. Of more scenes, those in which no engine has a finding are left out first, then those with the
least severe findings.
"""
WITHOUT_FINDING = frozenset({"passed", "measured", "declined", "no_truth"})

GLOSSARY = {
    "passed": "Every check is within its bound. Undecided: the time steps do not show whether each error vanishes as dt → 0.",
    "failed": "A check is outside its bound, or the engine diverged, crashed, timed out or is broken.",
    "known fault": "An error that the scene expects of this engine by name. Model error: it does not vanish as dt → 0.",
    "not judged": "Measured without a bound; or a limitation that the adapter reports explains the error (limited), the engine or its "
    "adapter cannot run the scene (declined), the engine is not installed (missing), or no reference is known.",
}
"""The outcomes that readers see, and what they mean for an engine in a scene: the worst over all metrics and time steps."""


@dataclass(frozen=True)
class Leading:
    """The errors of a scene in one metric at its finest time step.

    Attributes:
        metric: The metric, as chosen by `Results.leading_errors`.
        unit: Unit of the sizes: rad; % for ratios, and for positions, of which `of` has the length that is 100 %.
        of: Such as `of 0.1 m`; empty for angles and ratios.
        dt: Time step [s].
        sizes: The size of the error in this unit, as text by engine; of engines with a value.
        levels: The decade of the error relative to its scale, by engine, from 0 (up to 1e-8) over 1 (up to 1e-7) to 8 (above 0.1); None if
            undefined.
    """

    metric: str
    unit: str
    of: str
    dt: float
    sizes: dict[str, str]
    levels: dict[str, int | None]

    @property
    def title(self) -> str:
        """The quantity and its unit."""
        return f"{quantity(self.metric)}, {self.unit}{self.of and ' '}{self.of}"


def leading_errors(results: Results) -> dict[str, Leading]:
    """The leading error of each scene with an exact solution, by scene."""
    found = {}
    for name, of_scene in results.by_scene.items():
        finest = of_scene.leading_errors(name)
        if not finest.empty:
            metric, dt, values = str(finest["metric"].iloc[0]), float(finest["dt"].iloc[0]), finest["value"].abs()
            unit = METRICS[metric].unit
            whole = scale(results.scenes[name], unit)
            parts = {engine: float(values.get(engine, math.nan)) / whole for engine in results.engines}
            percent, of = 1.0 if unit == "rad" else 100.0, "" if unit in ("1", "rad") else f"of {whole:.2g} {unit}"
            sizes = {engine: short(percent * part) for engine, part in parts.items() if not math.isnan(part)}
            levels = {engine: level(part) for engine, part in parts.items()}
            found[name] = Leading(metric, "rad" if unit == "rad" else "%", of, dt, sizes, levels)
    return found


def matrix_of(results: Results, statuses: Mapping[str, Mapping[str, Status]]) -> tuple[list[dict[str, str]], list[str]]:
    """A row for each scene that a terminal shows, with the mark of the status and the leading error of each engine; and notes."""
    scenes, left_out = shown_scenes(statuses)
    leading, rows = leading_errors(results), []
    steps = sorted({in_ms(errors.dt) for errors in leading.values()})
    title = f"error at dt = {' or '.join(steps)}" if steps else "error"
    for scene in scenes:
        errors = leading.get(scene)
        sizes = errors.sizes if errors else {}
        values = {engine: f"{status.mark} {sizes.get(engine, '')}".rstrip() for engine, status in statuses[scene].items()}
        rows.append({"scene": scene, title: errors.title if errors else "", **values})
    return rows, list(filter(None, [legend_of_marks({scene: statuses[scene] for scene in scenes}), left_out]))


def legend_of_marks(statuses: Mapping[str, Mapping[str, Status]]) -> str:
    """What each mark stands for, in the order of `GLOSSARY`; one mark stands for all known faults."""
    shown = sorted({status for by_engine in statuses.values() for status in by_engine.values()}, key=lambda status: status.reason)

    def words(status: Status) -> str:
        if status.outcome == "not judged":
            return status.reason
        return status.outcome if status.verdict == "known" else status.words

    of_each = {outcome: [status for status in shown if status.outcome == outcome] for outcome in GLOSSARY}
    marks = {outcome: dict.fromkeys(f"{status.mark} {words(status)}" for status in alike) for outcome, alike in of_each.items()}
    heads = {"not judged": "not judged: "}
    return "; ".join(heads.get(outcome, "") + ", ".join(of_outcome) for outcome, of_outcome in marks.items() if of_outcome)


def shown_scenes(statuses: Mapping[str, Mapping[str, Status]]) -> tuple[list[str], str]:
    """The scenes that have a row on a terminal, and a sentence on the others."""
    if len(statuses) <= MOST_SCENES:
        return list(statuses), ""
    found = [
        scene
        for scene, by_engine in statuses.items()
        if any(status.verdict not in WITHOUT_FINDING or status.reason == UNDECIDED for status in by_engine.values())
    ]
    worst = sorted(found, key=lambda scene: min(VERDICTS.index(status.verdict) for status in statuses[scene].values()))[:MOST_SCENES]
    fine, more = len(statuses) - len(found), len(found) - len(worst)
    left_out = [f"{fine} in which no engine has a finding"] * bool(fine) + [f"{more} with less severe findings"] * bool(more)
    return [scene for scene in statuses if scene in worst], f"Scenes not shown: {', '.join(left_out)}."


def step_times(results: Results) -> dict[str, float]:
    """The time per step [s], by engine: the geometric mean over the scenes and time steps in which all engines were timed.

    Ratios of these times are therefore the geometric means of the ratios. NaN for an engine that was not timed, and for all if there are no
    scenes and time steps in which all engines were timed.
    """
    timed = results.table[results.table["time_per_step"] > 0.0].drop_duplicates(["scene", "engine", "dt"])
    times = timed.pivot(index=["scene", "dt"], columns="engine", values="time_per_step")
    means = np.exp(np.log(times.dropna()).mean())
    return {engine: float(means.get(engine, math.nan)) for engine in results.engines}


def level(error: float) -> int | None:
    """The decade of a relative error, from 0 (up to 1e-8) over 1 (up to 1e-7) to 8 (above 0.1)."""
    if math.isnan(error):
        return None
    if error > 0.1:  # it may be infinite
        return 8
    return 0 if error <= 1e-8 else min(8, 8 + math.ceil(math.log10(error) - 1e-9))
