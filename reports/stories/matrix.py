"""The matrix of a run, a row for each scene and a column for each engine: the scenes, the errors, the marks, and the time of the steps."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from dropspin.comparisons.judging.verdicts import BREAKDOWNS, FAILURES, VERDICTS
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.tolerances import scale
from dropspin.comparisons.results.conclusion import WITHIN
from dropspin.comparisons.results.results import MODEL_ERROR, UNDECIDED, Results, Status
from dropspin.reports.stories.numbers import Row, bound, capitalized, in_ms, quantity, short, sized, with_unit
from dropspin.reports.stories.words import WORDS

MOST_SCENES = 18
"""Largest number of rows on a terminal. Of more scenes, those in which no engine has a finding are left out first, then those with the
least severe findings.
"""
WITHOUT_FINDING = frozenset({"passed", "measured", "declined", "no_truth"})

MEANINGS: dict[str, str] = WORDS["matrix"]["meanings"]
"""What each status of an engine in a scene means; the status is the worst over all metrics and time steps."""
CHOICE = "Error: one metric for a row, that of its largest fault, else the leading metric."
"""Which error a row of the matrix shows."""


class Leading(NamedTuple):
    """The errors of a scene in one metric at its finest time step.

    Attributes:
        metric: The metric, as chosen by `Results.leading_errors`.
        unit: Unit of the sizes: rad; % for ratios, and for positions, of which `of` has the length that is 100 %.
        of: Such as `of 0.1 m`; empty for angles and ratios.
        dt: Time step [s].
        sizes: The size of the error in this unit, as text by engine; of engines with a value; no small one of an engine that fails in
            others alone.
        bounds: The bounds of errors that pass though they are above 1 %, in this unit, as text by engine.
        levels: The decade of the error relative to its scale, by engine, from 0 (up to 1e-8) over 1 (up to 1e-7) to 8 (above 0.1); None if
            undefined, or not among the sizes.
    """

    metric: str
    unit: str
    of: str
    dt: float
    sizes: dict[str, str]
    bounds: dict[str, str]
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
            metric, dt = str(finest["metric"].iloc[0]), float(finest["dt"].iloc[0])
            failing = of_scene.table[of_scene.table["verdict"].isin(FAILURES)].groupby("engine")["metric"].agg(set)
            elsewhere = [engine for engine, metrics in failing.items() if metric not in metrics]
            unit, values = METRICS[metric].unit, finest["value"].abs()
            whole = scale(results.scenes[name], unit)
            values = values.mask(finest.index.isin(elsewhere) & (values <= WITHIN * whole))  # a small error beside a failure misleads
            parts = {engine: float(values.get(engine, math.nan)) / whole for engine in results.engines}
            percent, of = 1.0 if unit == "rad" else 100.0, "" if unit in ("1", "rad") else f"of {whole:.2g} {unit}"
            sizes = {engine: short(percent * part) for engine, part in parts.items() if not math.isnan(part)}
            large = finest[(finest["verdict"] == "passed") & (values > WITHIN * whole)]
            allowed = (large["upper"].where(large["value"] > 0.0, -large["lower"]) / whole).dropna()
            bounds = {str(engine): f"≤ {short(percent * part)}" for engine, part in allowed.items()}
            levels = {engine: level(part) for engine, part in parts.items()}
            found[name] = Leading(metric, "rad" if unit == "rad" else "%", of, dt, sizes, bounds, levels)
    return found


def matrix_of(statuses: Mapping[str, Mapping[str, Status]], leading: Mapping[str, Leading]) -> tuple[list[dict[str, str]], list[str]]:
    """A row for each scene that a terminal shows, with the mark of the status and the leading error of each engine; and notes."""
    rows, (scenes, left_out) = [], shown_scenes(statuses)
    steps = sorted({in_ms(errors.dt) for errors in leading.values()})
    title = f"error at dt = {' or '.join(steps)}" if steps else "error"
    for scene in scenes:
        errors = leading.get(scene)
        sizes = errors.sizes if errors else {}
        values = {engine: f"{status.mark} {sizes.get(engine, '')}".rstrip() for engine, status in statuses[scene].items()}
        rows.append({"scene": scene, title: errors.title if errors else "", **values})
    legend = legend_of_marks({scene: statuses[scene] for scene in scenes})
    return rows, list(filter(None, [*(f"{words}: {meaning}" for words, meaning in legend.items()), CHOICE, left_out]))


def legend_of_marks(statuses: Mapping[str, Mapping[str, Status]]) -> dict[str, str]:
    """What each status of a run means, by its mark and words, in the order of `MEANINGS`."""
    shown = {status.words: status.mark for by_engine in statuses.values() for status in by_engine.values()}
    if "known fault" in shown:  # whose line serves for the model errors, too
        shown.pop(f"known fault ({MODEL_ERROR})", None)
    return {f"{shown[words]} {words}": meaning for words, meaning in MEANINGS.items() if words in shown}


def explanations(results: Results, statuses: Mapping[str, Mapping[str, Status]]) -> dict[str, dict[str, str]]:
    """Why an engine has its status, by scene and engine: the error of the matrix with its bound, and the reason."""
    leading = {scene: of_scene.leading_errors(scene) for scene, of_scene in results.by_scene.items()}
    return {
        scene: {engine: _explanation(of_scene, leading[scene], engine, statuses[scene][engine]) for engine in results.engines}
        for scene, of_scene in results.by_scene.items()
    }


def _explanation(results: Results, errors: pd.DataFrame, engine: str, status: Status) -> str:
    mine = results.table[results.table["engine"] == engine]
    metric = str(errors["metric"].iloc[0]) if len(errors) else ""
    sentences = [_with_bound(metric, row) for row in errors[errors.index == engine].to_dict("records")]
    if status.words == "passed":
        trends = mine[(mine["kind"] == "asymptotic_error") & (mine["metric"] == metric)]
        sentences += ["every check of the scene is within its bound", *(f"as dt → 0: {reason}" for reason in trends["reason"])]
    else:
        decisive = mine[results.undecided[mine.index] if status.reason == UNDECIDED else mine["verdict"] == status.verdict]
        order = decisive["metric"].map({metric: 0, "": 2}).fillna(1)
        first = decisive.loc[order.sort_values(kind="stable").index[:1]].to_dict("records")
        reasons = [f"{quantity(row['metric'])}: {row['reason']}".removeprefix(": ") for row in first]
        sentences += [f"{status.words}: {MEANINGS[status.words]}", *filter(None, reasons)]
    return capitalized("; ".join(sentences))


def _with_bound(metric: str, row: Row) -> str:
    percent = row["unit"] == "1"
    allowed = bound(*(row[end] * (100.0 if percent else 1.0) for end in ("lower", "upper")))
    limits = f"bound {with_unit(allowed, '%' if percent else row['unit'])}" if allowed else "no bound at this time step"
    return f"{quantity(metric)} {sized(abs(row['value']), row['unit'])} at {in_ms(row['dt'])}, {limits}"


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
    declined = sum(all(status.verdict == "declined" for status in by_engine.values()) for by_engine in statuses.values())
    of_them = f", {declined} of them declined" if declined else ""
    left_out = [f"{fine} in which no engine has a finding{of_them}"] * bool(fine) + [f"{more} with less severe findings"] * bool(more)
    return [scene for scene in statuses if scene in worst], f"Scenes not shown: {', '.join(left_out)}."


def step_times(results: Results) -> dict[str, float]:
    """The time per step [s], by engine: the geometric mean over the scenes and time steps in which all engines were timed.

    Ratios of these times are therefore the geometric means of the ratios. An engine that was not timed or broke down in every scene has no
    time, and none has one if there are no scenes and time steps in which all others were timed and did not break down.
    """
    table = results.table[~results.table["verdict"].isin(BREAKDOWNS)]
    timed = table[table["time_per_step"] > 0.0].drop_duplicates(["scene", "engine", "dt"])
    times = timed.pivot(index=["scene", "dt"], columns="engine", values="time_per_step")
    means = np.exp(np.log(times.dropna()).mean())
    return {engine: float(means[engine]) for engine in results.engines if means.get(engine, 0.0) > 0.0}


def level(error: float) -> int | None:
    """The decade of a relative error, from 0 (up to 1e-8) over 1 (up to 1e-7) to 8 (above 0.1)."""
    if math.isnan(error):
        return None
    if error > 0.1:  # it may be infinite
        return 8
    return 0 if error <= 1e-8 else min(8, 8 + math.ceil(math.log10(error) - 1e-9))
