"""The main job: scenes × engines × time steps, measured against truth and against each other, and judged."""

import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np

from comparisons.building import assert_built_as_meant, sound_record
from comparisons.comparison import Comparison, Unresolved
from comparisons.engines.base import Diverged, Engine, EngineMissing
from comparisons.engines.registry import engine as engine_named
from comparisons.metrics import METRICS, Average, Metric, metrics_for
from comparisons.phases import start_phases
from comparisons.provenance import provenance
from comparisons.results import Results, TrajectoryKey, as_frame
from comparisons.studies import study_rows
from comparisons.verdicts import assert_expectations_can_be_judged, judge
from scenarios import DropspinError, Scenario, Trajectory, Truth, truth_for

DEFAULT_DTS = (4e-3, 2e-3, 1e-3)
TIMED_REPEATS = 3
LEAST_STEPS = 4
MOST_STEPS = 2_000_000  # of one run; 32 start phases of that many are what a machine's memory holds

Progress = Callable[[str, str, float], None]
Row = dict[str, Any]


def simulate(scene: Scenario, engine: str | Engine, dt: float, every: int = 1) -> Trajectory:
    """Run one scene through one engine.

    Args:
        scene: The scene.
        engine: An engine, or its name with options, such as `mujoco[integrator=rk4]`.
        dt: Time step [s].
        every: Steps between two rows.

    Returns:
        The motion, the start as its first row.

    Raises:
        DropspinError: There is no such engine, it is not installed, or it declines the scene.
        Diverged: The engine gave up.
    """
    chosen = engine_named(engine) if isinstance(engine, str) else engine
    assert_step_fits(scene, dt)
    refusal = chosen.declines(scene)
    if refusal is not None:
        raise DropspinError(f"{chosen.label} declines {scene.name}: {refusal}.")
    motion, limits = _motion(scene, chosen, dt, every)
    for limit in limits:
        warnings.warn(limit, stacklevel=2)
    return motion


def _motion(scene: Scenario, engine: Engine, dt: float, every: int = 1) -> tuple[Trajectory, Sequence[str]]:
    """What an engine does with a scene, checked, and which of its limits it met."""
    with engine.prepare(scene, dt) as simulation:
        assert_built_as_meant(engine, scene, simulation)
        states = sound_record(simulation.record(scene.steps(dt), every), 1 + scene.steps(dt) // every)
        lag = 0.5 * dt if simulation.staggered else 0.0
        limits = simulation.limits
    return Trajectory.from_states(dt * every * np.arange(len(states), dtype=float), states, lag), limits


def run(
    scenes: Sequence[Scenario],
    engines: Sequence[str | Engine],
    dts: Sequence[float] = DEFAULT_DTS,
    progress: Progress = lambda scene, engine, dt: None,
) -> Results:
    """Run every scene through every engine at every step, measure, and judge.

    Args:
        scenes: The scenes; their names must differ.
        engines: Engines, or names with options. One that is not installed is `missing` in the results, and the rest runs.
        dts: Time steps [s].
        progress: Called with scene, engine and step after each of len(scenes) * len(engines) * len(dts) pieces of work.

    Raises:
        DropspinError: Something was asked for that cannot be: an unknown engine, a step that is no step, equal names.
    """
    contestants = [_contestant(name) for name in engines]
    labels = [contestant.label for contestant in contestants]
    truths = [truth_for(scene) for scene in scenes]
    _assert_sensible(scenes, truths, dts, labels)
    if len(set(labels)) < len(labels):
        raise DropspinError(f"an engine is named twice: {', '.join(labels)}; name each once.")
    asked = {"scenes": [scene.name for scene in scenes], "engines": labels, "dts": list(dts)}
    stamp = provenance(asked)
    rows: list[Row] = []
    trajectories: dict[TrajectoryKey, Trajectory] = {}
    settings: dict[str, dict[str, Any]] = {}
    for scene, truth in zip(scenes, truths, strict=True):
        measured: dict[str, list[Row]] = {label: [] for label in labels}
        for dt in dts:
            phases = [(phase, truth if phase is scene else truth_for(phase)) for phase in start_phases(scene, truth, dt)]
            attempts: list[_Attempt] = []
            for contestant in contestants:
                attempt = _attempt(contestant, scene, dt, [phase for phase, _ in phases])
                if attempt.motion is not None:
                    trajectories[scene.name, contestant.label, dt] = attempt.motion
                    settings.setdefault(contestant.label, {})[f"{scene.name} dt={dt:g}"] = attempt.settings
                measured[contestant.label] += _truth_rows(scene, dt, attempt, phases)
                attempts.append(attempt)
                progress(scene.name, contestant.label, dt)
            for first, second in combinations(attempts, 2):
                rows += _agreement_rows(scene, dt, first, second, phases)
        for contestant in contestants:
            rows += measured[contestant.label]
            if contestant.engine is not None:
                rows += study_rows(scene, contestant.engine, measured[contestant.label])
    by_name = {scene.name: scene for scene in scenes}
    return Results(as_frame(rows), by_name, tuple(labels), trajectories, stamp | {"settings": settings})


def measure(scene: Scenario, motion: Trajectory) -> dict[str, float]:
    """Every metric that the scene has, of one motion; NaN where the step is too coarse for it."""
    truth = truth_for(scene)
    case = Comparison.with_truth(scene, motion, truth)
    return {metric.name: _value_or_nan(metric, case) for metric in metrics_for(scene, truth)}


@dataclass(frozen=True)
class _Contestant:
    label: str
    engine: Engine | None
    missing: str = ""


@dataclass
class _Attempt:
    """What came of one engine on one scene at one step."""

    label: str
    discretisation: str | None = None
    verdict: str = ""
    reason: str = ""
    motion: Trajectory | None = None
    phases: list[Trajectory] = field(default_factory=list)
    limits: Sequence[str] = ()
    settings: dict[str, Any] = field(default_factory=dict)
    time_per_step: float = float("nan")


def _contestant(chosen: str | Engine) -> _Contestant:
    if isinstance(chosen, Engine):
        return _Contestant(chosen.label, chosen)
    try:
        created = engine_named(chosen)
    except EngineMissing as error:
        return _Contestant(chosen.strip(), None, str(error))
    return _Contestant(created.label, created)


def _attempt(contestant: _Contestant, scene: Scenario, dt: float, phases: list[Scenario]) -> _Attempt:
    engine = contestant.engine
    attempt = _Attempt(contestant.label, engine.discretisation(scene) if engine else None)
    if engine is None:
        attempt.verdict, attempt.reason = "missing", contestant.missing
        return attempt
    try:
        refusal = engine.declines(scene)
        if refusal is not None:
            attempt.verdict, attempt.reason = "declined", refusal
            return attempt
        attempt.motion, attempt.limits = _motion(scene, engine, dt)
        attempt.phases = [attempt.motion] if phases == [scene] else [_motion(phase, engine, dt)[0] for phase in phases]
        attempt.settings, attempt.time_per_step = _settings_and_time(engine, scene, dt)
    except Diverged as error:
        attempt.verdict, attempt.reason = "diverged", str(error)
    except Exception as error:  # an engine is somebody else's code: whatever it raises costs its own row and is told there
        attempt.verdict, attempt.reason = "crashed", f"{type(error).__name__}: {error}"
    return attempt


def _settings_and_time(engine: Engine, scene: Scenario, dt: float) -> tuple[dict[str, Any], float]:
    """The engine's stamp, and the least of three timings of its native stepping alone [s per step]."""
    steps = scene.steps(dt)
    timings = []
    for _ in range(TIMED_REPEATS):
        with engine.prepare(scene, dt) as simulation:
            settings = dict(simulation.settings)
            start = time.perf_counter()
            simulation.advance(steps)
            timings.append(time.perf_counter() - start)
    return settings, min(timings) / steps


def _truth_rows(scene: Scenario, dt: float, attempt: _Attempt, phases: list[tuple[Scenario, Truth | None]]) -> list[Row]:
    steps = scene.steps(dt)
    shared: Row = {"scene": scene.name, "engine": attempt.label, "dt": dt, "time_per_step": attempt.time_per_step, "steps": steps}
    if attempt.verdict:
        return [shared | {"verdict": attempt.verdict, "reason": attempt.reason}]
    assert attempt.motion is not None
    bad = next((motion for motion in [attempt.motion, *attempt.phases] if motion.first_bad_row is not None), None)
    if bad is not None:
        reason = f"the state is not finite at t = {bad.t[bad.first_bad_row]:g} s"
        return [shared | {"verdict": "diverged", "reason": reason}]
    cases = [Comparison.with_truth(phase, motion, truth) for (phase, truth), motion in zip(phases, attempt.phases, strict=True)]
    truth = phases[0][1]
    rows = [shared | {"verdict": "limited", "reason": limit} for limit in attempt.limits]
    for metric in metrics_for(scene, truth):
        row = shared | {"metric": metric.name, "unit": metric.unit, "kind": metric.kind}
        if metric.kind == "truth" and truth is not None:
            row["truth"] = truth.name
        rows.append(row | _measured(scene, dt, attempt.label, metric, cases))
    if truth is None:
        rows.append(shared | {"verdict": "no_truth", "reason": "no closed form is known for this scene"})
    return rows


def _measured(scene: Scenario, dt: float, label: str, metric: Metric, cases: list[Comparison]) -> Row:
    """A metric's mean over the start phases, judged."""
    try:
        with np.errstate(all="ignore"):  # an engine may say 1e300; what comes of it is inf or NaN, and judged as such
            average = metric.average(cases)
        unresolved = ""
    except Unresolved as error:
        average, unresolved = Average(np.array([np.nan]), np.array([np.nan])), str(error)
    value = average.value
    judgement = judge(scene, label, dt, metric, value)
    reason = "; ".join(filter(None, [unresolved, judgement.reason]))
    # What should be a number and is none is a failure, expected or not; what the step cannot resolve fails only what was expected.
    verdict = "failed" if np.isnan(value) and not unresolved else judgement.verdict
    if verdict == "failed" and not reason:
        reason = "not a number: what is measured here never happened"
    cause = "unresolved" if unresolved else ""
    measurement = {"value": value, "lower": judgement.lower, "upper": judgement.upper, "verdict": verdict, "cause": cause, "reason": reason}
    return measurement | {"average": average}


def _agreement_rows(
    scene: Scenario, dt: float, first: _Attempt, second: _Attempt, phases: list[tuple[Scenario, Truth | None]]
) -> list[Row]:
    """How far two engines are apart, by the metrics that mean something between engines."""
    if first.verdict or second.verdict or any(m.first_bad_row is not None for m in first.phases + second.phases):
        return []
    cases = [
        _side_by_side(phase, truth, one, other) for (phase, truth), one, other in zip(phases, first.phases, second.phases, strict=True)
    ]
    shared: Row = {"scene": scene.name, "engine": first.label, "dt": dt, "kind": "agreement", "truth": second.label}
    shared["steps"] = scene.steps(dt)
    if first.discretisation is not None and first.discretisation == second.discretisation:
        shared["reason"] = f"no evidence: both are {first.discretisation}"
    rows = []
    for metric in METRICS.values():
        if not (metric.agreement and metric.applies(scene, phases[0][1] or _as_truth(second.phases[0]))):
            continue
        try:
            found: Row = {"value": metric.average(cases).value}
        except Unresolved as error:
            found = {"cause": "unresolved", "reason": "; ".join(filter(None, [shared.get("reason"), str(error)]))}
        rows.append(shared | {"metric": metric.name, "unit": metric.unit, "verdict": "measured"} | found)
    return rows


def _side_by_side(scene: Scenario, truth: Truth | None, one: Trajectory, other: Trajectory) -> Comparison:
    """Two engines' motions as far as they can be compared: to the truth's horizon, else to the first contact of either."""
    if truth is not None:
        until = int(np.sum(truth.covers(one.t)))
        return Comparison(scene, one, other[:until], tuple(event.time for event in truth.events))
    contacts = [Comparison(scene, motion).first_contact for motion in (one, other)]
    until = min([len(one), *(contact[0] + 1 for contact in contacts if contact is not None)])
    return Comparison(scene, one[: max(until, 2)], other[: max(until, 2)])


def _as_truth(motion: Trajectory) -> Truth:
    """An engine's motion in the place of a truth, to ask which metrics have something to compare."""
    return Truth("engine", "", lambda t: motion.states[: len(t)])


def _value_or_nan(metric: Metric, case: Comparison) -> float:
    try:
        return metric.average([case]).value
    except Unresolved:
        return float("nan")


def _assert_sensible(scenes: Sequence[Scenario], truths: Sequence[Truth | None], dts: Sequence[float], labels: Sequence[str]) -> None:
    names = [scene.name for scene in scenes]
    if len(set(names)) < len(names):
        raise DropspinError(f"two scenes have the same name ({', '.join(names)}); a scene's name is its file's, rename one.")
    if len(set(dts)) < len(dts):
        raise DropspinError(f"dt: a step is named twice ({', '.join(f'{dt:g}' for dt in dts)}); name each once.")
    for scene, truth in zip(scenes, truths, strict=True):
        assert_expectations_can_be_judged(scene, truth, labels)
        for dt in dts:
            assert_step_fits(scene, dt)


def assert_step_fits(scene: Scenario, dt: float) -> None:
    """Raise `DropspinError` unless a scene is a sensible number of steps of dt [s]."""
    if not (np.isfinite(dt) and dt > 0.0 and LEAST_STEPS <= scene.duration / dt + 1e-9 <= MOST_STEPS):
        raise DropspinError(
            f"dt: got {dt!r} s; scene {scene.name!r} lasts {scene.duration:g} s, so a step must be "
            f"at least {scene.duration / MOST_STEPS:g} s and at most {scene.duration / LEAST_STEPS:g} s."
        )
