"""A run: scenes × engines × time steps, measured against exact solutions and against each other, and judged."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from itertools import product
from threading import Lock
from typing import Any

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.engines.stand_in import code_of
from dropspin.comparisons.judging.expectations import verify_expectations
from dropspin.comparisons.measuring.batch_quantities import compile_states
from dropspin.comparisons.measuring.metrics import values_of
from dropspin.comparisons.results.provenance import provenance
from dropspin.comparisons.results.results import Results, joined
from dropspin.comparisons.running.arguments import (
    DEFAULT_DTS,
    EngineEntry,
    SceneLike,
    as_scene,
    as_scenes,
    ignore,
    several,
    verify_time_step,
)
from dropspin.comparisons.running.engine_entries import engine_entries
from dropspin.comparisons.running.forecast import Forecast, forecast
from dropspin.comparisons.running.foreign_motions import verify_motion
from dropspin.comparisons.running.parallel import started_crews, work_in_parallel
from dropspin.comparisons.running.process_limits import FIVE_MINUTES, ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.progress import OnProgress, Progress
from dropspin.comparisons.running.scene_run import run_scene
from dropspin.comparisons.running.start_phases import StartPhase
from dropspin.comparisons.running.timing import time_engines
from dropspin.scenarios import DropspinError, Trajectory, reference_for, truth_for


def run(
    scenes: SceneLike | Iterable[SceneLike],
    engines: Engine | str | Iterable[Engine | str],
    dt: float | Iterable[float] = DEFAULT_DTS,
    *,
    on_progress: OnProgress | None = None,
    resources: ResourceLimits = FIVE_MINUTES,
    keep: Callable[[Results], None] | None = None,
    done: Iterable[Results] = (),
    jobs: int | None = None,
    quick: bool = False,
    on_forecast: Callable[[Forecast], None] | None = None,
) -> Results:
    """Run every scene with every engine at every time step, compute the metrics, and judge them.

    Args:
        scenes: One scene or several, with different names: each a scene, a catalogue name, the path of a file, or a mapping with the same
            keys.
        engines: One engine or several: engines, or names with options. In the results, an engine that is not installed is `missing`, and
            one that cannot be imported or constructed is `broken`.
        dt: One time step or several [s]; three or more that span a factor of four give orders and asymptotic errors.
        on_progress: Called with the scene, the engine, the time step and the number of completed simulations: before an engine begins,
            twice a second while it runs, and with `finished` after each combination of scene, engine and time step. Calls may come from any
            thread, but never at the same time.
        resources: The processor time [s] and memory [bytes] that an engine may use for one scene at one time step; each engine runs in a
            separate process.
        keep: Called with the results of each scene as soon as it is done.
        done: Results of scenes from an earlier run. Those with the same request, versions and machine are not run again.
        jobs: Number of scenes to run at a time; by default, the number of processors that this process may use. It changes no result,
            because time steps are timed first, while nothing else runs.
        quick: Whether to run from fewer initial states: 8 instead of 32 start phases, 16 members of an ensemble, and no perturbed initial
            states in double precision. A check whose outcome may depend on sampling noise has the verdict `measured`. Intervals are
            wider than in a full run. The results have no tolerances, so `check` with a baseline, `accept`, `compare` and `history` refuse
            them.
        on_forecast: Called once, after the time steps were timed, with the time that the simulations will take.

    Returns:
        The measurements with their verdicts, the predicted errors, the differences between engines, and the motions.

    Raises:
        DropspinError: An engine is unknown, a time step is impossible, or two scenes have the same name.
    """
    engines = several("engines", engines)
    requested, entries, dts, stamp = _request(scenes, engines, dt, resources, quick)
    earlier = {scene.model_dump_json(): part for part in done for scene in part.scenes.values() if not what_changed(part.provenance, stamp)}
    parts: dict[str, Results] = {}
    lock, keep, tell = Lock(), keep or ignore, on_progress or ignore

    def report(progress: Progress) -> None:
        with lock:
            tell(progress)

    for scene in (own.scene for own in requested if own.scene.model_dump_json() in earlier):
        parts[scene.name] = replace(earlier[scene.model_dump_json()], scenes={scene.name: scene})
        for entry, step in product(entries, dts):
            report(Progress(scene.name, entry.label, step, finished=True))
    reused = list(parts.values())
    pending = [own for own in requested if own.scene.name not in parts]
    for own in pending[:1]:
        compile_states(own.scene)
    with started_crews(jobs, len(pending), entries, resources) as crews:
        timings = time_engines([own.scene for own in pending], entries, dts, crews[0], report)
        expected = forecast(pending, entries, dts, timings, len(crews))
        (on_forecast or ignore)(expected)

        def of_scene(own: StartPhase, processes: EngineProcesses) -> Results:
            return run_scene(own, entries, dts, processes, report, stamp, timings)

        def on_done(own: StartPhase, part: Results) -> None:
            parts[own.scene.name] = part
            keep(part)

        if len(crews) > 1:  # the longest first, so that no processor is idle while another one ends a long scene
            pending = sorted(pending, key=lambda own: -expected.by_scene[own.scene.name])
        work_in_parallel(iter(pending), of_scene, crews, on_done)
    compiled = [(label, timing.compilation) for (_, label, _), timing in timings.items() if timing.compilation > 0.0]
    stamp["compilation"] = {label: max(longest for one, longest in compiled if one == label) for label, _ in compiled}
    results = joined([parts[own.scene.name] for own in requested], stamp)
    if any(what_changed(part.provenance, results.provenance) for part in reused):  # of the versions that engines report
        chosen = [own.scene for own in requested]
        return run(chosen, engines, dts, on_progress=on_progress, resources=resources, keep=keep, jobs=jobs, quick=quick)
    return results


def _request(
    scenes: SceneLike | Iterable[SceneLike], asked: list[Engine | str], dt: float | Iterable[float], resources: ResourceLimits, quick: bool
) -> tuple[list[StartPhase], list[EngineEntry], list[float], dict[str, Any]]:
    """The scenes with their exact solutions, the engines, the time steps [s] and the provenance of a request.

    Raises:
        DropspinError: The request cannot be run.
    """
    chosen = as_scenes(scenes)
    entries, dts = engine_entries(asked, resources=resources), several("dt", dt)
    for name, given in (("scenes", chosen), ("engines", entries), ("dt", dts)):
        if not given:
            raise DropspinError(f"{name}: got none; give at least one.")
    for scene, step in product(chosen, dts):
        verify_time_step(scene, step, len(entries))
    dts = list(map(float, dts))
    labels = [entry.label for entry in entries]
    requested = [StartPhase(scene, reference_for(scene), quick) for scene in chosen]
    for scene, truth, *_ in requested:
        verify_expectations(scene, truth, labels)
    if len(set(dts)) < len(dts):
        raise DropspinError(f"dt: a time step is given twice ({', '.join(f'{step:g}' for step in dts)}); give each once.")
    names = [scene.name for scene in chosen]
    asked_for = {"scenes": names, "engines": labels, "dts": dts, "time_limit": resources.processor_time, "quick": quick}
    adapters = {entry.label: code_of(entry.engine) for entry in entries if entry.engine is not None}
    by_name = {entry.label: name.strip() for entry, name in zip(entries, asked, strict=True) if isinstance(name, str)}
    return requested, entries, dts, provenance(asked_for) | {"names": by_name, "adapters": adapters}


def what_changed(earlier: Mapping[str, Any], stamp: Mapping[str, Any]) -> str:
    """What differs between the provenance of two runs so that results of one do not belong to the other; empty if nothing does."""
    adapters = earlier["adapters"] | stamp["adapters"]
    codes = [f"the code of {label}" for label in adapters if earlier["adapters"].get(label) != stamp["adapters"].get(label)]
    asked = [name for name in ("engines", "dts", "time_limit", "quick") if earlier["asked"].get(name) != stamp["asked"][name]]
    words = {"engines": "the engines", "dts": "the time steps", "time_limit": "the time limit", "quick": "the option --quick"}
    words |= {"code": "dropspin", "cpu": "the processor"}
    rest = [name for name in ("versions", "python", "cpu", "code") if earlier[name] != stamp[name]]
    then, now = _reported_versions(earlier), _reported_versions(stamp)
    codes += [f"the version of {label}" for label in then if label in now and then[label] != now[label]]
    changed = [*asked, *([] if asked else codes), *rest]
    return " and ".join(words.get(name, name) for name in changed)


def _reported_versions(stamp: Mapping[str, Any]) -> dict[str, set[str]]:
    """The versions that the engines reported in their scenes, such as those of a package that `versions` does not name."""
    cases = {label: of_scenes.values() for label, of_scenes in stamp.get("settings", {}).items()}
    reported = {label: {str(one["version"]) for one in settings if "version" in one} for label, settings in cases.items()}
    return {label: found for label, found in reported.items() if found}


def measure(scene: SceneLike, motion: Trajectory) -> dict[str, float]:
    """Compute every metric of a scene for one motion.

    Args:
        scene: A scene, its catalogue name, the path of its file, or a mapping with the same keys.
        motion: The motion, from the initial state of the scene, with equal time steps.

    Returns:
        The value of each metric by name, in the unit that `METRICS` states; NaN if the time step is too large.

    Raises:
        DropspinError: There is no such scene, or the motion is not a `Trajectory`, or not one of this scene: it has another start or
            frame, other units, or unequal steps.
    """
    scene = as_scene(scene)
    if not isinstance(motion, Trajectory):
        raise DropspinError(f"motion: got a {type(motion).__name__}; give a Trajectory, such as simulate() returns.")
    verify_motion(scene, truth_for(scene), motion)
    return values_of(scene, reference_for(scene), motion)
