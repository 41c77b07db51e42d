"""Checks of the engine protocol: what the class claims, which scenes it declines, what it builds, and that its methods agree.

Simulations are also independent: of what ran before, of each other, and of the working directory. These checks call `prepare`, `advance`,
`state` and `record` themselves, because that is what they test.
"""

import os
import tempfile
from collections.abc import Sequence
from contextlib import chdir
from functools import partial
from itertools import product

import numpy as np

from dropspin.comparisons.conformance.motions import explain_start
from dropspin.comparisons.conformance.outcomes import CheckFailed, Declined, Noted, described
from dropspin.comparisons.conformance.probes import A_FEW_STEPS, DT, FLIGHTS, PROBES, accepted_scene, recorded, state_after
from dropspin.comparisons.engines.base import Diverged, Engine, Simulation
from dropspin.comparisons.engines.exceptions import ProgramError, TimedOut
from dropspin.comparisons.running.adapter_output import (
    MULTIPLE,
    BuildMismatch,
    verified_claims,
    verified_lag,
    verified_record,
    verified_refusal,
    verified_settings,
    verified_simulation,
    verify_build,
    verify_start,
)
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.scenarios import Scenario, load, names
from dropspin.scenarios.bodies.shape import times
from dropspin.scenarios.state import Array
from dropspin.scenarios.text import counted
from dropspin.scenarios.variations import with_size, with_values

SEVERAL = 3
OTHER = 0.8
"""Factor on a quantity of another scene."""
A_FRICTION = 0.3
"""Coefficient of friction of a scene beside one without friction."""
ROUNDING = 1e-9
"""Relative to the largest number: by how much `record` and `advance` may differ, which is noted."""
ASYMMETRIC = next(probe.scene for probe in PROBES if probe.name == "tumbling")
"""A scene whose start has no two equal numbers."""


def check_claims(engine: Engine) -> str:
    """The class has a valid order and precision."""
    _, _, precision = verified_claims(engine, ASYMMETRIC)
    return f"order {'not claimed' if engine.order is None else engine.order}, {np.dtype(precision).name}"


def check_refusals(engine: Engine) -> str:
    """Scenes are declined with a reason, and not all of them."""
    scenes = list(map(load, names()))
    for scene in [*scenes, *(probe.scene for probe in PROBES)]:
        answer, again = engine.declines(scene), engine.declines(scene)
        if answer != again:
            raise CheckFailed(f"declines({scene.name}) returns {answer!r}, then {again!r}; it must return the same each time")
        verified_refusal(answer)
    declined = sum(engine.refusal(scene) is not None for scene in scenes)
    if declined == len(scenes):
        raise CheckFailed(f"every scene of the catalogue is declined; {scenes[0].name}: {engine.refusal(scenes[0])}")
    accepted = counted(len(scenes) - declined, "scene of the catalogue is", "scenes of the catalogue are")
    return f"{accepted} accepted, {declined} declined with a reason"


def check_builds(engine: Engine) -> str:
    """The built simulation equals the scene, for the probes and for every scene of the catalogue."""
    read_back = []
    for scene in [ASYMMETRIC, *(probe.scene for probe in PROBES), *map(load, names())]:
        if engine.refusal(scene) is not None:
            continue
        try:
            read_back.append(_verify_built(engine, scene))
        except (CheckFailed, BuildMismatch) as wrong:
            raise CheckFailed(f"{wrong} (in the scene {scene.name})") from None
        except (Diverged, TimedOut):
            raise
        except Exception as error:  # an adapter is somebody else's code
            remedy = "" if isinstance(error, ProgramError) else "; decline scenes that the engine cannot run, with a reason"
            raise CheckFailed(f"{described(error, engine)}, in the scene {scene.name}{remedy}") from error
    if not read_back:
        raise Declined("the engine declines every scene")
    if not any(read_back):
        return "the start equals the scene's; as_built() returns no mass, inertia and gravity to compare"
    return f"start, mass, inertia and gravity equal the scene's to {MULTIPLE} eps"


def _verify_built(engine: Engine, scene: Scenario) -> bool:
    """Verify what an engine built of a scene; whether it reads back mass, inertia and gravity."""
    arrays = {name: getattr(scene.body, name) for name in ("inertia_tensor", "vertices", "centre")}
    before = {name: values.copy() for name, values in arrays.items()}
    with verified_simulation(engine.prepare(scene, DT)) as simulation:
        state = _verified_state(simulation)
        if not np.isfinite(state).all():
            raise CheckFailed(f"the state at the start is not finite: {state.tolist()}")
        try:
            verify_start(engine, scene, state)
        except BuildMismatch as error:
            raise CheckFailed(_start_explained(engine, scene, state) or str(error)) from None
        verify_build(engine, scene, simulation, DT)
        verified_record(simulation.record(A_FEW_STEPS, 1), 1 + A_FEW_STEPS)
        has_built = simulation.as_built() is not None
    written = [name for name, values in arrays.items() if not np.array_equal(values, before[name])]
    if written:
        raise CheckFailed(f"the adapter writes into scene.body.{written[0]}, which everything else uses too; change a copy of it")
    return has_built


def _verified_state(simulation: Simulation) -> Array:
    state = simulation.state()
    if not (isinstance(state, np.ndarray) and state.shape == (13,) and state.dtype.kind in "fiu"):
        kind = f"an array of {state.dtype}, shape {state.shape}" if isinstance(state, np.ndarray) else f"a {type(state).__name__}"
        raise CheckFailed(f"state() returns {kind}; it must return a NumPy array of 13 real numbers, shape (13,)")
    return state


def wrong_answer(engine: Engine) -> str:
    """What `prepare`, `state` or `velocity_lag` is instead of what it must be, with which no check can run; empty if nothing is wrong."""
    try:
        with verified_simulation(engine.prepare(accepted_scene(engine), DT)) as simulation:
            _verified_state(simulation)
            verified_lag(simulation.velocity_lag, DT)
    except (CheckFailed, BuildMismatch) as wrong:
        return str(wrong)
    except Exception:  # another error than a wrong answer: the check that failed states its own
        return ""
    return ""


def _start_explained(engine: Engine, scene: Scenario, state: Array) -> str:
    """The fault that gives this start, as a message; empty if none is known."""
    single = float(MULTIPLE * np.finfo(np.float32).eps)
    near = np.abs(state - scene.initial_state).max() <= single * np.abs(scene.initial_state).max()
    if engine.precision is np.float64 and near and np.array_equal(state, np.float32(state)):
        return "the state has single precision only; declare precision = numpy.float32, or pass the start on in double precision"
    if digits := _decimal_rounding(scene, state):
        return f"the start is rounded to {digits} digits; print states with 17 digits, as %.17g does"
    fault = explain_start(scene, state, single)
    return "" if fault is None else fault.message


def _decimal_rounding(scene: Scenario, state: Array) -> int:
    """The number of digits, after the point or significant, to which a program that prints text rounded the start; 0 if it did not."""
    for digits, kind in product(range(3, 17), "fg"):
        if np.array_equal(state, [float(f"{value:.{digits}{kind}}") for value in scene.initial_state]):
            return digits
    return 0


def check_record(engine: Engine) -> str:
    """`record` and `advance` take the same steps."""
    scene = accepted_scene(engine)
    with engine.prepare(scene, DT) as simulation:
        rows = verified_record(simulation.record(A_FEW_STEPS, 1), 1 + A_FEW_STEPS)
        end = simulation.state().copy()
    with engine.prepare(scene, DT) as simulation:
        sparse = verified_record(simulation.record(A_FEW_STEPS, SEVERAL), 1 + A_FEW_STEPS // SEVERAL)
    with engine.prepare(scene, DT) as simulation:
        one_by_one = [simulation.state().copy()]
        for _ in range(A_FEW_STEPS):
            simulation.advance(1)
            one_by_one.append(simulation.state().copy())
        again = verified_record(simulation.record(SEVERAL, 1), 1 + SEVERAL)
    stepped = np.array(one_by_one)
    together = state_after(engine, scene, [SEVERAL])
    _verify_equal(together, stepped[SEVERAL], f"advance({SEVERAL}) differs from {SEVERAL} calls of advance(1)")
    if engine.precision is np.float64 and np.array_equal(stepped[1:], np.float32(stepped[1:])):
        raise CheckFailed(
            "states after the start have single precision only; declare precision = numpy.float32, or return them in double precision"
        )
    _verify_equal(rows[0], stepped[0], "record's first row differs from the state before any step, which it must be")
    _verify_equal(rows, stepped, f"record({A_FEW_STEPS}) differs from {A_FEW_STEPS} times advance(1) and state()")
    if relative_difference(sparse, rows[::SEVERAL]) > ROUNDING and relative_difference(sparse, rows[: len(sparse)]) <= ROUNDING:
        raise CheckFailed(f"record ignores `every`: with every={SEVERAL} it returns consecutive steps")
    _verify_equal(sparse, rows[::SEVERAL], f"record with every={SEVERAL} differs from each third row with every=1")
    _verify_equal(rows[-1], end, "after record, state() differs from the last row")
    _verify_equal(again[0], stepped[-1], "a second record does not begin at the current state")
    if not np.array_equal(rows, stepped):
        raise Noted(f"record and advance differ by rounding, {relative_difference(rows, stepped):.1g}")
    return "record and advance take the same steps, bit for bit"


def _verify_equal(values: Array, expected: Array, message: str) -> None:
    difference = relative_difference(values, expected)
    if not difference <= ROUNDING:
        raise CheckFailed(f"{message} (relative difference {difference:.2g})")


def relative_difference(values: Array, expected: Array) -> float:
    """The largest difference relative to the largest number; infinite if one is not finite."""
    difference = float(np.max(np.abs(values - expected)) / np.max(np.abs(expected)))
    return difference if np.isfinite(difference) else float("inf")


def check_states(engine: Engine) -> str:
    """A state that was returned does not change."""
    scene = accepted_scene(engine, *FLIGHTS)
    with engine.prepare(scene, DT) as simulation:
        state = simulation.state()
        before = state.copy()
        simulation.advance(A_FEW_STEPS)
        if not np.array_equal(state, before):
            raise CheckFailed("state() returns the engine's own memory, which changes with the next step; return a copy")
        if np.array_equal(simulation.state(), before):
            raise CheckFailed(f"the state is the same after {A_FEW_STEPS} steps: the body does not move, or state() returns the start")
    return "returned states do not change"


def check_settings(engine: Engine) -> str:
    """Results can be stored with the settings."""
    with engine.prepare(accepted_scene(engine), DT) as simulation:
        settings = verified_settings(simulation.settings)
    if "version" not in settings:
        raise Noted("settings has no 'version'; add the engine's version, with which results are stored")
    return f"version {settings['version']}, and {len(settings) - 1} other settings"


def check_repeats(engine: Engine) -> str:
    """The same scene gives the same bits after and beside other simulations."""
    a, b = accepted_scene(engine), accepted_scene(engine, "turning", "coasting")
    halves = [A_FEW_STEPS // 2, A_FEW_STEPS - A_FEW_STEPS // 2]
    first, stepped = recorded(engine, a), state_after(engine, a, halves)
    if not all(same(first, recorded(engine, a)) and same(stepped, state_after(engine, a, halves)) for _ in range(SEVERAL)):
        raise CheckFailed(
            "the same scene gives different bits when it runs again: the engine is random, or keeps state between simulations"
        )
    with engine.prepare(b, 4 * DT) as other:
        other.advance(A_FEW_STEPS)
        if not same(first, recorded(engine, a)):
            raise CheckFailed("the same scene gives different bits while another simulation is open: simulations share state")
        if not same(stepped, state_after(engine, a, halves, lambda: other.advance(A_FEW_STEPS))):
            raise CheckFailed("two simulations that take turns affect each other: simulations share state")
    if not same(first, recorded(engine, a)):
        raise CheckFailed("the same scene gives different bits after another scene (A, B, A): a simulation leaves state behind")
    return "a scene gives the same bits when it runs again, after another scene, and in turn with a second simulation"


def states_of_variants(entry: EngineEntry, which: Sequence[int] = ()) -> list[Array | None]:
    """The states of a scene and of those that differ from it in one quantity, simulated in this order; by default of all.

    None where the engine raises an exception.
    """
    engine, other = entry.adapter, partial(times, OTHER)
    scene = accepted_scene(engine)
    lighter = (OTHER * scene.body.inertia_tensor).tolist()
    variants = [
        scene,
        with_size(scene, OTHER * scene.body.size),
        with_values(scene, "body", mass=other),
        with_values(scene, "body", inertia=lighter),
        with_values(scene, "floor", restitution=other),
        with_values(scene, "floor", friction=A_FRICTION),
        with_values(scene, "gravity", acceleration=other),
        scene.starting_at(scene.initial_state * np.repeat([1.0, OTHER], [7, 6])),
    ]
    accepted = [variant for variant in dict.fromkeys(variants) if engine.refusal(variant) is None]
    found: list[Array | None] = []
    for number in which or range(len(accepted)):
        try:
            found.append(recorded(engine, accepted[number]))
        except Exception:  # an adapter is somebody else's code; other checks state what it raises
            found.append(None)
    return found


def same(first: Array, second: Array) -> bool:
    """Whether states are equal bit for bit."""
    return np.array_equal(first, second, equal_nan=True)


def check_files(engine: Engine) -> str:
    """No file is written to the working directory, also when a simulation breaks down."""
    scene = accepted_scene(engine, *FLIGHTS)
    wild = scene.starting_at(scene.initial_state * np.repeat([1.0, 1e4], [7, 6]))
    breakdown = ""
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        recorded(engine, scene)
        if engine.refusal(wild) is None:
            try:
                recorded(engine, wild, 100 * DT)
            except Exception as error:  # a breakdown is allowed, files are not
                breakdown = f"; a start 10,000 times as fast ends in {type(error).__name__}"
        left = sorted(os.listdir(folder))
    if left:
        raise CheckFailed(f"files are left in the working directory: {', '.join(left)}")
    return f"no file is written to the working directory{breakdown}"
