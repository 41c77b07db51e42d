"""The stages of a default run relative to the bare stepping of its engines, and a job of a sweep beside its stepping: `make bench`.

The run is made in this process, so that all of its parts can be timed; bare stepping is that of the same simulations again, without
reading a state. Ratios are printed, because absolute times on a shared machine are noise.
"""

import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from importlib import import_module
from itertools import product
from typing import Any

import numpy as np

import dropspin as ds
from dropspin import reference_impl
from dropspin.comparisons.engines.mujoco_engine import MuJoCo, MuJoCoBatch, MuJoCoSimulation
from dropspin.comparisons.engines.pybullet_engine import PyBullet, PyBulletSimulation
from dropspin.comparisons.engines.wang import Wang, WangBatch, WangSimulation, reference_body, reference_world
from dropspin.comparisons.running.arguments import EngineEntry

DT = 4e-3
JOBS = 10_000
SWEEP = {
    "scenes": ["drop-box-anyhow"],
    "engines": ["wang"],
    "dts": [DT],
    "random": {"count": JOBS, "seed": 1, "floor.restitution": {"from": 0.0, "to": 1.0}, "start.velocity[0]": {"from": -1.0, "to": 1.0}},
}

STAGES = {
    "timing of steps": [("run", "time_engines")],
    "exact motions": [(module, "phases_at") for module in ("scene_run", "engine_study")],
    "metrics": [("engine_study", "compare"), ("engine_study", "measure"), ("scene_run", "compare")],
    "judging over time steps": [("engine_study", "convergence")],
}
"""Functions of `dropspin.comparisons.running`, by the stage of a run whose time they take."""

seconds: dict[str, float] = defaultdict(float)
active: list[str] = []
simulated: list[tuple[ds.Engine, Sequence[ds.Scenario], float]] = []
"""The engine, the scenes and the time step of each simulation, or batch, of the run."""


def time_method(owner: Any, name: str, part: str) -> None:
    """Add the time spent in a method, or in a function of a module, to a part of the run, unless another timed one calls it."""
    method: Callable[..., Any] = getattr(owner, name)

    def timed(*given: Any, **named: Any) -> Any:
        active.append(part)
        start = time.perf_counter()
        try:
            return method(*given, **named)
        finally:
            active.pop()
            if not active:
                seconds[part] += time.perf_counter() - start

    setattr(owner, name, timed)


def note_simulations(module: Any, name: str) -> None:
    """Add what a function of a module simulates to `simulated`."""
    function: Callable[..., Any] = getattr(module, name)

    def noted(engine: ds.Engine, scenes: ds.Scenario | Sequence[ds.Scenario], dt: float, *given: Any, **named: Any) -> Any:
        simulated.append((engine, [scenes] if isinstance(scenes, ds.Scenario) else scenes, dt))
        return function(engine, scenes, dt, *given, **named)

    setattr(module, name, noted)


def bare_stepping() -> float:
    """The time that the simulations of the run take without reading a state [s]."""
    spent = 0.0
    for engine, scenes, dt in simulated:
        batch = engine.prepare_batch(scenes, dt) if len(scenes) > 1 else None
        for simulation in (engine.prepare(scene, dt) for scene in scenes) if batch is None else [batch]:
            with simulation:
                start = time.perf_counter()
                simulation.advance(scenes[0].steps(dt))
                spent += time.perf_counter() - start
    return spent


class ProcessesHere:
    """Stands for `EngineProcesses`; engines run in this process."""

    def __init__(self, limits: ds.ResourceLimits) -> None:
        pass

    def __enter__(self) -> "ProcessesHere":
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def start(self, entries: Sequence[EngineEntry]) -> None:
        """There is no process to start."""

    def abandon(self) -> None:
        """There is no process to end."""

    def call(self, entry: EngineEntry, work: Callable[..., Any], *given: Any, **_: object) -> Any:
        """Call a function with an engine."""
        return work(entry, *given)


def run_cost(scenes: Sequence[ds.Scenario]) -> None:
    """Print the stages of a run relative to the bare stepping of its engines."""
    simulations = (WangSimulation, WangBatch, MuJoCoSimulation, MuJoCoBatch, PyBulletSimulation)
    for simulation, name in product(simulations, ("record", "advance")):
        time_method(simulation, name, "stepping and recording")
    for engine in (Wang, MuJoCo, PyBullet):
        time_method(engine, "prepare", "building")
    for engine in (Wang, MuJoCo):
        time_method(engine, "prepare_batch", "building")
    for stage, functions in STAGES.items():
        for module, name in functions:
            time_method(import_module(f"dropspin.comparisons.running.{module}"), name, stage)
    for module, name in (("engine_run", "record"), ("engine_run", "record_batch"), ("ensembles", "record_batch")):
        note_simulations(import_module(f"dropspin.comparisons.running.{module}"), name)
    import_module("dropspin.comparisons.running.parallel").EngineProcesses = ProcessesHere
    ds.run(scenes[:1], "wang", jobs=1)  # compiles
    seconds.clear()
    simulated.clear()
    start = time.perf_counter()
    results = ds.run(scenes, ["wang", "mujoco", "pybullet"], jobs=1)
    whole = time.perf_counter() - start
    seconds["all else"] = whole - sum(seconds.values())
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        ds.write_report(results, f"{folder}/run")
        seconds["report"] = time.perf_counter() - start
    bare = bare_stepping()
    for part, spent in seconds.items():
        print(f"{part}: {spent / bare:.2f} times bare stepping")
    print(f"the run and its report: {sum(seconds.values()) / bare:.2f} times bare stepping")


def sweep_cost() -> None:
    """Print the cost of a job in a sweep of small jobs, and the share of stepping alone."""
    sweep = ds.load_sweep(SWEEP)
    scene = sweep.scenes[0]
    simulator = reference_impl.Simulator(reference_body(scene.body), reference_world(scene, DT), DT)
    states, steps = np.tile(scene.initial_state, (JOBS // 10, 1)), scene.steps(DT)
    simulator.run(states, steps, threads=1)
    start = time.perf_counter()
    simulator.run(states, steps, threads=1)
    stepping = (time.perf_counter() - start) / len(states)
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        ds.run_sweep(sweep, f"{folder}/sweep")
        job = (time.perf_counter() - start) / JOBS
    print(f"a job of {steps} steps in a sweep of {JOBS:,}: {1e6 * job:.0f} µs, of which {1e6 * stepping:.0f} µs are stepping")


if __name__ == "__main__":
    sweep_cost()
    run_cost([scene for scene in map(ds.load, ds.scene_names()) if "core" in scene.tags])
