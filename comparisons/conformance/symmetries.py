"""Checks of motions that should be equal: of scenes seen from elsewhere, and of batches and single simulations.

Lost symmetries are peculiarities of an engine that exact solutions may not show. Batches are built for two sizes and time steps, and
stepped in long calls and in short ones.
"""

from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from typing import NamedTuple

import numpy as np

from dropspin.comparisons.conformance.outcomes import CheckFailed, Declined, Noted
from dropspin.comparisons.conformance.probes import A_FEW_STEPS, DT, FLIGHTS, RICHEST, accepted_scene
from dropspin.comparisons.conformance.protocol import ROUNDING, relative_difference
from dropspin.comparisons.engines.base import BatchSimulation, Engine, numpy_array
from dropspin.comparisons.faults.fault_model import changed_table
from dropspin.comparisons.measuring.symmetries import SYMMETRIES
from dropspin.comparisons.running.adapter_output import BuildMismatch, verified_batch, verify_starts
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import record
from dropspin.comparisons.running.start_phases import START_PHASES
from dropspin.comparisons.symmetries.findings import STEP_MULTIPLE, Finding, judged
from dropspin.comparisons.symmetries.study import batch_member, effects_of_rounding, findings_of
from dropspin.scenarios import Scenario
from dropspin.scenarios.state import Array
from dropspin.scenarios.text import counted
from dropspin.scenarios.variations import whole_steps

WITH_FRICTION = ("slippery floor", "sliding box")
"""Names of probes with a coefficient of friction."""
PIECE = 8
"""Steps of a short call."""
SPREAD = 1e-3
"""The relative difference of the numbers of a simulation from those of the one before."""

WITHOUT_REBOUNDS = changed_table("floor", rest_speed=1e3)
"""Impacts slower than 1 km/s have restitution 0; in the other simulations all impacts rebound."""


class Size(NamedTuple):
    """A number of simulations, their time step [s], and the steps of a long call; a fault may need many, or a second time step."""

    simulations: int
    dt: float
    long: int


SIZES = (Size(3, DT, 256), Size(START_PHASES, 2.0 * DT, 16))


def check_symmetries(engine: Engine) -> str:
    """Scenes seen from elsewhere and in other units have the same motion."""
    findings: list[Finding] = []
    for names in (FLIGHTS, RICHEST):
        scene = whole_steps(accepted_scene(engine, *names), DT, A_FEW_STEPS)
        motion = record(engine, scene, DT).motion  # an exception of the adapter ends the check
        if motion.first_bad_row is None:
            findings += findings_of(EngineEntry(engine.label, engine), scene, DT, motion.states, SYMMETRIES)
    lost = {finding.symmetry: finding for finding in sorted(findings, key=lambda finding: finding.difference) if finding.status == "lost"}
    if lost:
        named = "; ".join(f"{name}: by {finding.difference:.2g} from step {finding.step} on" for name, finding in lost.items())
        raise Noted(f"the motion differs if the scene is transformed; {named} (dropspin symmetries shows more)")
    compared = {finding.symmetry for finding in findings if finding.status != "not run"}
    if not compared:
        raise Declined(f"no symmetry could be compared: {findings[0].reason if findings else 'the motion is not finite'}")
    scenes = " and ".join(dict.fromkeys(finding.scene for finding in findings))
    return f"{counted(len(compared), 'symmetry is', 'symmetries are')} kept in {scenes}"


def check_batches(engine: Engine) -> str:
    """Batches have the states and the velocity lag of single simulations, and the same states by `record` as by `advance`."""
    scenes = {}
    for names in (FLIGHTS, RICHEST, WITH_FRICTION):  # a flight, an impact and a contact with friction, as far as the engine accepts them
        with suppress(Declined):
            scene = accepted_scene(engine, *names)
            scenes[scene.name] = scene
    verified = [(name, size.simulations) for name, scene in scenes.items() for size in SIZES if _is_verified(engine, scene, size)]
    if not verified:
        raise Declined("prepare_batch returns None: the engine simulates one scene at a time")
    same = "the motions of single simulations, up to rounding" if engine.compiles else "the same bits as single simulations"
    sizes = " and ".join(map(str, sorted({size for _, size in verified})))
    return f"batches of {sizes} give {same}, in {', '.join(dict.fromkeys(name for name, _ in verified))}"


def _is_verified(engine: Engine, scene: Scenario, size: Size) -> bool:
    """Verify a batch; whether there is one.

    Raises:
        CheckFailed: It differs.
    """
    first_member = whole_steps(scene, size.dt, A_FEW_STEPS)
    shares = [1.0 + SPREAD * number for number in range(1, size.simulations)]
    members = [first_member, *(batch_member(engine, first_member, share) for share in shares)]
    if engine.mixes_scenes and engine.refusal(without_rebounds := WITHOUT_REBOUNDS(members[-1])) is None:
        members[-1] = without_rebounds
    try:
        first, second = engine.prepare_batch(members, size.dt), engine.prepare_batch(members, size.dt)
        if first is None or second is None:
            return False
        with first, second:
            _verify_batches(engine, members, size, first, second)
    except (CheckFailed, BuildMismatch) as wrong:
        others = "; their numbers differ, because mixes_scenes is True" if engine.mixes_scenes else ""
        raise CheckFailed(f"{wrong} (in a batch of {size.simulations} simulations of the scene {scene.name}{others})") from None
    return True


def _verify_batches(engine: Engine, members: Sequence[Scenario], size: Size, first: BatchSimulation, second: BatchSimulation) -> None:
    """Compare three simulations of a batch with single ones, and the batch with another of the same simulations."""
    count = len(members)
    rows = verified_batch(first.record(A_FEW_STEPS, 1), count, 1 + A_FEW_STEPS)
    verify_starts(engine, members, rows[:, 0])
    for number in sorted({0, count // 2, count - 1}):
        _verify_single(engine, members[number], size.dt, rows[number], first.velocity_lag, number)
    end = _advanced(first, size.long, count)
    more = verified_batch(first.record(A_FEW_STEPS, 1), count, 1 + A_FEW_STEPS)
    calls = np.stack([_advanced(second, PIECE, count) for _ in range((A_FEW_STEPS + size.long) // PIECE)], axis=1)
    recorded = rows[:, PIECE::PIECE]
    _verify_calls(
        engine, calls[:, : recorded.shape[1]], recorded, f"calls of advance({PIECE}) give other states than record({A_FEW_STEPS})"
    )
    _verify_calls(engine, end, calls[:, -1], f"advance({size.long}) gives other states than calls of advance({PIECE})")
    _verify_calls(engine, more[:, 0], end, "a second record does not begin at the current states")


def _verify_calls(engine: Engine, states: Array, expected: Array, message: str) -> None:
    """States that a batch computes by different calls are the same; rounding may differ with the number of steps in a call."""
    difference = relative_difference(states, expected)
    if not difference <= max(ROUNDING, STEP_MULTIPLE * float(np.finfo(engine.precision).eps)):
        raise CheckFailed(f"{message}, by {difference:.2g} of the largest number")


def _advanced(batch: BatchSimulation, steps: int, count: int) -> Array:
    """The states after some more steps, shape (count, 13)."""
    batch.advance(steps)
    return verified_batch(numpy_array(batch.states())[:, np.newaxis], count, 1)[:, 0]


def _verify_single(engine: Engine, member: Scenario, dt: float, rows: Array, lag: float, number: int) -> None:
    """Compare one simulation of a batch with a single one."""
    alone = record(engine, member, dt).motion
    if lag != alone.velocity_lag:
        raise CheckFailed(f"velocity_lag is {lag!r}; that of a single simulation is {alone.velocity_lag!r}")
    entry = EngineEntry(engine.label, engine)
    # A compiler vectorises a batch differently from a single simulation, and rounding depends on that.
    effects = partial(effects_of_rounding, entry, member, dt, alone.states) if engine.compiles else None
    none = Finding(member.name, engine.label, "", "not run")
    finding = judged(none, member, dt, [(alone.states, rows)], effects, engine.precision)
    if finding.status not in ("kept", "rounding"):
        since = f"from step {finding.step} on, by {finding.difference:.2g} of sizes and speeds"
        raise CheckFailed(f"simulation {number + 1} differs from the same one by itself {since}")
