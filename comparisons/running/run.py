"""A run: scenes × engines × time steps, measured against exact solutions and against each other, and judged."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import product
from threading import Lock
from typing import Any, NamedTuple

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.engines.stand_in import code_of
from dropspin.comparisons.judging.judge import verify_expectations
from dropspin.comparisons.measuring.batch import compile_states
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.metrics import metrics_for
from dropspin.comparisons.results.provenance import provenance
from dropspin.comparisons.results.results import Results, joined
from dropspin.comparisons.running.belonging import verify_motion
from dropspin.comparisons.running.engine_process import Failed
from dropspin.comparisons.running.engine_run import Timing, time_engine
from dropspin.comparisons.running.entries import CONSTRUCTION, engine_entry
from dropspin.comparisons.running.forecast import Forecast, forecast
from dropspin.comparisons.running.inputs import EngineEntry, SceneLike, as_scene, ignore, several, verify_time_step
from dropspin.comparisons.running.parallel import as_jobs, work_in_parallel
from dropspin.comparisons.running.processes import EngineProcesses, ResourceLimits
from dropspin.comparisons.running.progress import OnProgress, Progress
from dropspin.comparisons.running.recording import Breakdown
from dropspin.comparisons.running.scene_run import Timings, run_scene
from dropspin.comparisons.running.start_phases import StartPhase
from dropspin.scenarios import DropspinError, Scenario, Trajectory, Truth, truth_for

DEFAULT_DTS = (4e-3, 2e-3, 1e-3)


def run(
    scenes: SceneLike | Iterable[SceneLike],
    engines: Engine | str | Iterable[Engine | str],
    dt: float | Iterable[float] = DEFAULT_DTS,
    *,
    on_progress: OnProgress | None = None,
    resources: ResourceLimits = ResourceLimits(),  # noqa: B008 - it is immutable
    keep: Callable[[Results], None] | None = None,
    done: Iterable[Results] = (),
    jobs: int | None = None,
    quick: bool = False,
    on_forecast: Callable[[Forecast], None] | None = None,
) -> Results:
    """Run every scene with every engine at every time step, measure, and judge.

    Args:
        scenes: One scene or several, with different names: each a scene, a catalogue name, the path of a file, or a mapping with the same
            keys.
        engines: One engine or several: engines, or names with options. One that is not installed is `missing` in the
            results, and one that cannot be imported or constructed `broken`.
        dt: One time step or several [s]; three or more that span a factor of four give orders and asymptotic errors.
        on_progress: Called with scene, engine, time step and the simulations done: before and while an engine works, twice a second, and
            with `finished` after each of the len(scenes) * len(engines) * len(dt) pieces of work; in any thread, but in one at a time.
        resources: The processor time [s] and memory [bytes] that an engine may use for one of these pieces; each engine runs in a process
            of its own.
        keep: Called with the results of each scene as soon as it is done.
        done: Results of scenes from an earlier run. Those with the same request, versions and machine are not run again.
        jobs: Number of scenes to run at a time; by default, the number of processors that this process may use. It changes no result: steps
            are timed before, while nothing else runs.
        quick: Whether to run few starts: 8 instead of 32 start phases, 16 members of an ensemble, and no perturbed starts in double
            precision. A check that the sampling noise may decide is `measured`, intervals are wider, and the results have no tolerances,
            so that `check` with a baseline, `accept`, `compare` and `compare history` refuse them.
        on_forecast: Called once, when the steps are timed, with the time that the simulations will take.

    Returns:
        The measurements with their verdicts, predictions, agreements of engines, and the motions.

    Raises:
        DropspinError: The request cannot be run: an unknown engine, an impossible time step, equal names.
    """
    prepared = prepare_run(scenes, engines, dt, resources)
    entries, dts = prepared.entries, prepared.dts
    stamp = _stamp(prepared, resources, quick)
    earlier = {scene.model_dump_json(): part for part in done for scene in part.scenes.values() if not what_changed(part.provenance, stamp)}
    parts: dict[str, Results] = {}
    pending: list[StartPhase] = []
    lock, keep = Lock(), keep or ignore

    def report(progress: Progress) -> None:
        if on_progress is not None:
            with lock:
                on_progress(progress)

    for scene, truth in zip(prepared.scenes, prepared.truths, strict=True):
        if scene.model_dump_json() in earlier:
            parts[scene.name] = replace(earlier[scene.model_dump_json()], scenes={scene.name: scene})
            for entry, step in product(entries, dts):
                report(Progress(scene.name, entry.label, step, finished=True))
        else:
            pending.append(StartPhase(scene, truth, quick))
    number = min(as_jobs(jobs), max(len(pending), 1))
    for own in pending[:1]:
        compile_states(own.scene)
    with ExitStack() as stack:
        crews = [stack.enter_context(EngineProcesses(resources)) for _ in range(number)]
        timings = _timings([own.scene for own in pending], entries, dts, crews[0], report)
        expected = forecast(pending, entries, dts, timings, number)
        if on_forecast is not None:
            on_forecast(expected)

        def of_scene(own: StartPhase, processes: EngineProcesses, _: Callable[[], None]) -> Results:
            return run_scene(own, entries, dts, processes, report, stamp, timings)

        def on_done(own: StartPhase, part: Results) -> None:
            parts[own.scene.name] = part
            keep(part)

        for processes in crews[1:]:
            processes.start([entry for entry in entries if not entry.absence])
        if len(crews) > 1:  # the longest first, so that no processor is idle while another one ends a long scene
            pending = sorted(pending, key=lambda own: -expected.by_scene[own.scene.name])
        work_in_parallel(iter(pending), of_scene, crews, on_done)
    stamp["compilation"] = _compilation(timings)
    return joined([parts[scene.name] for scene in prepared.scenes], stamp)


def _timings(
    scenes: Sequence[Scenario], entries: Sequence[EngineEntry], dts: Sequence[float], processes: EngineProcesses, on_progress: OnProgress
) -> Timings:
    """The time that the steps of each engine take, measured while nothing else runs."""
    found = {}
    for scene, entry, dt in product(scenes, entries, dts):
        on_progress(Progress(scene.name, entry.label, dt, timing=True))
        timing = Timing()
        if not entry.absence:
            try:
                timing = processes.call(entry, time_engine, scene, dt)
            except Failed as failure:
                timing = Timing(breakdown=Breakdown(failure.verdict, failure.reason), ended=True)
        found[scene.name, entry.label, dt] = timing
    return found


def _compilation(timings: Timings) -> dict[str, float]:
    """The longest time that each engine took to compile a scene [s], of engines that compile."""
    found: dict[str, float] = {}
    for (_, label, _), timing in timings.items():
        if timing.compilation > 0.0:
            found[label] = max(found.get(label, 0.0), timing.compilation)
    return found


class PreparedRun(NamedTuple):
    """A request of a run that was checked: scenes with their exact solutions, engines, time steps [s]."""

    scenes: list[Scenario]
    truths: list[Truth | None]
    entries: list[EngineEntry]
    names: dict[str, str]
    """By label: what each engine was asked for by, where that is a name."""
    dts: list[float]


def prepare_run(
    scenes: SceneLike | Iterable[SceneLike],
    engines: Engine | str | Iterable[Engine | str],
    dt: float | Iterable[float],
    resources: ResourceLimits = CONSTRUCTION,
) -> PreparedRun:
    """Check a request of a run, and find its engines and exact solutions.

    Args:
        scenes: As for `run`.
        engines: As for `run`.
        dt: As for `run`.
        resources: What the import and the construction of an engine of one's own may use.

    Raises:
        DropspinError: The request cannot be run.
    """
    chosen = [as_scene(one) for one in several("scenes", scenes)]
    asked = several("engines", engines)
    entries = [engine_entry(one, resources) for one in asked]
    dts = several("dt", dt)
    for name, given in (("scenes", chosen), ("engines", entries), ("dt", dts)):
        if not given:
            raise DropspinError(f"{name}: got none; give at least one.")
    labels = [entry.label for entry in entries]
    truths = [truth_for(scene) for scene in chosen]
    _verify_request(chosen, truths, dts, labels)
    names = {entry.label: name.strip() for entry, name in zip(entries, asked, strict=True) if isinstance(name, str)}
    return PreparedRun(chosen, truths, entries, names, dts)


def _verify_request(scenes: Sequence[Scenario], truths: Sequence[Truth | None], dts: Sequence[float], labels: Sequence[str]) -> None:
    names = [scene.name for scene in scenes]
    if len(set(names)) < len(names):
        raise DropspinError(f"two scenes have the same name ({', '.join(names)}); rename a file, or give a mapping a 'name'.")
    for scene, truth in zip(scenes, truths, strict=True):
        verify_expectations(scene, truth, labels)
        for dt in dts:
            verify_time_step(scene, dt)
    if len(set(dts)) < len(dts):
        raise DropspinError(f"dt: a time step is given twice ({', '.join(f'{dt:g}' for dt in dts)}); give each once.")
    if len(set(labels)) < len(labels):
        raise DropspinError(f"an engine is given twice: {', '.join(labels)}; give each once.")


def _stamp(prepared: PreparedRun, resources: ResourceLimits, quick: bool) -> dict[str, Any]:
    """The provenance of a run before it starts."""
    asked = {
        "scenes": [scene.name for scene in prepared.scenes],
        "engines": [entry.label for entry in prepared.entries],
        "dts": list(prepared.dts),
        "time_limit": resources.processor_time,
        "quick": quick,
    }
    adapters = {entry.label: code_of(entry.engine) for entry in prepared.entries if entry.engine is not None}
    return provenance(asked) | {"names": prepared.names, "adapters": adapters}


def what_changed(earlier: Mapping[str, Any], stamp: Mapping[str, Any]) -> str:
    """What differs between the provenance of two runs so that results of one do not belong to the other; empty if nothing does."""
    adapters = earlier["adapters"] | stamp["adapters"]
    codes = [f"the code of {label}" for label in adapters if earlier["adapters"].get(label) != stamp["adapters"].get(label)]
    asked = [name for name in ("engines", "dts", "time_limit", "quick") if earlier["asked"].get(name) != stamp["asked"][name]]
    words = {"engines": "the engines", "dts": "the time steps", "time_limit": "the time limit", "quick": "the option --quick"}
    words |= {"code": "dropspin", "cpu": "the processor"}
    rest = [name for name in ("versions", "python", "cpu", "code") if earlier[name] != stamp[name]]
    return " and ".join([*(words.get(name, name) for name in asked), *([] if asked else codes), *(words.get(name, name) for name in rest)])


def measure(scene: SceneLike, motion: Trajectory) -> dict[str, float]:
    """Every metric that a scene has, of one motion.

    Args:
        scene: A scene, its catalogue name, the path of its file, or a mapping with the same keys.
        motion: The motion, from the scene's start, at equal time steps.

    Returns:
        By name, in the unit that `METRICS` has for it; NaN where the time step is too coarse.

    Raises:
        DropspinError: There is no such scene, or the motion is not a `Trajectory`, or not one of this scene: it has another start or
            frame, other units, or unequal steps.
    """
    scene = as_scene(scene)
    if not isinstance(motion, Trajectory):
        raise DropspinError(f"motion: got a {type(motion).__name__}; give a Trajectory, such as simulate() returns.")
    truth = truth_for(scene)
    verify_motion(scene, truth, motion)
    case = Comparison.with_truth(scene, motion, truth)
    return {metric.name: metric.value_or_nan([case]) for metric in metrics_for(scene, truth)}
