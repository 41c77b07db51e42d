"""What a default run costs beside its stepping and recording, and a sweep a job beside its stepping: `make bench`.

The run is made in this process, so that every part of it can be seen; ratios and shares are printed, because absolute times on a shared
machine are noise.
"""

import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from importlib import import_module
from itertools import product
from typing import Any

import numpy as np

import comparisons
import reference_impl
import reports
import scenarios
from comparisons.engines.document import Document, DocumentSimulation, reference_body, reference_world
from comparisons.engines.mujoco_engine import MuJoCo
from comparisons.engines.mujoco_simulation import MuJoCoSimulation
from comparisons.engines.pybullet_engine import PyBullet
from comparisons.engines.pybullet_simulation import PyBulletSimulation
from comparisons.running.recording import run_engine
from comparisons.sweeps import load_sweep, run_sweep

JOBS = 10_000
SWEEP = {
    "scenes": ["drop-box-anyhow"],
    "engines": ["document"],
    "dts": [4e-3],
    "random": {"count": JOBS, "seed": 1, "floor.restitution": {"from": 0.0, "to": 1.0}, "start.velocity[0]": {"from": -1.0, "to": 1.0}},
}

spent: dict[str, float] = defaultdict(float)
within: list[str] = []


def watch(owner: type, name: str, part: str) -> None:
    """Count the time within a method, but not within one that is called by another that is watched."""
    method: Callable[..., Any] = getattr(owner, name)

    def watched(*given: Any, **named: Any) -> Any:
        within.append(part)
        start = time.perf_counter()
        try:
            return method(*given, **named)
        finally:
            within.pop()
            if not within:
                spent[part] += time.perf_counter() - start

    setattr(owner, name, watched)


class Here:
    """In the place of processes of their own."""

    def __init__(self, limits: comparisons.ResourceLimits) -> None:
        pass

    def __enter__(self) -> "Here":
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def attempt(self, entry: Any, scene: Any, dt: float, phases: Any) -> Any:
        """What an engine's process would do."""
        return run_engine(entry, scene, dt, [phase.scene for phase in phases])


def run_cost() -> None:
    """A default run, its parts in terms of its stepping and recording."""
    for simulation, name in product((DocumentSimulation, MuJoCoSimulation, PyBulletSimulation), ("record", "advance")):
        watch(simulation, name, "stepping and recording")
    for engine in (Document, MuJoCo, PyBullet):
        watch(engine, "prepare", "building")
    watch(Document, "record_ensemble", "stepping and recording")
    import_module("comparisons.running.run").EngineProcesses = Here
    core = [scene for scene in map(scenarios.load, scenarios.names()) if "core" in scene.tags]
    comparisons.run(core[:1], ["document"])  # compiled
    spent.clear()
    start = time.perf_counter()
    results = comparisons.run(core, ["document", "mujoco", "pybullet"])
    spent["all of the run"] = time.perf_counter() - start
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        reports.write(results, f"{folder}/run")
        spent["plots and writing, after it"] = time.perf_counter() - start
    for part, seconds in spent.items():
        print(f"{part}: {seconds / spent['stepping and recording']:.2f} times its stepping and recording")


def sweep_cost() -> None:
    """A sweep of small jobs, over the bare stepping of as many bodies."""
    asked = load_sweep(SWEEP)
    scene = asked.scenes[0]
    simulator = reference_impl.Simulator(reference_body(scene.body), reference_world(scene), 4e-3)
    states, steps = np.tile(scene.initial_state, (JOBS // 10, 1)), scene.steps(4e-3)
    simulator.run(states, steps, threads=1)
    start = time.perf_counter()
    simulator.run(states, steps, threads=1)
    stepping = (time.perf_counter() - start) / len(states)
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        run_sweep(asked, f"{folder}/sweep")
        job = (time.perf_counter() - start) / JOBS
    print(f"a job of {steps} steps in a sweep of {JOBS:,}: {1e6 * job:.0f} µs, of which {1e6 * stepping:.0f} µs are stepping")


if __name__ == "__main__":
    sweep_cost()
    run_cost()
