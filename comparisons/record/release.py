"""The program that measures a release in its environment.

`python -m dropspin.comparisons.record.release REQUEST ANSWER`, both files of JSON.
"""

import json
import sys
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from dropspin.comparisons.engines.base import Diverged, Engine
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.engines.registry import engine as engine_named
from dropspin.comparisons.engines.stand_in import code_of
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.metrics import METRICS, leading_metric
from dropspin.comparisons.results.complete_folders import sha256
from dropspin.comparisons.results.provenance import STAMPED
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import Breakdown, divergence, record, record_batch, verify_accepted
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.run import measure
from dropspin.comparisons.running.start_phases import StartPhase, start_phases
from dropspin.comparisons.running.timing import time_steps
from dropspin.scenarios import Scenario, load, truth_for

Row = dict[str, Any]
TIMING_REPEATS = 5
LONG_ENOUGH = 1.0
"""Timings of a simulation end when they have taken this long together [s]."""
YARDSTICK, YARDSTICK_SCENE, YARDSTICK_STEPS = "wang", "spin-asymmetric", 10_000
"""Steps of Wang's method in free flight, which take the same time whatever the time step is."""


def main(request: str, answer: str) -> None:
    """Measure what a file asks for, and write the rows into another file."""
    asked = json.loads(Path(request).read_text(encoding="utf-8"))
    found = version(asked["package"])
    if found != asked["release"]:
        raise SystemExit(f"version {found} is imported instead of {asked['release']}")
    scenes, labels = [load(name) for name in asked["scenes"]], asked["labels"]
    with EngineProcesses(ResourceLimits(processor_time=asked["time_limit"])) as processes:
        rows = [row for label in labels for row in _rows(engine_entry(label), scenes, asked["dts"], processes)]
    loaded = {package for module, packages in packages_distributions().items() if module in sys.modules for package in packages}
    used = [package for package in dict.fromkeys([*STAMPED, asked["package"]]) if package in {"dropspin", asked["package"], *loaded}]
    versions = ", ".join(f"{package} {version(package)}" for package in used)
    Path(answer).write_text(json.dumps({"rows": rows, "versions": versions}), encoding="utf-8")


def _rows(entry: EngineEntry, scenes: list[Scenario], dts: list[float], processes: EngineProcesses) -> Iterator[Row]:
    """The rows of one engine; one row alone if it cannot be imported."""
    if entry.engine is None:
        yield {"label": entry.label, "verdict": entry.absence, "reason": entry.reason}
        return
    code = code_of(entry.engine)
    for scene, dt in product(scenes, dts):
        case = {"label": entry.label, "adapter": code, "scene": scene.name, "scene_digest": scene.digest, "dt": dt}
        found = processes.call(entry, _measured, scene, dt)
        rows = [{"verdict": found.verdict, "reason": found.reason}] if isinstance(found, Breakdown) else found
        yield from (case | row for row in rows)


def _measured(entry: EngineEntry, scene: Scenario, dt: float) -> list[Row]:
    """A row for each metric of one simulation; one row alone if its motion diverges; runs in the engine's process."""
    engine = entry.adapter
    verify_accepted(engine, scene)
    recording = record(engine, scene, dt)
    hashed: Row = {"trajectory": sha256(recording.motion.states.astype("<f8").tobytes())}
    if (broken := divergence(recording.motion)) is not None:
        return [hashed | {"verdict": broken.verdict, "reason": broken.reason}]
    band, leading = range_over_phases(engine, scene, dt), leading_metric(scene)
    met = "; ".join(limitation.message for limitation in recording.limitations if not limitation.is_minor)
    hashed |= costs(engine, scene, dt) | {"verdict": "measured", "reason": met}
    return [
        hashed | (band if metric == leading else {}) | {"metric": metric, "unit": METRICS[metric].unit, "value": value}
        for metric, value in measure(scene, recording.motion).items()
    ]


def range_over_phases(engine: Engine, scene: Scenario, dt: float) -> Row:
    """The least and the largest size of the leading error over the scene's start and start phases.

    None for a scene without start phases, and if the engine breaks down from one of them.
    """
    truth = truth_for(scene)
    phases = start_phases(scene, truth, dt, quick=True)
    if len(phases) == 1:
        return {}
    phases.append(StartPhase(scene, truth))
    try:
        recordings = record_batch(engine, [phase.scene for phase in phases], dt)
    except Diverged:
        return {}
    runs = zip(phases, recordings, strict=True)
    cases = [Comparison.with_truth(phase.scene, recording.motion, phase.truth) for phase, recording in runs]
    sizes = [abs(METRICS[leading_metric(scene)].value_or_nan([case])) for case in cases]
    return {"low": min(sizes), "high": max(sizes)} if np.isfinite(sizes).all() else {}


def costs(engine: Engine, scene: Scenario, dt: float) -> Row:
    """The wall time of the steps per simulated second, and that over the time of `wang`'s steps, measured in turn."""
    steps, yardstick, yardstick_scene = scene.steps(dt), engine_named(YARDSTICK), load(YARDSTICK_SCENE)
    time_steps(yardstick, yardstick_scene, dt, 1)  # compiles, and so may the engine
    if engine.compiles:
        time_steps(engine, scene, dt, steps)
    own: list[float] = []
    others: list[float] = []
    while len(own) < TIMING_REPEATS and sum(own) * scene.duration < LONG_ENOUGH:
        own.append(time_steps(engine, scene, dt, steps).stepping / (steps * dt))
        others.append(time_steps(yardstick, yardstick_scene, dt, YARDSTICK_STEPS).stepping / (YARDSTICK_STEPS * dt))
    ratios = np.divide(own, others)
    return {"cost": min(own), "median_cost": float(np.median(own)), "relative_cost": float(np.median(ratios))}


if __name__ == "__main__":
    main(*sys.argv[1:])
