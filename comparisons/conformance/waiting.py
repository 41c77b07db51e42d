"""The check that `advance` takes all of its steps before it returns: an engine that computes asynchronously must wait for them."""

import time
from itertools import pairwise

from dropspin.comparisons.conformance.outcomes import CheckFailed, CheckResult
from dropspin.comparisons.conformance.probes import DT
from dropspin.comparisons.conformance.protocol import relative_difference
from dropspin.comparisons.conformance.short_runs import accepted_scene
from dropspin.comparisons.engines.base import Engine, Simulation
from dropspin.scenarios import Scenario
from dropspin.scenarios.text import rounded

LONG_ENOUGH = 0.02
"""Wall time of the steps [s]; a shorter one could be hidden by the time that it takes to read a state."""
MOST_STEPS = 1 << 16
REPEATS = 2
LARGEST_SHARE = 0.5
"""Largest share of the time that may be spent waiting for the state."""
PIECE = 32
"""Steps of a short call."""
FAR = 1e-3
"""The difference, relative to the largest number, of states that are not of the same time; an adaptive integrator may differ by less."""


def check_waiting(engine: Engine, check: str) -> CheckResult:
    """Most of the time of a run passes in `advance`, not in the first `state` after it, and a long call takes all of its steps."""
    scene = accepted_scene(engine, "turning", "coasting", "falling straight")
    with engine.prepare(scene, DT) as simulation:
        _timed(simulation, 1)  # the first step may compile
        steps, stepping, waiting = 64, 0.0, 0.0
        while stepping + waiting < LONG_ENOUGH and steps < MOST_STEPS:
            steps *= 4
            stepping, waiting = _timed(simulation, steps)
        # Other processes may delay a call now and then.
        stepping, waiting = min([(stepping, waiting), *(_timed(simulation, steps) for _ in range(REPEATS))], key=lambda times: times[1])
    if waiting > LARGEST_SHARE * (stepping + waiting) and waiting > LARGEST_SHARE * LONG_ENOUGH:
        returned, took = (f"{rounded(1e3 * seconds, 2)} ms" for seconds in (stepping, waiting))
        raise CheckFailed(
            f"advance({steps}) returned after {returned}, and state() then took {took}: the steps were not done; wait for them in advance "
            "(JAX: block_until_ready; Warp: synchronize)"
        )
    _verify_steps(engine, scene, steps)
    return CheckResult(check, "passed", f"advance({steps}) returns when its steps are done")


def _verify_steps(engine: Engine, scene: Scenario, steps: int) -> None:
    """A long call ends where short calls end; a state that is read too early, or after fewer steps, is another."""
    ends = []
    for calls, each in ((1, steps), (steps // PIECE, PIECE)):
        with engine.prepare(scene, DT) as simulation:
            for _ in range(calls):
                simulation.advance(each)
            ends.append(simulation.state().copy())
    long, short = ends
    difference = relative_difference(long, short)
    if not difference <= FAR:
        raise CheckFailed(
            f"the state after advance({steps}) is not that after {steps // PIECE} calls of advance({PIECE}), by {difference:.2g} of the "
            "largest number: the long call takes fewer steps, or state() does not wait for them"
        )


def _timed(simulation: Simulation, steps: int) -> tuple[float, float]:
    """The wall times of `advance`, and of the first `state` after it beyond that of the second one [s]."""
    times = [time.perf_counter()]
    for call in (lambda: simulation.advance(steps), simulation.state, simulation.state):
        call()
        times.append(time.perf_counter())
    stepping, first, second = (later - earlier for earlier, later in pairwise(times))
    return stepping, max(first - second, 0.0)
