"""What an adapter is held to, one check after the other, each in the engine's own process."""

import json
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import chdir
from typing import Any, Literal, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from comparisons.conformance.fault_models import explained, explained_start
from comparisons.conformance.probes import DT, PROBES, Probe, differences
from comparisons.engines.base import Diverged, Engine, EngineMissing, KnownLimitation
from comparisons.running.processes import EngineProcesses, Failed, ResourceLimits
from comparisons.running.recording import EngineEntry, engine_entry, record
from comparisons.running.verification import ULPS, BuildMismatch, verified_record, verify_build, verify_start
from scenarios import Scenario, load, names, truth_for
from scenarios.errors import UnknownName
from scenarios.rotations import angle_between_orientations
from scenarios.truths import LAWS, Law

Array = NDArray[np.float64]
CheckOutcome = Literal["passed", "failed", "noted", "declined", "crashed", "timed_out"]


A_FEW_STEPS = 24
SEVERAL = 3
STEPS_TRIED = (0.01, 0.0025, 0.00025)
NEAR_ENOUGH = 0.02
"""Of a step, that a row may be off its time; an engine with some damping is not yet out of time."""
LATE = 0.3
"""Of a step, that attitude or velocity may be off the time of their row."""
HARMLESS = 1e-9
"""Of the largest number, by which steps taken together may differ from steps taken one by one, and be told only."""


class CheckResult(NamedTuple):
    """The outcome of one check, and what was found."""

    check: str
    outcome: CheckOutcome
    message: str


class Wrong(Exception):
    """What is wrong, in words."""


class Declined(Exception):
    """The engine runs none of the scenes that would show it."""


def conform(
    engine: Engine | str,
    checks: Sequence[str] = (),
    *,
    resources: ResourceLimits = ResourceLimits(processor_time=60.0),  # noqa: B008 - it is immutable
) -> list[CheckResult]:
    """Check an adapter against the protocol, and its motions against reference motions.

    Args:
        engine: The engine, or its name.
        checks: The checks to make; all if none is named.
        resources: What each check may use.

    Raises:
        UnknownName: There is no such check.
    """
    for unknown in set(checks) - CHECKS.keys():
        raise UnknownName("check", unknown, CHECKS)
    entry = engine_entry(engine)
    if entry.engine is None:
        raise EngineMissing(entry.missing)
    found = []
    with EngineProcesses(resources) as processes:
        for check in checks or CHECKS:
            try:
                found.append(processes.call(entry, _check, check))
            except Failed as failure:
                found.append(CheckResult(check, cast(CheckOutcome, failure.verdict), failure.reason))
    return found


def _check(entry: EngineEntry, check: str) -> CheckResult:
    assert entry.engine is not None
    try:
        return CHECKS[check](entry.engine, check)
    except (Wrong, BuildMismatch) as wrong:
        return CheckResult(check, "failed", str(wrong))
    except Declined as declined:
        return CheckResult(check, "declined", str(declined))
    except Diverged as diverged:
        return CheckResult(check, "failed", f"the engine gave up: {diverged}")


def _claims(engine: Engine, check: str) -> CheckResult:
    """What the class says of itself."""
    order = engine.order
    if not (order is None or (isinstance(order, int | float) and order > 0)):
        raise Wrong(f"order is {order!r}; it is None for no claim, a number above 0, or inf for exact")
    if engine.precision not in (np.float32, np.float64):
        raise Wrong(f"precision is {engine.precision!r}; it is numpy.float64 or numpy.float32")
    return CheckResult(check, "passed", f"order {order if order is not None else 'not claimed'}, {np.dtype(engine.precision).name}")


def _reasons(engine: Engine, check: str) -> CheckResult:
    """A scene is declined with a reason."""
    scenes = [load(name) for name in names()]
    for scene in [*scenes, *(probe.scene for probe in PROBES)]:
        answer = engine.declines(scene)
        if answer != engine.declines(scene):
            raise Wrong(f"declines({scene.name}) says {answer!r}, and then {engine.declines(scene)!r}; it says the same each time")
        if not (answer is None or (isinstance(answer, str) and answer.strip())):
            raise Wrong(f"declines({scene.name}) says {answer!r}; it says None, or why in a sentence")
    declined = sum(engine.declines(scene) is not None for scene in scenes)
    if declined == len(scenes):
        raise Wrong(f"every scene of the catalogue is declined; {scenes[0].name}: {engine.declines(scenes[0])}")
    return CheckResult(check, "passed", f"{len(scenes) - declined} scenes of the catalogue are run, {declined} declined with a reason")


def _builds(engine: Engine, check: str) -> CheckResult:
    """What is built is what was meant, in the probes and in every scene of the catalogue."""
    told = 0
    for scene in [TELLING, *(probe.scene for probe in PROBES), *(load(name) for name in names())]:
        if engine.declines(scene) is not None:
            continue
        try:
            told += _built(engine, scene)
        except (Wrong, BuildMismatch) as wrong:
            raise Wrong(f"{scene.name}: {wrong}") from None
        except Diverged:
            raise
        except Exception as error:
            raise Wrong(f"{scene.name}: {type(error).__name__}: {error}; what cannot be run is declined, with a reason") from error
    if not told:
        return CheckResult(check, "passed", "the start is the scene's; as_built says nothing of mass, inertia and gravity")
    return CheckResult(check, "passed", f"start, mass, inertia and gravity are the scene's to {ULPS} ulp")


def _built(engine: Engine, scene: Scenario) -> bool:
    """Whether the engine could say what it has built of a scene."""
    with engine.prepare(scene, DT) as simulation:
        state = simulation.state()
        if not (isinstance(state, np.ndarray) and state.shape == (13,) and np.isrealobj(state)):
            raise Wrong(f"state() gives {_kind(state)}; it is an array of 13 real numbers, shape (13,)")
        if not np.isfinite(state).all():
            raise Wrong(f"the state at the start is not finite: {state.tolist()}")
        try:
            verify_start(engine, scene, state)
        except BuildMismatch as error:
            raise Wrong(_start_in_words(engine, scene, state) or str(error)) from None
        verify_build(engine, scene, simulation)
        verified_record(simulation.record(A_FEW_STEPS), 1 + A_FEW_STEPS)
        return simulation.as_built() is not None


def _start_in_words(engine: Engine, scene: Scenario, state: Array) -> str:
    single = float(ULPS * np.finfo(np.float32).eps)
    near = np.abs(state - scene.initial_state).max() <= single * np.abs(scene.initial_state).max()
    if engine.precision is np.float64 and near and np.array_equal(state, np.float32(state)):
        return "the state carries single precision; declare precision = numpy.float32, or hand the start over undiminished"
    fault = explained_start(scene, state, single)
    return "" if fault is None else fault.message


def _rows(engine: Engine, check: str) -> CheckResult:
    """`record` and `advance` take the same steps."""
    scene = _run_by(engine)
    with engine.prepare(scene, DT) as simulation:
        rows = verified_record(simulation.record(A_FEW_STEPS), 1 + A_FEW_STEPS)
        end = simulation.state().copy()
    with engine.prepare(scene, DT) as simulation:
        sparse = verified_record(simulation.record(A_FEW_STEPS, every=SEVERAL), 1 + A_FEW_STEPS // SEVERAL)
    with engine.prepare(scene, DT) as simulation:
        one_by_one = [simulation.state().copy()]
        for _ in range(A_FEW_STEPS):
            simulation.advance(1)
            one_by_one.append(simulation.state().copy())
        again = verified_record(simulation.record(SEVERAL), 1 + SEVERAL)
    stepped = np.array(one_by_one)
    with engine.prepare(scene, DT) as simulation:
        simulation.advance(SEVERAL)
        _assert_alike(simulation.state(), stepped[SEVERAL], f"advance({SEVERAL}) is not {SEVERAL} times advance(1)")
    if engine.precision is np.float64 and np.array_equal(stepped[1:], np.float32(stepped[1:])):
        raise Wrong("states after the start carry single precision; declare precision = numpy.float32, or hand them over undiminished")
    _assert_alike(rows[0], stepped[0], "record's first row is not the state now; it is the state before any step")
    _assert_alike(rows, stepped, f"record({A_FEW_STEPS}) gives other states than advance(1) and state(), {A_FEW_STEPS} times")
    if _off(sparse, rows[::SEVERAL]) > HARMLESS and _off(sparse, rows[: len(sparse)]) <= HARMLESS:
        raise Wrong(f"record ignores `every`: with every={SEVERAL} its rows are one step apart")
    _assert_alike(sparse, rows[::SEVERAL], f"record with every={SEVERAL} does not give each third row of every=1")
    _assert_alike(rows[-1], end, "after record, state() is not the last row")
    _assert_alike(again[0], stepped[-1], "a second record does not begin where the simulation stands")
    if not np.array_equal(rows, stepped):
        return CheckResult(check, "noted", f"record and advance differ by rounding, {_off(rows, stepped):.1g}")
    return CheckResult(check, "passed", "record and advance take the same steps, bit for bit")


def _assert_alike(found: Array, meant: Array, otherwise: str) -> None:
    off = _off(found, meant)
    if not off <= HARMLESS:
        raise Wrong(f"{otherwise} (off by {off:.2g})")


def _off(found: Array, meant: Array) -> float:
    """The largest difference, of the largest number; infinite where one is not finite."""
    off = float(np.max(np.abs(found - meant)) / np.max(np.abs(meant)))
    return off if np.isfinite(off) else float("inf")


def _clock(engine: Engine, check: str) -> CheckResult:
    """Rows are as far apart in time as asked, and of one time: place, attitude and velocity are clocks."""
    lengths = {dt: _ticks(engine, "coasting", dt, _place) for dt in STEPS_TRIED}
    asked = ", ".join(f"{dt:g}" for dt in STEPS_TRIED)
    told = np.array([float(np.diff(ticks).mean()) * dt for dt, ticks in lengths.items()])
    for dt, ticks in lengths.items():
        between = np.diff(ticks)
        if np.ptp(between) > NEAR_ENOUGH * max(abs(between.mean()), 1.0):
            raise Wrong(f"rows are not uniform in time: at dt = {dt:g} s from {between.min() * dt:.4g} to {between.max() * dt:.4g} s apart")
    if not np.allclose(told, STEPS_TRIED, rtol=NEAR_ENOUGH):
        if np.ptp(told) <= NEAR_ENOUGH * abs(told[0]):
            raise Wrong(f"a step is {told[0]:.5g} s long, whatever dt is asked for ({asked} s)")
        raise Wrong(f"steps of {asked} s are {', '.join(f'{length:.5g}' for length in told)} s long, by the way a free ball goes")
    for what, probe, clock in (("the attitude", "turning", _attitude), ("velocity", "falling straight", _velocity)):
        try:
            ticks = _ticks(engine, probe, STEPS_TRIED[0], clock)
        except Declined:
            continue
        late = float(np.median(np.arange(len(ticks)) - ticks))
        if abs(late) > LATE:
            raise Wrong(f"{what} is {late:.2g} steps late: it belongs to another time than the row")
    return CheckResult(check, "passed", f"steps are as long as asked, {asked} s")


def _ticks(engine: Engine, probe: str, dt: float, clock: Callable[[Scenario, Array], Array]) -> Array:
    """The steps since the start that each row is at, by a clock."""
    scene = _run_by(engine, probe)
    rows = _record(engine, scene, dt)
    ticks = clock(scene, rows) / dt
    if not np.isfinite(ticks).all():
        raise Wrong(f"the state is not finite after {A_FEW_STEPS} steps of {dt:g} s")
    return ticks


def _place(scene: Scenario, rows: Array) -> Array:
    speed = np.array(scene.start.velocity)
    return (rows[:, :3] - scene.start.position) @ speed / (speed @ speed)


def _attitude(scene: Scenario, rows: Array) -> Array:
    turned = angle_between_orientations(np.broadcast_to(scene.start.orientation, (len(rows), 4)), rows[:, 3:7])
    return turned / np.linalg.norm(scene.start.angular_velocity)


def _velocity(scene: Scenario, rows: Array) -> Array:
    g = scene.acceleration
    return (rows[:, 7:10] - scene.start.velocity) @ g / (g @ g)


def _stagger(engine: Engine, check: str) -> CheckResult:
    """Whether velocity lags position by half a step is what the simulation says; from how far a fall runs ahead."""
    scene = _run_by(engine, "falling", "falling straight")
    steps, g = scene.steps(DT), scene.acceleration
    with engine.prepare(scene, DT) as simulation:
        said = simulation.staggered
        end = verified_record(simulation.record(steps), 1 + steps)[-1]
    if not np.isfinite(end).all():
        raise Wrong("the state is not finite after a fall")
    truth = truth_for(scene)
    assert truth is not None
    ahead = (end[:3] - truth(steps * DT).position[0]) @ g / (0.5 * g @ g * steps * DT * DT)
    lag = round(float(ahead))
    if abs(ahead) > 1.5 or abs(ahead - lag) > 0.25:
        return CheckResult(check, "noted", f"the position after a fall is {ahead:.3g} half-steps' fall ahead, as in no known scheme")
    if lag == 1 and not said:
        raise Wrong("a fall runs ahead by half a step, as in semi-implicit Euler, where velocity lags position; set staggered = True")
    if lag == 0 and said:
        raise Wrong("staggered is True, but velocity and position are of the same time; set staggered = False")
    if lag == -1:
        return CheckResult(check, "noted", "a fall lags by half a step, as in explicit Euler")
    return CheckResult(check, "passed", "velocity lags position by half a step" if said else "velocity and position are of the same time")


def _repeats(engine: Engine, check: str) -> CheckResult:
    """The same scene gives the same bits, whatever else runs in the process."""
    a, b = _run_by(engine), _run_by(engine, "turning", "coasting")
    first, stepped = _record(engine, a), _stepped(engine, a)
    if not all(_same(first, _record(engine, a)) and _same(stepped, _stepped(engine, a)) for _ in range(SEVERAL)):
        raise Wrong("the same scene gives other bits when it is run again: something is random, or is kept from run to run")
    with engine.prepare(b, 4 * DT) as other:
        other.advance(A_FEW_STEPS)
        if not _same(first, _record(engine, a)):
            raise Wrong("the same scene gives other bits while another simulation is open: they share something")
        if not _same(stepped, _stepped(engine, a, lambda: other.advance(A_FEW_STEPS))):
            raise Wrong("two simulations that take turns disturb each other: they share something")
    if not _same(first, _record(engine, a)):
        raise Wrong("the same scene gives other bits after another one: A, B, A; something is left behind")
    return CheckResult(check, "passed", "A, B, A gives the same bits, and so do simulations that take turns")


def _same(one: Array, other: Array) -> bool:
    return np.array_equal(one, other, equal_nan=True)


def _stepped(engine: Engine, scene: Scenario, between: Callable[[], None] = lambda: None) -> Array:
    """The state after two runs of steps, with something else between them."""
    with engine.prepare(scene, DT) as simulation:
        simulation.advance(A_FEW_STEPS // 2)
        between()
        simulation.advance(A_FEW_STEPS - A_FEW_STEPS // 2)
        return simulation.state().copy()


def _record(engine: Engine, scene: Scenario, dt: float = DT) -> Array:
    """The states of a few steps of a scene."""
    few = scene.model_copy(update={"duration": (A_FEW_STEPS + 0.5) * dt})
    return record(engine, few, dt, verify=False).motion.states


def _keeps(engine: Engine, check: str) -> CheckResult:
    """A state that was handed out stays as it is."""
    scene = _run_by(engine, "tumbling", "turning", "falling straight", "coasting")
    with engine.prepare(scene, DT) as simulation:
        state = simulation.state()
        before = state.copy()
        simulation.advance(A_FEW_STEPS)
        if not np.array_equal(state, before):
            raise Wrong("state() hands out the engine's own memory, which changes with the next step; hand out a copy")
        if np.array_equal(simulation.state(), before):
            raise Wrong(f"the state is the same after {A_FEW_STEPS} steps: nothing moves, or state() looks at what was at the start")
    return CheckResult(check, "passed", "states that were handed out stay as they are")


def _stamp(engine: Engine, check: str) -> CheckResult:
    """Results can be stamped with the settings."""
    with engine.prepare(_run_by(engine), DT) as simulation:
        settings = simulation.settings
    try:
        json.dumps(dict(settings), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise Wrong(f"settings cannot be written as JSON: {error}") from None
    if "version" not in settings:
        return CheckResult(check, "noted", "settings has no 'version'; results should say which version of the engine they are of")
    return CheckResult(check, "passed", f"version {settings['version']}, {len(settings) - 1} settings")


def _leaves_nothing(engine: Engine, check: str) -> CheckResult:
    """Nothing is written to the working directory, not even when a simulation breaks down."""
    scene = _run_by(engine, "tumbling", "turning", "falling straight", "coasting")
    wild = scene.starting_at(scene.initial_state * np.repeat([1.0, 1e4], [7, 6]))
    broke = ""
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        _record(engine, scene)
        if engine.declines(wild) is None:
            try:
                with engine.prepare(wild, 100 * DT) as simulation:
                    simulation.record(A_FEW_STEPS)
            except Exception as error:  # it may well break down, as long as it leaves nothing behind
                broke = f"; a wild start ends in {type(error).__name__}"
        left = sorted(os.listdir(folder))
    if left:
        raise Wrong(f"files are left in the working directory: {', '.join(left)}")
    return CheckResult(check, "passed", f"nothing is written to the working directory{broke}")


def _motion(engine: Engine, check: str) -> CheckResult:
    """The motion of a probe is its truth; if not, what it is instead."""
    probe = next(probe for probe in PROBES if probe.name == check)
    scene = probe.scene
    refusal = engine.declines(scene)
    if refusal is not None:
        raise Declined(refusal)
    truth = truth_for(scene)
    assert truth is not None
    recording = record(engine, scene, DT, verify=False)
    rows = recording.motion.states
    found, meant = rows[probe.rows], truth(probe.times).states
    if probe.off(found, meant) <= 1.0:
        return CheckResult(check, "passed", _figures(found, meant))
    explaining = [one.message for one in recording.limitations if _is_within(one, found, meant, probe)]
    if explaining:
        return CheckResult(check, "noted", "; ".join(explaining))
    law = _own_law(engine, probe, found)
    if law is not None:
        return CheckResult(check, "noted", f"impacts follow the {law} law, as the engine says of itself")
    fault = explained(probe, found)
    if fault is not None:
        return CheckResult(check, "noted" if fault.is_peculiarity else "failed", fault.message)
    return CheckResult(check, "failed", "; ".join([*_symptoms(probe, rows, meant), _figures(found, meant)]))


def _own_law(engine: Engine, probe: Probe, found: Array) -> Law | None:
    """The impact law that an engine names in its discretisation, if it does follow that."""
    named = engine.discretisation(probe.scene) or ""
    for law in LAWS:
        truth = truth_for(probe.scene, law) if f"law {law}" in named else None
        if truth is not None and probe.off(found, truth(probe.times).states) <= 1.0:
            return law
    return None


def _is_within(limitation: KnownLimitation, found: Array, meant: Array, probe: Probe) -> bool:
    """Whether a limit explains how far off a probe's motion is: its place and attitude, and with them what moves it."""
    position, attitude, _, _ = differences(found, meant)
    allowed = [
        max(limitation.explained_errors.get(f"{name}_error", 0.0), own)
        for name, own in zip(("position", "orientation"), probe.allowed, strict=False)
    ]
    return bool(limitation.explained_errors) and bool(position <= allowed[0] and attitude <= allowed[1])


def _figures(found: Array, meant: Array) -> str:
    if not np.isfinite(found).all():
        return "the state is not finite"
    position, attitude, velocity, spin = differences(found, meant)
    return f"off by {position:.2g} m, {attitude:.2g} rad, {velocity:.2g} m/s, {spin:.2g} rad/s"


def _symptoms(probe: Probe, rows: Array, meant: Array) -> Iterator[str]:
    """What is seen of a motion that no known fault explains."""
    scene, end = probe.scene, rows[-1]
    if not np.any(end[7:]) and np.any(meant[-1, 7:]):
        yield "the body has come to a stand: it falls asleep"
        return
    if scene.floor is None and scene.gravity is None:
        for what, unit, part in (("speed", "m/s", slice(7, 10)), ("rate of turning", "rad/s", slice(10, 13))):
            is_, ought = (float(np.linalg.norm(state[part])) for state in (end, meant[-1]))
            if abs(is_ - ought) > 1e-3 * ought:
                yield f"its {what} ends as {is_:.4g} {unit} and should as {ought:.4g}: damping, or a clamp, that is not the scene's"
    rises = np.flatnonzero((rows[1:, 8] > 0.0) & (rows[:-1, 8] <= 0.0))
    truth = truth_for(scene)
    assert truth is not None
    if scene.floor is not None and truth.events and len(rises):
        first = int(rises[0])
        rebound = float(rows[first:, 8].max() / -rows[: first + 1, 8].min())
        yield f"it turns round at a height of {rows[first, 1]:.4g} m and should at {truth.events[0].before[1]:.4g} m"
        yield f"it rebounds with {rebound:.3g} of its speed; restitution is {scene.floor.restitution:g}"


def _run_by(engine: Engine, *preferred: str) -> Scenario:
    """The first of some probes, or of those that show most, that an engine runs."""
    probes = {probe.name: probe for probe in PROBES}
    wanted = preferred or ("corner", "bouncing ball", "tumbling", "turning", "falling straight", "coasting")
    refusal = None
    for name in wanted:
        scene = probes[name].scene
        refusal = engine.declines(scene)
        if refusal is None:
            return scene if preferred else _shortly_before_contact(scene)
    raise Declined(f"none of {', '.join(wanted)} is run: {refusal}")


def _shortly_before_contact(scene: Scenario) -> Scenario:
    """The scene from so late that a few steps meet the floor, where it has one."""
    truth = truth_for(scene)
    if truth is None or not truth.events:
        return scene
    return scene.starting_at(truth(truth.events[0].time - 5.5 * DT).states[0])


def _kind(found: Any) -> str:
    return f"an array of {found.dtype}, shape {found.shape}" if isinstance(found, np.ndarray) else f"a {type(found).__name__}"


TELLING = next(probe.scene for probe in PROBES if probe.name == "tumbling")
"""A start of which no two numbers are alike."""

CHECKS: dict[str, Callable[[Engine, str], CheckResult]] = {
    "claims": _claims,
    "declines": _reasons,
    "builds what is meant": _builds,
    "record and advance": _rows,
    "time": _clock,
    "staggered": _stagger,
    "repeats": _repeats,
    "states": _keeps,
    "settings": _stamp,
    "files": _leaves_nothing,
    **{probe.name: _motion for probe in PROBES},
}
