"""What a run says about its engines: which one keeps a quantity within a tolerance, at which time steps, and in which scenes not."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from dropspin.comparisons.judging.convergence import JUMPING
from dropspin.comparisons.judging.verdicts import BREAKDOWNS, FAILURES
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.results.results import Results, relative_sizes
from dropspin.comparisons.results.table import are_among
from dropspin.scenarios import Scenario
from dropspin.scenarios.truths import exact_solution

WITHIN = 0.01
"""The share of its scale that an error may have, unless another one is asked for."""
QUESTIONS = ("orientation_error", "bounce_height_error", "energy_error", "angular_momentum_error", "position_error")
"""The metrics that a conclusion may be about, those that are named first where there are many."""
ENOUGH = 3
"""Scenes that must test a question before an engine is recommended for it."""


@dataclass(frozen=True)
class Answer:
    """What a run says about one engine and one metric.

    Its scenes are those in which any engine has an error in this metric, or has none because it fails or broke down at each time step, and
    those in which the metric applies and every engine broke down.

    Attributes:
        metric: The metric.
        engine: The engine's label.
        scenes: The number of scenes that test the metric.
        within: The scenes in which the error is within the tolerance, at `dt` and at each smaller time step that was tried.
        beyond: The scenes in which it is not at the finest time step, or will not be as dt → 0, or in which the engine broke down there.
        undecided: The scenes in which the error at the finest time step is as near to the tolerance as its own uncertainty.
        dt: The largest time step [s] at which it is within the tolerance in each scene of `within`; NaN if there is no such scene.
        steps: The time steps [s] that were tried in each scene of `within`, smallest first.
        condition: What at least two scenes of `beyond`, and none of the others, have: of `CONDITIONS` the one that most have; or empty.
        named: The scenes of `beyond` that do not have it.
        declined: The number of scenes that the engine or its adapter declines.
        largest: The largest error of `beyond` at the finest time step, or as dt → 0, relative to its scale; NaN without one, or after a
            breakdown.
        worst: The scene with this error; or empty.
        cost: Median of the computing time per simulated second, at `dt`; NaN if it was not measured.
    """

    metric: str
    engine: str
    scenes: int
    within: tuple[str, ...]
    beyond: tuple[str, ...]
    undecided: tuple[str, ...]
    dt: float
    steps: tuple[float, ...]
    condition: str
    named: tuple[str, ...]
    declined: int
    largest: float
    worst: str
    cost: float

    @property
    def is_recommended(self) -> bool:
        """Whether it is within the tolerance in enough scenes, and in most of those that test it."""
        return not math.isnan(self.dt) and len(self.within) >= ENOUGH and len(self.within) > len(self.beyond) + len(self.undecided)


CONDITIONS: Mapping[str, Callable[[Scenario], bool]] = {
    "Coulomb friction": lambda scene: any(0.0 < surface.coefficient < np.inf for surface in scene.surfaces),
    "a floor": lambda scene: scene.floor is not None,
    "a body that is not a ball, dropped on a floor": lambda scene: scene.body.shape != "sphere" and scene.starts_above_floor,
    "a body that spins at the start": lambda scene: any(scene.start.angular_velocity),
    "damping": lambda scene: scene.damping is not None,
}
"""Properties that the scenes in which an engine errs may have in common."""


def conclude(results: Results, within: float = WITHIN) -> list[Answer]:
    """The answers of a run, for each metric of `QUESTIONS` that it has and each engine that was tried in one of its scenes.

    An error is within the tolerance if its size plus its uncertainty, the column `tolerance`, is; it is beyond if its size minus that
    uncertainty is. Where the engine is in another flight than the exact solution at every time step, an error that is compared up to then
    is undecided. A time step at which the engine broke down is beyond. Scenes that are compared with a recording do not count.

    Args:
        results: The run.
        within: The tolerance: the largest error relative to its scale, which is 1 for ratios and radians, and the lengths of the scene for
            positions.
    """
    table = results.table
    is_broken = table["verdict"].isin(BREAKDOWNS)
    tried = table[table["dt"].notna() & (table["kind"].isin(["truth", "invariant"]) | is_broken)]
    is_exact = (table["kind"] == "truth") & ~table["scene"].isin(results.recorded)
    errors = table[is_exact & table["metric"].isin(QUESTIONS)]
    sizes = relative_sizes(errors, results.scenes)
    uncertain = relative_sizes(errors.assign(value=errors["tolerance"].fillna(0.0)), results.scenes)
    states = np.select([sizes + uncertain <= within, sizes - uncertain > within], ["within", "beyond"], "undecided")
    lost = table[table["metric"].isin(JUMPING) & (table["kind"] == "asymptotic_error") & (table["verdict"] == "failed")]
    is_lost = are_among(errors, lost, ["scene", "engine"]) & (errors["metric"] != "position_error")
    states = np.where(is_lost & (states == "within"), "undecided", states)
    found = errors.assign(size=sizes, state=states, cost=errors["time_per_step"] / errors["dt"])
    remains = results.asymptotic_errors("model", "setting")
    remains = remains[~remains["scene"].isin(results.recorded)]
    least = remains.assign(value=remains[["lower", "upper"]].abs().min(axis=1))
    remains = remains.assign(size=relative_sizes(remains, results.scenes))[relative_sizes(least, results.scenes) > within]
    keys = ["engine", "scene", "dt"]
    steps = tried[keys].assign(default=np.where(is_broken[tried.index], "beyond", "undecided")).drop_duplicates(keys)
    declined = table[table["verdict"] == "declined"].drop_duplicates(["engine", "scene"])
    broken = set(zip(table.loc[is_broken, "scene"], table.loc[is_broken, "engine"], strict=True))
    lost_scenes = {scene for scene, _ in broken} - set(table.loc[is_exact, "scene"]) - set(results.recorded)
    truths = {name: (results.scenes[name], exact_solution(results.scenes[name])) for name in sorted(lost_scenes)}
    answers = []
    for metric in QUESTIONS:
        of_metric = found[found["metric"] == metric]
        unknown = {scene for scene, _ in broken - set(zip(of_metric["scene"], of_metric["engine"], strict=True))}
        tests = of_metric["value"].notna() | of_metric["verdict"].isin(FAILURES) | of_metric["scene"].isin(unknown)
        rows = of_metric[[*keys, "state", "size", "cost"]]
        scenes = {*rows.loc[tests, "scene"], *(name for name, known in truths.items() if METRICS[metric].applies(*known))}
        tested = steps[steps["scene"].isin(scenes)].merge(rows, how="left", on=keys)
        tested["state"] = tested["state"].fillna(tested["default"])
        for engine in results.engines:
            series = tested[tested["engine"] == engine]
            if len(series):
                absent = declined[(declined["engine"] == engine) & declined["scene"].isin(scenes)]
                limits = remains[(remains["engine"] == engine) & (remains["metric"] == metric)].set_index("scene")["size"]
                answers.append(_answer(metric, engine, len(scenes), len(absent), series, limits, results.scenes))
    return answers


def _answer(
    metric: str, engine: str, scenes: int, declined: int, series: pd.DataFrame, limits: "pd.Series[float]", models: Mapping[str, Scenario]
) -> Answer:
    """The answer from an engine's rows of scene, time step, state, relative size of the error, and computing time per simulated second.

    `limits` has the relative size of the asymptotic error by scene, where it is beyond the tolerance.
    """
    finest = series.loc[series.groupby("scene", sort=False)["dt"].idxmin()].set_index("scene", drop=False)
    grows = finest.index[(finest["state"] != "beyond") & finest["scene"].isin(limits.index)]
    finest.loc[grows, "state"], finest.loc[grows, "size"] = "beyond", limits[grows]
    of = {state: tuple(finest.loc[finest["state"] == state, "scene"]) for state in ("within", "beyond", "undecided")}
    kept = series[series["scene"].isin(of["within"])]
    counts = kept.groupby("dt")["scene"].nunique()
    common = counts.index[counts == len(of["within"])].tolist()
    held = [dt for dt in common if (kept.loc[kept["dt"] <= dt, "state"] == "within").all()]
    beyond = of["beyond"]
    others = [models[scene] for scene in (*of["within"], *of["undecided"])]
    only_beyond = {name: has for name, has in CONDITIONS.items() if not any(map(has, others))}
    having = {name: {scene for scene in beyond if has(models[scene])} for name, has in only_beyond.items()}
    condition = max(having, key=lambda name: len(having[name]), default="") if others else ""
    covered = having[condition] if condition and len(having[condition]) > 1 else set()
    dt = max(held, default=math.nan)
    sizes = finest.loc[finest["state"] == "beyond", "size"]
    largest = float(sizes.max(skipna=False))
    return Answer(
        metric=metric,
        engine=engine,
        scenes=scenes,
        **of,
        dt=dt,
        steps=tuple(common),
        condition=condition if covered else "",
        named=tuple(scene for scene in beyond if scene not in covered),
        declined=declined,
        largest=largest,
        worst="" if math.isnan(largest) else str(sizes.idxmax()),
        cost=float(kept.loc[kept["dt"] == dt, "cost"].median()),
    )
