"""The program that measures a release in its environment: `python -m comparisons.record.release REQUEST ANSWER`, both files of JSON."""

import json
import sys
from collections.abc import Iterator
from importlib.metadata import packages_distributions, version
from itertools import product
from pathlib import Path
from typing import Any

from comparisons.engines.stand_in import code_of
from comparisons.measuring.metrics import METRICS
from comparisons.results.provenance import STAMPED
from comparisons.results.stored_files import sha256
from comparisons.running.engine_process import Failed
from comparisons.running.entries import engine_entry
from comparisons.running.inputs import EngineEntry
from comparisons.running.processes import EngineProcesses, ResourceLimits
from comparisons.running.recording import Breakdown, Recording, divergence, try_record
from comparisons.running.run import measure
from scenarios import Scenario, load

Row = dict[str, Any]


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
        yield from (case | row for row in _measured(entry, scene, dt, processes))


def _measured(entry: EngineEntry, scene: Scenario, dt: float, processes: EngineProcesses) -> Iterator[Row]:
    """A row for each metric of one simulation; one row alone, with the reason, if there is no motion."""
    try:
        found = processes.call(entry, _recorded, scene, dt)
    except Failed as failure:
        found = Breakdown(failure.verdict, failure.reason)
    if isinstance(found, Breakdown):
        yield {"verdict": found.verdict, "reason": found.reason}
        return
    motion = found.motion
    hashed = {"trajectory": sha256(motion.states.astype("<f8").tobytes())}
    if (broken := divergence(motion)) is not None:
        yield hashed | {"verdict": broken.verdict, "reason": broken.reason}
        return
    met = "; ".join(limitation.message for limitation in found.limitations if not limitation.is_minor)
    for metric, value in measure(scene, motion).items():
        yield hashed | {"metric": metric, "unit": METRICS[metric].unit, "value": value, "verdict": "measured", "reason": met}


def _recorded(entry: EngineEntry, scene: Scenario, dt: float) -> Recording | Breakdown:
    assert entry.engine is not None
    return try_record(entry.engine, scene, dt)


if __name__ == "__main__":
    main(*sys.argv[1:])
