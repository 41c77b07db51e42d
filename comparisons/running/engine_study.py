"""One engine in one scene: its runs at each time step, the causes of its errors, and its rows with their verdicts.

`EngineStudy.cause` decides a cause, and has the order of the rules; the verdicts are those of `judging.judge`.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.judging.convergence import (
    ADDED_STEPS,
    ARTEFACTS,
    JUMPING,
    Claim,
    Convergence,
    SeriesPoint,
    beside_recording,
    convergence,
    is_refuted,
    of_jump,
)
from dropspin.comparisons.judging.judge import judge, judge_asymptotic_error, judge_order
from dropspin.comparisons.judging.verdicts import Judgement
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.metric import Metric
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.tolerances import negligible
from dropspin.comparisons.results.provenance import motion_digest
from dropspin.comparisons.results.table import Case, Measurement
from dropspin.comparisons.running.ablation import MOST
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import Breakdown, divergence
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.comparisons.running.engine_run import NOT_REPEATED, EngineRun, is_repeated, run_engine
from dropspin.comparisons.running.perturbed_starts import IN_BATCHES, Changes, changes_of_metrics, number_of_simulations
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.progress import OnProgress, Progress
from dropspin.comparisons.running.start_phases import StartPhase, compare, measure, phases_at
from dropspin.comparisons.running.timing import Timing
from dropspin.scenarios.text import with_few_digits

VANISHING = 0.5
"""Share of an error below which what may remain of it with finer options counts as nothing, as in an error budget."""
BY_OPTIONS = 0.25
"""Share of an asymptotic error by which other options change it at least, if it is due to those of the engine: an error in proportion to a
power of 1/2 or more of a tolerance changes by more if the tolerance changes by a factor of 2 or more.
"""
FEWEST_STEPS = 8
"""A run of fewer steps is not worth adding."""


class Outcome(NamedTuple):
    """What an engine gave at one time step.

    Attributes:
        case: The columns that its rows have in common.
        per_step: Wall time of a native step [s].
        run: Its motion and what it states of itself, without the motions from the start phases; its breakdown if it has no metrics.
        points: Its metrics, by name.
        digest: The hash of all its motions.
    """

    case: Case
    per_step: float
    run: EngineRun
    points: Mapping[str, SeriesPoint]
    digest: str


@dataclass(eq=False)
class EngineStudy:
    """One engine in one scene.

    Attributes:
        own: The scene, and its exact solution.
        entry: The engine.
        processes: The engines' processes.
        on_progress: Called before, while and after the engine works.
        outcomes: What it gave at each of the requested time steps.
        calibrated: The study of this engine with calibrated settings, if this one has default settings.
        causes: The causes that were decided, by metric.
        added: The metrics at other time steps or with other options that were needed for this, by label and time step.
    """

    own: StartPhase
    entry: EngineEntry
    processes: EngineProcesses
    on_progress: OnProgress
    outcomes: list[Outcome] = field(default_factory=list)
    calibrated: "EngineStudy | None" = None
    causes: dict[str, Convergence] = field(default_factory=dict)
    added: dict[tuple[str, float], Mapping[str, SeriesPoint]] = field(default_factory=dict)

    def run_at(self, dt: float, phases: Sequence[StartPhase], timing: Timing) -> list[Comparison]:
        """Run the engine at a requested time step; its motions from all start phases, compared with the exact ones, if it has any."""
        progress = Progress(self.own.scene.name, self.entry.label, dt)
        self.on_progress(progress)
        outcome, cases = self._measured(self.entry, phases, progress, timing)
        self.outcomes.append(outcome)
        self.on_progress(progress._replace(finished=True))
        return cases

    def _measured(
        self, entry: EngineEntry, phases: Sequence[StartPhase], progress: Progress, timing: Timing, *, perturbs: bool = True
    ) -> tuple[Outcome, list[Comparison]]:
        """Simulate the scene from all start phases, and measure every metric; from perturbed starts too, if the uncertainty matters."""
        scene, dt, size = self.own.scene, progress.dt, len(phases)
        run = EngineRun(Claim(entry.label))
        if not timing.ended:
            starts = [phase.scene for phase in phases]
            perturbed = number_of_simulations(self.own, entry.adapter.precision, size) if perturbs else 0

            def on_simulations(done: int, total: int) -> None:
                self.on_progress(progress._replace(done=done, total=total and total + perturbed))

            answer = self.processes.call(entry, run_engine, scene, dt, starts, self.own.quick, on_simulations=on_simulations)
            run = EngineRun(Claim(entry.label), answer) if isinstance(answer, Breakdown) else answer
        motions = [] if run.motion is None else [run.motion, *run.phases]
        run.breakdown = run.breakdown or timing.breakdown or next(filter(None, map(divergence, motions)), None)
        # At the coarsest time step, where it costs the least.
        is_first = perturbs and all(outcome.run.breakdown is not None for outcome in self.outcomes)
        if is_first and run.motion is not None and run.breakdown is None:
            again = self.processes.call(entry, is_repeated, scene, dt, run.motion.states)
            if isinstance(again, Breakdown) or not again:
                run.meet(NOT_REPEATED)
        cases, changes = [] if run.breakdown else compare(run.phases, phases), Changes([], {})
        if cases and perturbs:
            before = size + (size > 1)

            def on_perturbed(done: int) -> None:
                self.on_progress(progress._replace(done=before + done, total=before + perturbed))

            try:
                changes = changes_of_metrics(self.own, entry, phases, cases, dt, run.claim.precision, self.processes, on_perturbed)
            except Breakdown as breakdown:
                run.breakdown, cases = breakdown, []
        points = measure(self.own, dt, run, cases, changes.of_starts) if cases else {}
        if any(changes.in_batch.get(name, 0.0) > point.tolerance for name, point in points.items()):
            run.meet(IN_BATCHES)
        digest = motion_digest(motions) if motions else ""
        case = Case(scene.name, entry.label, dt, scene.steps(dt))
        return Outcome(case, timing.per_step, replace(run, phases=[]), points, digest), cases

    def rows(self, *, is_extrapolated: bool) -> Iterator[Measurement]:
        """All rows of the engine: at each time step, and its orders and asymptotic errors if there are enough time steps."""
        scene, truth, *_ = self.own
        causes = {name: self.cause(name) for name in self.series} if is_extrapolated else {}
        truths = {"truth": "" if truth is None else truth.name, "invariant": ""}
        for case, per_step, run, points, _ in self.outcomes:
            timed = replace(case, time_per_step=per_step)
            if run.breakdown is not None:
                yield timed.remark(run.breakdown.verdict, run.breakdown.reason)
                continue
            for limitation in (one for one in run.claim.limitations if not one.is_minor):
                yield timed.remark("limited", limitation.message, "not_repeated" if limitation == NOT_REPEATED else "")
            for name, point in points.items():
                metric = METRICS[name]
                judgement = judge(scene, truth, run.claim, metric, point, causes.get(name))
                yield timed.measurement(metric.kind, name, metric.unit, judgement, truths[metric.kind])
                if metric.kind == "truth" and name in run.uncertainties:
                    uncertainty = Judgement(run.uncertainties[name], "measured")
                    yield timed.measurement("uncertainty", name, metric.unit, uncertainty, truths[metric.kind])
            if truth is None:
                yield timed.remark("no_truth", "no closed form is known for this scene")
        extrapolated = Case(scene.name, self.entry.label)
        for name, found in causes.items():
            metric = METRICS[name]
            if (order := judge_order(self.claim, metric, found)) is not None:
                yield extrapolated.measurement("order", name, "1", order, truths[metric.kind])
            if (error := judge_asymptotic_error(scene, self.claim, metric, found)) is not None:
                yield extrapolated.measurement("asymptotic_error", name, metric.unit, error, truths[metric.kind])

    def error_of(self, metric: Metric, dt: float) -> Callable[[Engine], float]:
        """A function of the engine with other options: its error at a time step [s], from few starts; NaN if it has none."""
        phases = phases_at(self.own._replace(quick=True), dt)
        found: dict[str, float] = {}

        def error(engine: Engine) -> float:
            if engine.label not in found:
                progress = Progress(self.own.scene.name, self.entry.label, dt, added=True)
                outcome, _ = self._measured(engine_entry(engine), phases, progress, Timing(), perturbs=False)
                found[engine.label] = outcome.points[metric.name].average.value if metric.name in outcome.points else math.nan
            return found[engine.label]

        return error

    @cached_property
    def claim(self) -> Claim:
        """The properties that the engine declares, and the limitations that it met at its finest time step.

        A limitation that it met at coarser ones alone vanishes with the time step, and explains no error that does not.
        """
        moved = [outcome for outcome in self.outcomes if outcome.run.motion is not None]
        return min(moved, key=lambda outcome: outcome.case.dt).run.claim

    @cached_property
    def series(self) -> Mapping[str, list[SeriesPoint]]:
        """The errors at each time step, by metric."""
        names = dict.fromkeys(name for outcome in self.outcomes for name in outcome.points if name not in ARTEFACTS)
        return {name: [outcome.points[name] for outcome in self.outcomes if name in outcome.points] for name in names}

    def cause(self, name: str) -> Convergence:
        """Decide the cause of the errors of a metric.

        That of the difference from a recording is decided by `beside_recording`. Otherwise, these rules apply in this order. Each may
        replace the result before it, and simulates only what it needs:

            1. requested    the error budget of the requested time steps: `convergence`
            2. coarser      if these leave the cause open, coarser steps are added. Their result counts if the cause was unresolved, or if
                            the model is the cause now
            3. finer        before a model error fails, a finer step is added, because a method can be unstable above some time step, or
                            its error at its largest value, which looks like an error that no time step removes. Its result counts if
                            it refutes the model error: `is_refuted`
            4. refined      an error that does not vanish with the time step alone, but together with the options that set the accuracy of
                            the engine, is attributed to these options, if values next to those of the engine change it by a quarter
            5. calibrated   a model error is a setting error if the engine with calibrated settings has none, or less than half of it
            6. jumping      a metric that jumps from flight to flight may stay at a value while the error that causes it falls: `of_jump`

        Returns:
            The convergence that counts, with its cause.
        """
        if name in self.causes:
            return self.causes[name]
        scene, engine, metric, series = self.own.scene, self.entry.adapter, METRICS[name], self.series[name]
        dts = [point.dt for point in series]
        found = convergence(scene, self.claim, metric, series)
        if metric.kind == "truth" and self.own.truth is not None and not self.own.truth.is_exact:
            finest = min((outcome for outcome in self.outcomes if name in outcome.points), key=lambda outcome: outcome.case.dt)
            self.causes[name] = beside_recording(found, finest.run.uncertainties[name])
            return self.causes[name]
        coarser = [factor * max(dts) for factor in ADDED_STEPS] if found.is_open else []
        if coarser:
            longer = self._longer(metric, coarser)
            if longer is not None and (found.budget.cause == "unresolved" or longer.budget.cause == "model"):
                found = longer
        if found.budget.cause == "model":
            error = judge_asymptotic_error(scene, self.claim, metric, found)
            longer = self._longer(metric, [*coarser, min(dts) / 2.0]) if error is not None and error.verdict == "failed" else None
            if longer is not None and is_refuted(found, longer):
                found = longer
        if engine.accuracy and found.budget.cause in ("model", "unresolved") and not math.isnan(found.budget.asymptotic_error):
            found = self._attributed_to_options(metric, found, engine.refined(dts))
        if found.budget.cause == "model" and self.calibrated is not None and name in self.calibrated.series:
            budget, calibrated = found.budget, self.calibrated.cause(name).budget
            is_smaller = max(-calibrated.lower, calibrated.upper) < max(budget.lower, -budget.upper)
            if is_smaller and abs(calibrated.asymptotic_error) < MOST * abs(budget.asymptotic_error):
                found = replace(found, budget=replace(budget, cause="setting"))
        if name in JUMPING and found.budget.cause == "model":
            others = {other: self.cause(other).budget.cause for other in self.series if other != name}
            found = of_jump(found, [(METRICS[other], cause, self.series[other]) for other, cause in others.items()])
        self.causes[name] = found
        return found

    def _longer(self, metric: Metric, added: Sequence[float]) -> Convergence | None:
        """The convergence over the requested and other time steps; None if the engine gives no result at these."""
        fewest = min(len(point.average.parts) for point in self.series[metric.name])  # flights that the requested steps resolve
        points = [point for point in self._points(metric, [(dt, self.entry) for dt in added]) if len(point.average.parts) >= fewest]
        remark = f"with {' and '.join(f'{point.dt:g}' for point in points)} s added"
        return convergence(self.own.scene, self.claim, metric, [*points, *self.series[metric.name]], remark) if points else None

    def _attributed_to_options(self, metric: Metric, found: Convergence, refined: Sequence[tuple[float, Engine]]) -> Convergence:
        """The convergence, of which the cause may be the options that set the accuracy: they are refined together with the time step."""
        options = self.entry.adapter.accuracy
        names = " and ".join(options)
        values = [", ".join(with_few_digits(finer.option(option)) for _, finer in refined) for option in options]
        path = f"{'; '.join(values)}, with dt = {', '.join(f'{dt:g}' for dt, _ in refined)} s"
        points = self._points(metric, [(dt, engine_entry(finer)) for dt, finer in refined])
        plain = {point.dt: point.average.value for point in self.series[metric.name]}
        others = {dt for dt, finer in refined if finer.label != self.entry.label}
        changes = [abs(point.average.value) - abs(plain[point.dt]) for point in points if point.dt in others & plain.keys()]
        least = max(BY_OPTIONS * abs(found.budget.asymptotic_error), negligible(self.own.scene, metric.unit))
        if not changes or not abs(changes[-1]) > least:
            return found
        lower, upper = min(found.budget.lower, 0.0), max(found.budget.upper, 0.0)
        few = f"too few usable time steps with finer {names}"
        budget = replace(found.budget, cause="unresolved", lower=lower, upper=upper, reason=few)
        if len(points) == len(refined):
            finest = convergence(self.own.scene, self.claim._replace(order=None), metric, points).budget
            if not math.isnan(finest.asymptotic_error):
                budget, remains, error = finest, max(-finest.lower, finest.upper), abs(points[-1].average.value)
                if finest.cause not in ("model", "unresolved"):
                    vanishes = remains < VANISHING * error
                    reason = f"vanishes with finer {names}" if vanishes else f"falls with finer {names}; up to {remains:.2g} may remain"
                    budget = replace(finest, cause=names if remains <= error else "unresolved", reason=reason)
        return found if budget.cause == "model" else replace(found, budget=replace(budget, order=math.nan), remark=path)

    def _points(self, metric: Metric, wanted: Sequence[tuple[float, EngineEntry]]) -> list[SeriesPoint]:
        """A metric at time steps that were not requested, without those at which the engine breaks down."""
        points = []
        for dt, entry in wanted:
            if self.own.scene.steps(dt) >= FEWEST_STEPS and (entry.label, dt) not in self.added:
                progress = Progress(self.own.scene.name, entry.label, dt, added=True)
                outcome, _ = self._measured(entry, phases_at(self.own, dt), progress, Timing())
                self.added[entry.label, dt] = outcome.points
            points.append(self.added.get((entry.label, dt), {}).get(metric.name))
        return [point for point in points if point is not None]
