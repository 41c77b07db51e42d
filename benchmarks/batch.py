"""The cost of a batch above that of the engine's own call for it: `make bench`.

A batch is used in two ways. `dropspin tradeoff` steps many worlds and reads their last states: `prepare_batch`, `advance`, `states`. Start
phases and ensembles record every step of some dozens of worlds: `record_batch`, which also converts the states, verifies each of them, and
returns trajectories. Each is compared with the engine's own call that returns the same states, of the same starts, with the same number of
threads. Starts come from scenes: whoever calls the reference implementation converts scenes to arrays too, and its time includes that.
MuJoCo's call gets a compiled model and its starts as an array.

In each round the call and the batch run one after the other, the first of them in turn. The ratio of the best times is printed, and the
median of the ratios of the rounds.
"""

import statistics
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from speed import DT, scene

from dropspin import reference_impl, scenarios
from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.engines.wang import reference_body, reference_world
from dropspin.comparisons.running.driving import record_batch
from dropspin.reference_impl.threads import usable_cores
from dropspin.scenarios.model import initial_states

STEPS = 1000
WORLDS = {"wang": (32, 256, 1024, 4096), "mujoco": (1024,)}
ROUNDS = {"wang": (60, 15), "mujoco": (9, 3)}
"""How often a call and a batch are compared: last states, which differ by little, and every step recorded."""

Call = Callable[[], object]


def members(name: str, worlds: int) -> list[scenarios.Scenario]:
    """A scene of `speed` from random angular velocities; a body at rest from one."""
    nominal = scene(name).model_copy(update={"duration": STEPS * DT})
    starts = np.tile(nominal.initial_state, (worlds, 1))
    if name != "rest":
        starts[:, 10:13] += np.random.default_rng(0).normal(size=(worlds, 3))
    return [nominal.starting_at(start) for start in starts]


def last_states(chosen: Engine, starts: Sequence[scenarios.Scenario]) -> NDArray[np.float64]:
    """The states of a batch after all steps, as `dropspin tradeoff` computes them."""
    batch = chosen.prepare_batch(starts, DT)
    assert batch is not None
    with batch:
        batch.advance(STEPS)
        return np.asarray(batch.states())


def document_alone(starts: Sequence[scenarios.Scenario], every: int) -> Call:
    """The function of the reference implementation, with its arguments from the scenes."""

    def call() -> object:
        body, world = reference_body(starts[0].body), reference_world(starts[0], DT)
        return reference_impl.simulate(initial_states(starts), body, world, DT, STEPS, every)

    return call


def mujoco_alone(starts: Sequence[scenarios.Scenario], every: int) -> Call:
    """MuJoCo's rollout, which records every step in any case."""
    from mujoco import MjData
    from mujoco.rollout import rollout

    simulation: Any = engine("mujoco").prepare_batch(starts, DT)
    models, now = simulation._models, simulation._now.copy()
    datas = [MjData(models[0]) for _ in range(usable_cores())]
    return partial(rollout, models, datas, now, nstep=STEPS)


def seconds(call: Call) -> float:
    """Wall time of a call [s], the release of its result included."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def compare(title: str, alone: Call, batch: Call, rounds: int, steps: int) -> None:
    """Print the best times of a call and of a batch, in ns per step and world, and their ratio."""
    calls = [alone, batch]
    times = np.empty((rounds, 2))
    for call in calls:
        call()  # compiles
    for number in range(rounds):
        for which in (0, 1) if number % 2 else (1, 0):
            times[number, which] = seconds(calls[which])
    engines, batches = times.T
    best = f"{engines.min() / steps * 1e9:8.1f} {batches.min() / steps * 1e9:8.1f}"
    print(f"  {title:50} {best}   x {batches.min() / engines.min():5.2f} {statistics.median(batches / engines):5.2f}")


def main() -> None:
    """Print the cost of batches of a box in flight, dropped and at rest."""
    print("\nbatches, 1,000 steps [best ns a step: the engine's call, the batch; their ratio: of the best times, median of the rounds]")
    for label, alone in (("wang", document_alone), ("mujoco", mujoco_alone)):
        for name in ("flight", "drop", "rest"):
            for worlds in WORLDS[label]:
                starts, (last, recorded), steps = members(name, worlds), ROUNDS[label], worlds * STEPS
                title = f"{label}, {name}, {worlds:,} worlds"
                batch = partial(last_states, engine(label), starts)
                compare(f"{title}, last states", alone(starts, STEPS), batch, last, steps)
                batch = partial(record_batch, engine(label), starts, DT)
                compare(f"{title}, every step recorded", alone(starts, 1), batch, recorded, steps)


if __name__ == "__main__":
    main()
