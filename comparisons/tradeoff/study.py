"""The study of the command `dropspin tradeoff`: errors and costs of engines over a ladder of time steps.

Errors of several engines are measured at a time, then costs while nothing else runs. Only the engine's own time stepping is timed. In each
round all engines are timed in turn, and ratios of costs are computed within a round, so that other load on the machine affects all engines
of a round equally.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.measuring.metrics import leading_metric, metrics_for
from dropspin.comparisons.running.arguments import EngineEntry, SceneLike, as_scene, described_value, ignore
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.engine_entries import engine_entries
from dropspin.comparisons.running.parallel import as_jobs, results_in_parallel
from dropspin.comparisons.running.process_limits import FIVE_MINUTES, ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.tradeoff.costs import WORLDS, cost, costs_per_world, load, memory_per_world
from dropspin.comparisons.tradeoff.ladder import BUDGET, Ladder, errors_over_steps
from dropspin.comparisons.tradeoff.pareto import CostPoint, TradeOff, spread
from dropspin.scenarios import DropspinError, Scenario, truth_for
from dropspin.scenarios.errors import verify_known

IN_FLIGHT = (
    *("wang", "wang[rotation=gyroscopic]", "wang[rotation=implicit-gyroscopic]"),
    *("wang[rotation=midpoint]", "wang[rotation=rk4]", "wang[rotation=exact]"),
    *("mujoco", "mujoco[integrator=implicitfast]", "mujoco[integrator=rk4]", "pybullet"),
)
ON_A_FLOOR = (
    *("wang", "wang[contact=sequential,law=coulomb,rotation=rk4]"),
    *("mujoco", "mujoco[spring_steps=20]", "mujoco[integrator=rk4,spring_steps=20]"),
    *("pybullet", "pybullet[coordinates=multibody]"),
)
ROUNDS, BATCH_ROUNDS = 9, 3
MOST_WORLDS = 1 << 20
LARGE_BATCH = 1024
"""The smallest batch of which the memory is measured: that of fewer worlds is a few pages."""
NO_COST = "its cost could not be measured: its time steps fail, or do not give a finite state"

Result = TypeVar("Result")
OnProgress = Callable[[str, float], None]
"""Called with a description of the current work, and the fraction of the study that is done."""


class NotCompared(DropspinError):
    """No engine can be compared in a scene; the message has the reason of each.

    Attributes:
        ladders: The time steps tried for every requested engine.
    """

    def __init__(self, text: str, ladders: Sequence[Ladder]) -> None:
        super().__init__(text)
        self.ladders = ladders


def tradeoff(
    scene: SceneLike,
    engines: Engine | str | Iterable[Engine | str] = (),
    metric: str | None = None,
    *,
    budget: float = BUDGET,
    within: float = 0.0,
    worlds: Sequence[int] = WORLDS,
    on_progress: OnProgress | None = None,
    resources: ResourceLimits = FIVE_MINUTES,
    jobs: int | None = None,
) -> TradeOff:
    """Measure error and cost of engines at a sequence of ever smaller time steps.

    Args:
        scene: A scene with an exact solution, its catalogue name, the path of its file, or a mapping with the same keys.
        engines: One engine or several: engines, or names with options; by default, several methods that give different results in this
            scene.
        metric: The metric of the error; by default, the one by which the scene is summarised: bounce height if it applies, else orientation
            if the body rotates, else position.
        budget: Processor time for measuring the errors of each engine at all time steps [s]; once it is used up, no smaller time step is
            tried.
        within: The largest tolerance that is of interest: an engine whose errors are within it takes part, also if they do not fall.
        worlds: The numbers of worlds in the batches to time, for engines that step many worlds together.
        on_progress: Called with a description of the current work and the fraction of the whole study that is done, from 0 to 1, in any
            thread, but in one at a time.
        resources: The processor time [s] and memory [bytes] that each piece of work may use.
        jobs: Number of engines whose errors are measured at a time; by default, the number of processors that this process may use. It
            changes no error. Costs are measured afterwards, one at a time.

    Returns:
        The error of each engine at each time step and its cost, in seconds per simulated second, with the Pareto front.

    Raises:
        DropspinError: The scene has no exact solution, the metric does not apply to it, the budget or a number of worlds is not above 0, or
            no engine can be compared in the scene (the subclass NotCompared).
    """
    given = list(worlds) if isinstance(worlds, Iterable) else []
    if not given or not all(isinstance(size, int) and 0 < size <= MOST_WORLDS for size in given):
        raise DropspinError(f"worlds: got {described_value(worlds)}; give a list of whole numbers from 1 to {MOST_WORLDS}.")
    sizes = tuple(sorted(set(given)))
    if not (isinstance(budget, int | float | np.floating) and 0.0 < budget < math.inf):
        raise DropspinError(f"budget: got {described_value(budget)}; give a number of seconds above 0.")
    scene = as_scene(scene)
    truth = truth_for(scene)
    if truth is None:
        raise DropspinError(f"{scene.name} has no exact solution to compare with; choose a scene that has one (see dropspin list).")
    of_the_motion = leading_metric(scene)
    chosen = of_the_motion if metric is None else metric
    known = [allowed.name for allowed in metrics_for(scene, truth)]
    verify_known(f"{scene.name}'s metric", [chosen], known)
    asked = engine_entries(engines, IN_FLIGHT if scene.floor is None else ON_A_FLOOR)
    levels = {entry.label: [] if entry.engine is None else entry.engine.accuracy_levels() for entry in asked}
    entries = {level.label: level for entry in asked for level in (entry, *engine_entries(levels[entry.label]))}
    report = on_progress or ignore

    def errors(entry: EngineEntry, processes: EngineProcesses, report_errors: Callable[[str], None]) -> Ladder:
        report_errors(f"errors of {entry.label}")
        return errors_over_steps(entry, scene, [chosen, of_the_motion], budget, processes, within)

    with EngineProcesses(resources) as processes:
        processes.start([entry for entry in entries.values() if not entry.absence])
        # Each engine has one process, in which it has compiled when its costs are measured.
        crews = [processes] * min(as_jobs(jobs), len(entries))
        ladders = results_in_parallel(list(entries.values()), errors, crews, lambda work, share: report(work, 0.5 * share))
        compared = [(entries[ladder.engine], ladder) for ladder in ladders if not ladder.left_out]
        points, others, failures = _with_costs(compared, scene, sizes, processes, report)
        memory = _memory(entries, points, scene, sizes[-1], processes)
    measured = {point.engine for point in points}
    ladders = [_with_failures(ladder, ladder.engine in measured, failures.get(ladder.engine)) for ladder in ladders]
    result = TradeOff(scene, chosen, points, tuple(ladders), sizes, memory, others)
    if not points:
        reasons = "; ".join(f"{label}: {why.removesuffix('.')}" for label, why in result.left_out.items())
        raise NotCompared(f"no engine can be compared in {scene.name}: {reasons}.", ladders)
    return result


def _with_failures(ladder: Ladder, has_cost: bool, of_batches: Breakdown | None) -> Ladder:
    """A ladder with the reason why it or its batches have no cost, unless the engine has no batches; a breakdown is one of the engine."""
    if not has_cost and not ladder.left_out:
        ladder = replace(ladder, left_out=NO_COST, verdict="crashed")
    if of_batches is None or of_batches.verdict == "declined":
        return ladder
    return replace(ladder, no_batch_cost=of_batches.reason, verdict=ladder.verdict or of_batches.verdict)


def _with_costs(
    ladders: Sequence[tuple[EngineEntry, Ladder]],
    scene: Scenario,
    worlds: Sequence[int],
    processes: EngineProcesses,
    on_progress: OnProgress,
) -> tuple[tuple[CostPoint, ...], float, dict[str, Breakdown]]:
    """The configurations of the ladders that have a finite error and a finite cost, with the cost in every round and in batches.

    And the mean `load` of the machine, and the first failure of the batches of each engine.
    """
    steps = [(entry, dt, error) for entry, ladder in ladders for dt, error in ladder.steps if np.isfinite(error)]
    costs, loads = np.full((len(steps), ROUNDS), np.nan), []
    for number in range(ROUNDS):
        for row, (entry, dt, _) in enumerate(steps):
            loads.append(load())
            if number == 0 or np.isfinite(costs[row, number - 1]):
                costs[row, number] = _or_nan(processes.call(entry, cost, scene, dt))
        on_progress(f"round {number + 1} of {ROUNDS}", 0.5 + 0.4 * (number + 1) / ROUNDS)
    failures: dict[str, Breakdown] = {}
    batches = np.full((len(steps), len(worlds), BATCH_ROUNDS), np.nan)
    for number in range(BATCH_ROUNDS):
        for entry, ladder in ladders:
            # A time step at which a single simulation diverges until it is timed is no fault of the batch.
            rows = [row for row, (owner, _, _) in enumerate(steps) if owner is entry and np.isfinite(costs[row]).all()]
            errors = [(dt, error) for _, dt, error in map(steps.__getitem__, rows)]
            for column, size in enumerate(worlds):
                found = processes.call(entry, costs_per_world, scene, errors, size)
                batches[rows, column, number], failure = (math.nan, found) if isinstance(found, Breakdown) else found
                if failure is not None:
                    failures.setdefault(entry.label, failure)
            on_progress(f"batches of {ladder.engine}", 0.9 + 0.1 * (number + 1) / BATCH_ROUNDS)
    points = []
    for (entry, dt, error), rounds, by_size in zip(steps, costs, batches, strict=True):
        if np.isfinite(rounds).all():
            timed = {size: values for size, values in zip(worlds, by_size, strict=True) if np.isfinite(values).all()}
            least = {size: float(values.min()) for size, values in timed.items()}
            points.append(CostPoint(entry.label, dt, error, rounds, least, {size: spread(values) for size, values in timed.items()}))
    return tuple(points), float(np.mean(loads)) if loads else math.nan, failures


def _memory(
    entries: Mapping[str, EngineEntry], points: Sequence[CostPoint], scene: Scenario, worlds: int, processes: EngineProcesses
) -> dict[str, float]:
    """The memory per world [bytes] of each engine in a large batch."""
    if worlds < LARGE_BATCH:
        return {}
    dts = {point.engine: point.dt for point in reversed(points) if worlds in point.costs_per_world}
    memories = {
        label: _or_nan(processes.call(entries[label], memory_per_world, scene, dts[label], worlds)) for label in entries if label in dts
    }
    return {label: memory for label, memory in memories.items() if np.isfinite(memory)}


def _or_nan(value: Result | Breakdown) -> Result | float:
    return math.nan if isinstance(value, Breakdown) else value
