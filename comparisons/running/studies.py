"""The convergence of each metric of one engine in one scene; where the steps leave it open, with further steps and refined options."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.judging.convergence import (
    ADDED_STEPS,
    ARTEFACTS,
    Claim,
    ConvergenceStudy,
    SeriesPoint,
    attributed_to_accuracy,
    study_convergence,
)
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.running.entries import engine_entry
from dropspin.comparisons.running.inputs import EngineEntry
from dropspin.comparisons.running.measured import Measured, breakdown_of, compare, measure, phases_at
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.progress import OnProgress, Progress, reporter
from dropspin.comparisons.running.start_phases import StartPhase

FEWEST_STEPS = 8
"""A run of fewer steps is not worth adding."""

Studies = dict[str, ConvergenceStudy]
"""By metric."""


def study_engine(
    own: StartPhase,
    entry: EngineEntry,
    claim: Claim,
    measured: Sequence[Measured],
    processes: EngineProcesses,
    on_progress: OnProgress = lambda progress: None,
) -> Studies:
    """The convergence of each metric of one engine, with further time steps where they are needed.

    Coarser ones are added if those asked for leave a cause open. A finer one is added before a model error in contact fails, because a
    contact solver can be unstable above some time step, which looks like an error that no time step removes.

    Args:
        own: The scene, and its exact solution.
        entry: The engine.
        claim: What it states.
        measured: Its metrics at each time step.
        processes: The engines' processes, for further steps.
        on_progress: Called while an engine works on these.
    """
    series = _series(measured)
    if not series:
        return {}
    dts = sorted({point.dt for point in chain(*series.values())})
    studies = {name: study_convergence(own.scene, claim, METRICS[name], points) for name, points in series.items()}

    def at_steps(added: Sequence[float], names: Collection[str]) -> Iterator[tuple[str, ConvergenceStudy]]:
        """The studies of some metrics with further time steps."""
        measured = [one for dt in added for one in _measured_at(own, entry, dt, processes, on_progress)] if names else []
        for name, points in _series(measured).items():
            if name in names:
                longer = study_convergence(own.scene, claim, METRICS[name], [*points, *series[name]])
                yield name, _with_remark(longer, f"with {' and '.join(f'{point.dt:g}' for point in points)} s added")

    for name, longer in at_steps([factor * dts[-1] for factor in ADDED_STEPS], [name for name in studies if studies[name].is_open]):
        if studies[name].cause == "unresolved" or longer.cause == "model":
            studies[name] = longer
    failing = [name for name, study in studies.items() if own.scene.floor is not None and study.fails]
    studies |= {name: longer for name, longer in at_steps([dts[0] / 2.0], failing) if longer.cause != "model"}
    if entry.engine is not None and entry.engine.accuracy and any(study.cause in ("model", "unresolved") for study in studies.values()):
        return _with_accuracy_options(studies, own, claim, entry.engine, dts, processes, on_progress)
    return studies


def _with_remark(study: ConvergenceStudy, remark: str) -> ConvergenceStudy:
    """A study whose asymptotic error says how it was found."""
    limit = study.asymptotic_error
    return study if limit is None else replace(study, asymptotic_error=replace(limit, reason=f"{limit.reason} ({remark})"))


def _with_accuracy_options(
    studies: Studies,
    own: StartPhase,
    claim: Claim,
    engine: Engine,
    dts: Sequence[float],
    processes: EngineProcesses,
    on_progress: OnProgress,
) -> Studies:
    """The convergence studies; if an error does not vanish with the time step alone, accuracy options are refined with it."""
    refined = engine.refined(dts)
    series = _series([one for dt, finer in refined for one in _measured_at(own, engine_entry(finer), dt, processes, on_progress)])
    again = {
        name: study_convergence(own.scene, claim._replace(order=None), METRICS[name], points)
        for name, points in series.items()
        if len(points) == len(refined)
    }
    values = [", ".join(_short(finer.option(option)) for _, finer in refined) for option in engine.accuracy]
    path = f"{'; '.join(values)}, with dt = {', '.join(f'{dt:g}' for dt, _ in refined)} s"
    return {name: attributed_to_accuracy(study, again.get(name), " and ".join(engine.accuracy), path) for name, study in studies.items()}


def _short(value: str) -> str:
    """An option's value; numbers with six digits."""
    try:
        return f"{float(value):g}"
    except ValueError:
        return value


def _measured_at(own: StartPhase, entry: EngineEntry, dt: float, processes: EngineProcesses, on_progress: OnProgress) -> list[Measured]:
    """Every metric of one engine at a step that was not asked for; none if it breaks down there."""
    if own.scene.steps(dt) < FEWEST_STEPS:
        return []
    phases, exact = phases_at(own, dt)
    progress = Progress(own.scene.name, entry.label, dt, added=True)
    starts, on_simulations = [phase.scene for phase in phases], reporter(progress, on_progress)
    engine_run = processes.run_engine(entry, own.scene, dt, starts, on_simulations, quick=own.quick)
    return [] if breakdown_of(engine_run) else measure(own, dt, engine_run, phases, exact, compare(engine_run.phases, phases, exact))


def _series(measured: Sequence[Measured]) -> Mapping[str, list[SeriesPoint]]:
    """The errors at each time step, by metric."""
    series: dict[str, list[SeriesPoint]] = {}
    for row, average, components in measured:
        if average is not None and row.metric not in ARTEFACTS:
            series.setdefault(row.metric, []).append(SeriesPoint(row.dt, row.steps, average, components, row.tolerance))
    return series
