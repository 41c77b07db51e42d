"""The study behind `dropspin tradeoff`: errors and costs of engines over a ladder of time steps.

Timed is native stepping alone, of all entries in turn, round after round: a disturbance of the machine affects a whole round, and ratios
of costs are taken round by round.
"""

from collections.abc import Callable, Iterable, Sequence
from itertools import groupby

import numpy as np

from comparisons.engines.base import Engine
from comparisons.measuring.metrics import leading_metric, metrics_for
from comparisons.running.inputs import EngineEntry, as_scene, engine_entry, several
from comparisons.running.processes import EngineProcesses, Failed, ResourceLimits
from comparisons.tradeoff.costs import cost, costs_per_world
from comparisons.tradeoff.errors import errors_over_steps
from comparisons.tradeoff.points import CostPoint, TradeOff
from scenarios import DropspinError, Scenario, truth_for
from scenarios.errors import UnknownName

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
ROUNDS = 9

OnProgress = Callable[[str, float], None]
"""Called with what is done, and the share of the whole study."""


def tradeoff(
    scene: Scenario | str,
    engines: Engine | str | Iterable[Engine | str] = (),
    metric: str | None = None,
    *,
    on_progress: OnProgress = lambda what, share: None,
    resources: ResourceLimits = ResourceLimits(),  # noqa: B008 - it is immutable
) -> TradeOff:
    """Measure error and cost of engines over a ladder of time steps.

    Args:
        scene: A scene with an exact solution, its catalogue name, or the path of its file.
        engines: Engines, or names with options; by default the methods that differ on such a scene.
        metric: The metric of the error; by default the scene's leading metric.
        on_progress: Called with what is done, and the share of the whole study.
        resources: What each run may use.

    Raises:
        DropspinError: The scene has no exact solution, or not this metric; or no engine runs it.
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
    entries = [engine_entry(name) for name in several("engines", engines) or (IN_FLIGHT if scene.floor is None else ON_A_FLOOR)]
    with EngineProcesses(resources) as processes:
        ladders, left_out = _errors(entries, scene, [chosen, of_the_motion], processes, on_progress)
        found = _with_costs(ladders, scene, processes, on_progress)
    return TradeOff(scene, chosen, tuple(point for point in found if np.isfinite(point.cost).all()), left_out)


def _errors(
    entries: Sequence[EngineEntry], scene: Scenario, metrics: Sequence[str], processes: EngineProcesses, on_progress: OnProgress
) -> tuple[list[tuple[EngineEntry, float, float]], dict[str, str]]:
    """Engines with time steps and errors, and the engines left out, with reasons."""
    ladders: list[tuple[EngineEntry, float, float]] = []
    left_out: dict[str, str] = {}
    for number, entry in enumerate(entries):
        try:
            errors = errors_over_steps(entry, scene, metrics, processes)
        except Failed as failure:
            left_out[entry.label] = failure.reason
            continue
        ladders += [(entry, dt, error) for dt, error in errors]
        on_progress(f"errors of {entry.label}", 0.5 * (number + 1) / len(entries))
    if not ladders:
        raise DropspinError(f"no engine runs {scene.name}: {'; '.join(f'{label}: {why}' for label, why in left_out.items())}.")
    return ladders, left_out


def _with_costs(
    ladders: Sequence[tuple[EngineEntry, float, float]], scene: Scenario, processes: EngineProcesses, on_progress: OnProgress
) -> list[CostPoint]:
    """Cost points: each time step in every round, and in a batch."""
    costs: list[list[float]] = [[] for _ in ladders]
    for number in range(ROUNDS):
        for rounds, (entry, dt, _) in zip(costs, ladders, strict=True):
            rounds.append(processes.call(entry, cost, scene, dt))
        on_progress(f"round {number + 1} of {ROUNDS}", 0.5 + 0.4 * (number + 1) / ROUNDS)
    per_world: list[float] = []
    for entry, some in groupby(ladders, lambda point: point[0]):
        per_world += processes.call(entry, costs_per_world, scene, [dt for _, dt, _ in some])
    on_progress("batches", 1.0)
    return [
        CostPoint(entry.label, dt, error, np.array(rounds), batch)
        for (entry, dt, error), rounds, batch in zip(ladders, costs, per_world, strict=True)
    ]
