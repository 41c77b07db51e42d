"""The study of the command `dropspin tradeoff`: errors and costs of engines over a ladder of time steps.

Errors of several engines are measured at a time, then costs while nothing else runs. Only the engine's own time stepping is timed. In each
round all engines are timed in turn, and ratios of costs are computed within a round, so that other load on the machine affects all engines
of a round equally.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.measuring.metrics import leading_metric, metrics_for
from dropspin.comparisons.running.engine_process import Failed
from dropspin.comparisons.running.entries import engine_entry
from dropspin.comparisons.running.inputs import EngineEntry, SceneLike, as_scene, ignore, several
from dropspin.comparisons.running.parallel import as_jobs, results_in_parallel
from dropspin.comparisons.running.processes import EngineProcesses, ResourceLimits
from dropspin.comparisons.tradeoff.costs import WORLDS, cost, costs_per_world, load, memory_per_world
from dropspin.comparisons.tradeoff.errors import BUDGET, errors_over_steps
from dropspin.comparisons.tradeoff.ladder import Ladder
from dropspin.comparisons.tradeoff.points import CostPoint, TradeOff, spread
from dropspin.scenarios import DropspinError, Scenario, truth_for
from dropspin.scenarios.errors import UnknownName

IN_FLIGHT = (
    "wang",
    "wang[rotation=gyroscopic]",
    "wang[rotation=implicit-gyroscopic]",
    "wang[rotation=midpoint]",
    "wang[rotation=rk4]",
    "wang[rotation=exact]",
    "mujoco",
    "mujoco[integrator=implicitfast]",
    "mujoco[integrator=rk4]",
    "pybullet",
)
ON_A_FLOOR = (
    "wang",
    "wang[contact=sequential,law=coulomb,rotation=rk4]",
    "mujoco",
    "mujoco[spring_steps=20]",
    "mujoco[integrator=rk4,spring_steps=20]",
    "pybullet",
    "pybullet[coordinates=multibody]",
)
ROUNDS, BATCH_ROUNDS = 9, 3
MOST_WORLDS = 1 << 20
LARGE_BATCH = 1024
"""The smallest batch of which the memory is measured: that of fewer worlds is a few pages."""
NO_COST = "its cost could not be measured: its time steps fail, or do not give a finite state"

OnProgress = Callable[[str, float], None]
"""Called with a description of the current work, and the fraction of the study that is done."""


def tradeoff(
    scene: SceneLike,
    engines: Engine | str | Iterable[Engine | str] = (),
    metric: str | None = None,
    *,
    budget: float = BUDGET,
    worlds: Sequence[int] = WORLDS,
    on_progress: OnProgress | None = None,
    resources: ResourceLimits = ResourceLimits(),  # noqa: B008 - it is immutable
    jobs: int | None = None,
) -> TradeOff:
    """Measure error and cost of engines over a ladder of time steps.

    Args:
        scene: A scene with an exact solution, its catalogue name, the path of its file, or a mapping with the same keys.
        engines: One engine or several: engines, or names with options; by default methods that give different results for such scenes.
        metric: The metric of the error; by default the scene's leading metric.
        budget: Processor time for measuring the errors of each engine at all time steps [s]; once it is used up, no smaller time step is
            tried.
        worlds: The numbers of worlds in the batches to time, for engines that step many worlds together.
        on_progress: Called with a description of the current work and the fraction of the whole study that is done, from 0 to 1, in any
            thread, but in one at a time.
        resources: The processor time [s] and memory [bytes] that each piece of work may use.
        jobs: Number of engines whose errors are measured at a time; by default, the number of processors that this process may use. It
            changes no error. Costs are measured afterwards, one at a time.

    Returns:
        The error of each engine at each time step and its cost, in seconds per simulated second, with the Pareto front.

    Raises:
        DropspinError: The scene has no exact solution, or the metric does not apply to it; the budget or a number of worlds is not above 0;
            or no engine runs the scene.
    """
    sizes = tuple(sorted(set(worlds)))
    if not all(isinstance(size, int) and 0 < size <= MOST_WORLDS for size in sizes):
        raise DropspinError(f"worlds: got {', '.join(map(str, worlds))}; give whole numbers from 1 to {MOST_WORLDS}.")
    if not 0.0 < budget < math.inf:
        raise DropspinError(f"budget: got {budget!r}; give a number of seconds above 0.")
    scene = as_scene(scene)
    truth = truth_for(scene)
    if truth is None:
        raise DropspinError(f"{scene.name} has no exact solution to compare with; choose a scene that has one (see dropspin list).")
    of_the_motion = leading_metric(scene)
    chosen = of_the_motion if metric is None else metric
    known = [one.name for one in metrics_for(scene, truth)]
    if chosen not in known:
        raise UnknownName(f"{scene.name}'s metric", chosen, known)
    named = [engine_entry(name) for name in several("engines", engines) or (IN_FLIGHT if scene.floor is None else ON_A_FLOOR)]
    entries = {one.label: one for entry in named for one in _with_accuracy_levels(entry)}
    report = on_progress or ignore

    def errors(entry: EngineEntry, processes: EngineProcesses, report_errors: Callable[[str], None]) -> Ladder:
        report_errors(f"errors of {entry.label}")
        return errors_over_steps(entry, scene, [chosen, of_the_motion], budget, processes)

    with EngineProcesses(resources) as processes:
        processes.start([entry for entry in entries.values() if not entry.absence])
        # Each engine has one process, in which it has compiled when its costs are measured.
        crews = [processes] * min(as_jobs(jobs), len(entries))
        ladders = results_in_parallel(list(entries.values()), errors, crews, lambda what, share: report(what, 0.5 * share))
        compared = [(entries[one.engine], one) for one in ladders if not one.left_out]
        points, others = _with_costs(compared, scene, sizes, processes, report)
        memory = _memory([entries[one.engine] for one in ladders], points, scene, sizes[-1], processes)
    measured = {point.engine for point in points}
    ladders = [one if one.left_out or one.engine in measured else replace(one, left_out=NO_COST) for one in ladders]
    found = TradeOff(scene, chosen, points, tuple(ladders), sizes, memory, others)
    if not points:
        reasons = "; ".join(f"{label}: {why.removesuffix('.')}" for label, why in found.left_out.items())
        raise DropspinError(f"no engine runs {scene.name}: {reasons}.")
    return found


def _with_accuracy_levels(entry: EngineEntry) -> list[EngineEntry]:
    """An engine, and the engine with each value of the options that set its accuracy."""
    levels = [] if entry.engine is None else entry.engine.accuracy_levels()
    return [entry, *map(engine_entry, levels)]


def _with_costs(
    ladders: Sequence[tuple[EngineEntry, Ladder]],
    scene: Scenario,
    worlds: Sequence[int],
    processes: EngineProcesses,
    on_progress: OnProgress,
) -> tuple[tuple[CostPoint, ...], float]:
    """The configurations of the ladders that have a finite error and a finite cost, with the cost in every round and in batches.

    And the mean `load` of the machine.
    """
    steps = [(entry, dt, error) for entry, ladder in ladders for dt, error in ladder.steps if np.isfinite(error)]
    costs: list[list[float]] = [[] for _ in steps]
    loads = []
    for number in range(ROUNDS):
        for rounds, (entry, dt, _) in zip(costs, steps, strict=True):
            loads.append(load())
            rounds.append(math.nan if rounds and math.isnan(rounds[-1]) else _cost(entry, scene, dt, processes))
        on_progress(f"round {number + 1} of {ROUNDS}", 0.5 + 0.4 * (number + 1) / ROUNDS)
    batches: list[dict[int, list[float]]] = [{size: [] for size in worlds} for _ in steps]
    for number in range(BATCH_ROUNDS):
        for entry, ladder in ladders:
            rows = [row for row, (owner, _, _) in enumerate(steps) if owner is entry]
            for size in worlds:
                found = _costs_per_world(entry, scene, [steps[row][1] for row in rows], size, processes)
                for row, value in zip(rows, found, strict=True):
                    batches[row][size].append(value)
            on_progress(f"batches of {ladder.engine}", 0.9 + 0.1 * (number + 1) / BATCH_ROUNDS)
    points = []
    for (entry, dt, error), rounds, by_size in zip(steps, costs, batches, strict=True):
        timed = {size: np.array(values) for size, values in by_size.items() if np.isfinite(values).all()}
        least, spreads = ({size: of(values) for size, values in timed.items()} for of in (lambda values: float(values.min()), spread))
        if np.isfinite(rounds).all():
            points.append(CostPoint(entry.label, dt, error, np.array(rounds), least, spreads))
    return tuple(points), float(np.mean(loads)) if loads else math.nan


def _memory(
    entries: Sequence[EngineEntry], points: Sequence[CostPoint], scene: Scenario, worlds: int, processes: EngineProcesses
) -> dict[str, float]:
    """The memory per world [bytes] of each engine in a large batch."""
    found = {}
    for entry in entries if worlds >= LARGE_BATCH else ():
        finest = next((point.dt for point in points if point.engine == entry.label and worlds in point.costs_per_world), None)
        if finest is not None:
            found[entry.label] = _memory_per_world(entry, scene, finest, worlds, processes)
    return {label: memory for label, memory in found.items() if np.isfinite(memory)}


def _memory_per_world(entry: EngineEntry, scene: Scenario, dt: float, worlds: int, processes: EngineProcesses) -> float:
    try:
        return processes.call(entry, memory_per_world, scene, dt, worlds)
    except Failed:
        return math.nan


def _cost(entry: EngineEntry, scene: Scenario, dt: float, processes: EngineProcesses) -> float:
    try:
        return processes.call(entry, cost, scene, dt)
    except Failed:
        return math.nan


def _costs_per_world(entry: EngineEntry, scene: Scenario, dts: Sequence[float], worlds: int, processes: EngineProcesses) -> list[float]:
    try:
        return processes.call(entry, costs_per_world, scene, dts, worlds)
    except Failed:
        return [math.nan] * len(dts)
