"""The cost of a batch above that of the engine's own call for it: `make bench`.

A batch is what `record_batch` does: build the simulation, record every step of every world, convert the states, verify them, and return
trajectories. It is compared with the engine's call alone, which records the same states in its own coordinates with the same number of
threads.
"""

from functools import partial
from typing import Any

import numpy as np
from speed import DT, Entry, Run, report, scene, timed

import reference_impl
import scenarios
from comparisons.engines.document import reference_body, reference_world
from comparisons.engines.registry import engine
from comparisons.running.recording import record_batch
from reference_impl.threads import usable_cores

WORLDS, STEPS = 1024, 1000


def members(name: str) -> list[scenarios.Scenario]:
    """A scene of `speed` from random angular velocities; a body at rest from one."""
    nominal = scene(name).model_copy(update={"duration": STEPS * DT})
    starts = np.tile(nominal.initial_state, (WORLDS, 1))
    if name != "rest":
        starts[:, 10:13] += np.random.default_rng(0).normal(size=(WORLDS, 3))
    return [nominal.starting_at(start) for start in starts]


def batch(label: str, name: str) -> Entry:
    """The batch of an engine."""
    return lambda: Run(partial(record_batch, engine(label), members(name), DT), WORLDS * STEPS)


def lanes_alone(name: str) -> Entry:
    """The kernel of the reference implementation."""
    scenes = members(name)
    simulator = reference_impl.Simulator(reference_body(scenes[0].body), reference_world(scenes[0]), DT)
    starts = np.array([one.initial_state for one in scenes])
    return lambda: Run(partial(simulator.run, starts, STEPS), WORLDS * STEPS)


def rollout_alone(name: str) -> Entry:
    """MuJoCo's rollout."""
    from mujoco import MjData
    from mujoco.rollout import rollout

    simulation: Any = engine("mujoco").prepare_batch(members(name), DT)
    model, starts = simulation._model, simulation._now.copy()
    datas = [MjData(model) for _ in range(usable_cores())]
    return lambda: Run(partial(rollout, model, datas, starts, nstep=STEPS), WORLDS * STEPS)


def main() -> None:
    """Print the cost of batches of a box in flight, dropped and at rest."""
    for label, alone in (("document", lanes_alone), ("mujoco", rollout_alone)):
        for name in ("flight", "drop", "rest"):
            entries = {"the engine's call": alone(name), "the batch": batch(label, name)}
            report(f"{label}, {name}: {WORLDS:,} worlds, {STEPS:,} steps", timed(entries), "the engine's call")


if __name__ == "__main__":
    main()
