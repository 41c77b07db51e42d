"""What accuracy costs: the error of each engine and method at each step, against the time it takes.

Errors are of states at a fixed rate of output, whatever the step, so that a method is not held to its own few rows. Timed is native
stepping alone, of entries in turn, round after round: what disturbs one round disturbs all of it, and ratios are taken round by round.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from comparisons.engines.base import Diverged, Engine
from comparisons.measuring.comparison import Comparison, Unresolved
from comparisons.measuring.metrics import METRICS, leading_metric, metrics_for
from comparisons.running.processes import EngineProcesses, Failed, ResourceLimits
from comparisons.running.recording import MOST_STEPS, EngineEntry, as_scene, engine_entry, record, time_steps
from comparisons.running.start_phases import StartPhase, start_phases
from scenarios import DropspinError, Scenario, truth_for
from scenarios.errors import UnknownName

Array = NDArray[np.float64]

IN_FLIGHT = (
    "document",
    "document[rotation=gyroscopic]",
    "document[rotation=implicit-gyroscopic]",
    "document[rotation=midpoint]",
    "document[rotation=rk4]",
    "document[rotation=exact]",
    "mujoco",
    "mujoco[integrator=implicitfast]",
    "mujoco[integrator=rk4]",
    "pybullet",
)
ON_A_FLOOR = (
    "document",
    "document[contact=sequential,law=coulomb,rotation=rk4]",
    "mujoco",
    "mujoco[spring_steps=20]",
    "mujoco[integrator=rk4,spring_steps=20]",
    "pybullet",
    "pybullet[coordinates=multibody]",
)
DIVISIONS = (1, *(k * 2**j for j in range(22) for k in (2, 3)))
"""1, 2, 3, 4, 6, 8, 12, …: steps an output, each some 1.4 times as many as before."""
FEWEST_OUTPUTS = 8
LARGEST_TURN = 1.0  # rad a step, at the coarsest
ROUNDS = 9
LONG_ENOUGH = 2e-3  # s, that a timing takes at least
MOST_RUNS = 200
BUDGET_IN_FLIGHT, BUDGET_ON_A_FLOOR = 0.25, 0.05  # s, that one run may take; on a floor errors are means of 32
MOST_RECORDED = 200_000  # steps of one run on a floor, of which each is looked at
NO_BETTER = 0.8
"""Of the error of the step before: a method that does not get below this has reached its floor, if that is small; else it may be lost."""
FEWEST_POINTS = 6
"""To tell a floor, or another motion, from a coarse step."""
CONVERGED = 0.3
"""Of the largest error of the motion, that the least must be below."""
SMALL, PATIENCE, PATIENCE_WHILE_LARGE = 1e-6, 2, 6
SIDE_BY_SIDE = 256
"""Bodies of an ensemble."""
SIDE_BY_SIDE_ROUNDS = 3
MOST_SIDE_BY_SIDE = 100_000  # steps of all of them, that a timing takes
LEVEL = 1.25
"""Contestants whose times are nearer than this, or that change places from round to round, are level."""


@dataclass(frozen=True)
class Point:
    """An engine at a step.

    Attributes:
        engine: Its label.
        dt: [s].
        error: Size of the metric's value.
        cost: Time a simulated second, in each round [s/s], shape (rounds,).
        side_by_side: The same for each of `SIDE_BY_SIDE` bodies that the engine takes together, the least of some; NaN if it has no way to.
    """

    engine: str
    dt: float
    error: float
    cost: Array
    side_by_side: float = math.nan

    @property
    def typical(self) -> float:
        """The median of the rounds."""
        return float(np.median(self.cost))


@dataclass(frozen=True)
class Recommendation:
    """The cheapest point within a tolerance, and the next best of another engine or method.

    `ratio` is the second's time over the first's, median of the rounds; `level` says that it is no difference to rely on.
    """

    within: float
    best: Point
    next_best: Point | None
    ratio: float
    level: bool


@dataclass(frozen=True)
class TradeOff:
    """A scene's points, by one metric."""

    scene: Scenario
    metric: str
    points: tuple[Point, ...]
    left_out: dict[str, str] = field(default_factory=dict)

    @property
    def front(self) -> list[Point]:
        """The points that no other is both as accurate and as cheap as; cheapest first."""
        return _front(self.points, lambda point: point.typical)

    @property
    def front_side_by_side(self) -> list[Point]:
        """The same by the cost of each of many bodies, of the engines that can take them side by side."""
        return _front([point for point in self.points if np.isfinite(point.side_by_side)], lambda point: point.side_by_side)

    @property
    def dominated(self) -> list[str]:
        """The engines and methods of which no point is on the front."""
        on_it = {point.engine for point in self.front}
        return [label for label in dict.fromkeys(point.engine for point in self.points) if label not in on_it]

    def recommendation(self, within: float) -> Recommendation | None:
        """The cheapest within a tolerance; None if nothing is.

        Of each engine that is the coarsest step that is within it together with all finer ones: a step whose error crosses 0 is sampling_noise.
        """
        coarsest = self._coarsest(within)
        if not coarsest:
            return None
        best, *others = sorted(coarsest, key=lambda one: one.typical)
        if not others:
            return Recommendation(within, best, None, math.nan, False)
        ratios = others[0].cost / best.cost
        ratio = float(np.median(ratios))
        level = ratio < LEVEL or float(np.quantile(ratios, 0.25)) <= 1.0
        return Recommendation(within, best, others[0], ratio, level)

    def best_side_by_side(self, within: float) -> Point | None:
        """The cheapest within a tolerance where many bodies are taken together; None if no engine that can gets there."""
        together = [point for point in self._coarsest(within) if np.isfinite(point.side_by_side)]
        return min(together, key=lambda point: point.side_by_side, default=None)

    def _coarsest(self, within: float) -> list[Point]:
        """Of each engine the coarsest step that is within a tolerance together with all finer ones."""
        coarsest: dict[str, Point] = {}
        lost: set[str] = set()
        for point in sorted(self.points, key=lambda one: one.dt):
            if point.error > within:
                lost.add(point.engine)
            if point.engine not in lost:
                coarsest[point.engine] = point
        return list(coarsest.values())


def _front(points: Sequence[Point], cost: Callable[[Point], float]) -> list[Point]:
    front: list[Point] = []
    for point in sorted(points, key=lambda one: (cost(one), one.error)):
        if not front or point.error < front[-1].error:
            front.append(point)
    return front


def tradeoff(
    scene: Scenario | str,
    engines: Sequence[str | Engine] = (),
    metric: str | None = None,
    *,
    on_progress: Callable[[str, float], None] = lambda what, share: None,
    resources: ResourceLimits = ResourceLimits(),  # noqa: B008 - it is immutable
) -> TradeOff:
    """Measure error and time of engines over a ladder of steps.

    Args:
        scene: A scene with a truth.
        engines: Names with options; by default the methods that the scene lets differ.
        metric: The metric; by default what the scene is about.
        on_progress: Called with what is done, and the share of all of it.
        resources: What each run may use.

    Raises:
        DropspinError: The scene has no truth, or not this metric; or no engine runs it.
    """
    scene = as_scene(scene)
    truth = truth_for(scene)
    if truth is None:
        raise DropspinError(f"{scene.name} has no exact solution to compare with; choose a scene that has one, see dropspin list.")
    of_the_motion = leading_metric(scene)
    chosen = metric or of_the_motion
    known = [one.name for one in metrics_for(scene, truth)]
    if chosen not in known:
        raise UnknownName(f"{scene.name}'s metric", chosen, known)
    entries = [engine_entry(name) for name in engines or (IN_FLIGHT if scene.floor is None else ON_A_FLOOR)]
    points: list[tuple[EngineEntry, float, float]] = []
    left_out: dict[str, str] = {}
    with EngineProcesses(resources) as processes:
        for number, entry in enumerate(entries):
            try:
                errors = _errors(entry, scene, [chosen, of_the_motion], processes)
            except Failed as failure:
                left_out[entry.label] = failure.reason
                continue
            points += [(entry, dt, error) for dt, error, _ in errors]
            on_progress(f"errors of {entry.label}", 0.5 * (number + 1) / len(entries))
        if not points:
            raise DropspinError(f"no engine runs {scene.name}: {'; '.join(f'{label}: {why}' for label, why in left_out.items())}.")
        costs: list[list[float]] = [[] for _ in points]
        for number in range(ROUNDS):
            for cost, (entry, dt, _) in zip(costs, points, strict=True):
                cost.append(processes.call(entry, _cost, scene, dt))
            on_progress(f"round {number + 1} of {ROUNDS}", 0.5 + 0.4 * (number + 1) / ROUNDS)
        together: list[float] = []
        for entry, some in groupby(points, lambda point: point[0]):
            together += processes.call(entry, _costs_side_by_side, scene, [dt for _, dt, _ in some])
        on_progress("ensembles", 1.0)
    found = tuple(
        Point(one.label, dt, error, np.array(cost), apiece) for (one, dt, error), cost, apiece in zip(points, costs, together, strict=True)
    )
    return TradeOff(scene, chosen, tuple(point for point in found if np.isfinite(point.cost).all()), left_out)


def output_interval(scene: Scenario) -> float:
    """How far apart states are looked at [s], and the coarsest step: a turn of 1 rad, an eighth of the scene, a quarter of its fall."""
    fastest = float(np.linalg.norm(scene.start.angular_velocity))
    intervals = [scene.duration / FEWEST_OUTPUTS]
    if fastest > 0.0:
        intervals.append(LARGEST_TURN / fastest)
    truth = truth_for(scene)
    if truth is not None and truth.events and truth.events[0].time > 0.0:
        intervals.append(truth.events[0].time / 4.0)
    return min(intervals)


def _errors(entry: EngineEntry, scene: Scenario, metrics: Sequence[str], processes: EngineProcesses) -> list[tuple[float, float, float]]:
    """Steps and errors by two metrics, from the coarsest step to the method's floor by the first, or as far as the budget goes.

    By the second it must converge, else it is another motion that it is good at: the note keeps the energy of a spin that it gets wrong.
    """
    if entry.engine is None:
        raise Failed("missing", entry.missing)
    refusal = entry.engine.declines(scene)
    if refusal is not None:
        raise Failed("declined", refusal)
    interval = output_interval(scene)
    budget = BUDGET_IN_FLIGHT if scene.floor is None else BUDGET_ON_A_FLOOR
    found: list[tuple[float, float, float]] = []
    stuck = 0
    processes.call(entry, _error, scene, interval, 1, metrics)  # compiled, and warm, before anything is timed
    for division in DIVISIONS:
        dt = interval / division
        if scene.duration / dt > (MOST_STEPS if scene.floor is None else MOST_RECORDED):
            break
        try:
            errors, taken = processes.call(entry, _error, scene, dt, division, metrics)
        except Failed:
            if found:
                break  # what it can is measured
            raise
        if np.isfinite(errors).all():
            stuck = stuck + 1 if found and errors[0] > NO_BETTER * found[-1][1] else 0
            found.append((dt, *errors))
        patience = PATIENCE if found and found[-1][1] < SMALL else PATIENCE_WHILE_LARGE
        if (stuck >= patience and len(found) > FEWEST_POINTS) or taken > budget:
            break
    if not found:
        raise Failed("diverged", "no step gives a finite error")
    of_the_motion = [error for _, _, error in found]
    lost = max(of_the_motion) > SMALL and min(of_the_motion) > CONVERGED * max(of_the_motion)
    if lost and len(found) > FEWEST_POINTS:
        unit = METRICS[metrics[1]].unit
        stays = f"{of_the_motion[-1]:.3g}" + ("" if unit == "1" else f" {unit}")
        raise Failed("failed", f"it does not converge: {metrics[1].replace('_', ' ')} stays at {stays}, however small the step")
    return found


def _error(entry: EngineEntry, scene: Scenario, dt: float, division: int, metrics: Sequence[str]) -> tuple[list[float], float]:
    """Sizes of metrics' values at a step, NaN where it has none; and how long the run took [s]."""
    assert entry.engine is not None
    truth = truth_for(scene)
    in_flight = scene.floor is None
    phases = [StartPhase(scene, truth)] if in_flight else start_phases(scene, truth, dt)
    taken, cases = 0.0, []
    for phase in phases:
        start = time.perf_counter()
        try:
            motion = record(entry.engine, phase.scene, dt, division if in_flight else 1).motion
        except Diverged:
            return [math.nan] * len(metrics), 0.0
        taken += time.perf_counter() - start
        cases.append(Comparison.with_truth(phase.scene, motion, phase.truth))
    return [_size(metric, cases) for metric in metrics], taken / len(phases)


def _size(metric: str, cases: Sequence[Comparison]) -> float:
    try:
        with np.errstate(all="ignore"):
            return abs(METRICS[metric].average(cases).value)
    except Unresolved:
        return math.nan


def _cost(entry: EngineEntry, scene: Scenario, dt: float) -> float:
    """Time a simulated second of native stepping [s/s]; NaN if the state it leads to is none.

    In flight a step takes what it takes: one call of so many steps is timed that the call itself does not count, past the scene's end if
    the engine lasts so long. On a floor it depends on what happens, so whole runs are timed.
    """
    if scene.floor is None:
        steps = 16
        while (taken := _timed(entry, scene, dt, steps)) < LONG_ENOUGH and steps < MOST_STEPS:
            steps = min(MOST_STEPS, math.ceil(steps * min(16.0, max(2.0, 1.2 * LONG_ENOUGH / taken))))
        if np.isfinite(taken):
            return taken / (steps * dt)
    steps, total, runs = scene.steps(dt), 0.0, 0
    while total < LONG_ENOUGH and runs < MOST_RUNS:
        total, runs = total + _timed(entry, scene, dt, steps), runs + 1
    return total / runs / (steps * dt)


def _timed(entry: EngineEntry, scene: Scenario, dt: float, steps: int) -> float:
    """How long some native steps take [s]; NaN if the engine has no state after them."""
    assert entry.engine is not None
    try:
        taken, state = time_steps(entry.engine, scene, dt, steps)
    except Diverged:
        return math.nan
    return taken if np.isfinite(state).all() else math.nan


def _costs_side_by_side(entry: EngineEntry, scene: Scenario, dts: Sequence[float]) -> list[float]:
    """Time a simulated second and body [s/s] of native stepping of an ensemble, at each step; NaN if the engine has none.

    In flight a step takes what it takes, whatever its size; on a floor whole runs are timed, where they are not too long.
    """
    assert entry.engine is not None
    if scene.floor is not None:
        return [_timed_side_by_side(entry.engine, scene, dt, scene.steps(dt)) / (scene.steps(dt) * dt) for dt in dts]
    steps = MOST_SIDE_BY_SIDE // SIDE_BY_SIDE
    taken = _timed_side_by_side(entry.engine, scene, dts[-1], steps)
    return [taken / (steps * dt) for dt in dts]


def _timed_side_by_side(engine: Engine, scene: Scenario, dt: float, steps: int) -> float:
    """How long some native steps of an ensemble take, the least of some [s a body]; NaN if it cannot be told."""
    members, timings = [scene] * SIDE_BY_SIDE, []
    if steps * SIDE_BY_SIDE > MOST_SIDE_BY_SIDE:
        return math.nan
    for _ in range(1 + SIDE_BY_SIDE_ROUNDS):
        ensemble = engine.prepare_batch(members, dt)
        if ensemble is None:
            return math.nan
        start = time.perf_counter()
        ensemble.advance(steps)
        timings.append(time.perf_counter() - start)
        if not np.isfinite(ensemble.states()).all():
            return math.nan
    return min(timings[1:]) / SIDE_BY_SIDE  # the first one compiles
