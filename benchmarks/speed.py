"""How fast the note's method runs beside MuJoCo and PyBullet: `make bench`.

All contestants step the same box in one process, in turn, round after round; what is printed are ratios of the best and of the median
times, because absolute times on a shared machine are noise. Not compared are the models: the engines solve four contact points with
friction cones for articulated systems, the note one impulse.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import reference_impl
import scenarios
from comparisons import engine
from comparisons.provenance import processor, versions
from reference_impl.methods import ROTATIONS

Array = NDArray[np.float64]

ROUNDS = 15
STEPS = 5000
DT = 1e-3
OUT = Path("out")


def scene(name: str) -> scenarios.Scenario:
    """A box of 1 kg in flight without a floor, dropped from 1 m, or lying on the floor."""
    content = {
        "name": name,
        "duration": STEPS * DT,
        "body": {"shape": "box", "half_extents": [0.1, 0.05, 0.15], "mass": 1.0},
        "start": {"position": [0.0, 1.05, 0.0], "angular_velocity": [1.0, 2.0, 3.0]},
        "gravity": {"acceleration": [0.0, -9.8, 0.0]},
    }
    floor = {"restitution": 0.5, "friction": "infinite"}
    if name == "drop":
        content |= {"floor": floor}
    if name == "rest":
        content |= {"floor": floor, "start": {"position": [0.0, 0.05, 0.0]}}
    return scenarios.load(content)


Contestant = Callable[[], tuple[Callable[[], object], Callable[[], object]]]
"""Builds anew and gives what to time and what to do afterwards."""


def contestants(name: str, recording: bool) -> dict[str, Contestant]:
    """The engines on one scene, stepping alone or recording every step."""

    def maker(label: str) -> Contestant:
        chosen = engine(label)

        def build() -> tuple[Callable[[], object], Callable[[], object]]:
            simulation = chosen.prepare(scene(name), DT)
            return (partial(simulation.record if recording else simulation.advance, STEPS), simulation.close)

        return build

    return {label: maker(label) for label in ("document", "mujoco", "pybullet")}


def prepared(start: Array, body: reference_impl.Body, world: reference_impl.World, rotation: str = "note") -> Contestant:
    """The reference implementation by itself."""
    simulator = reference_impl.Simulator(body, world, DT, reference_impl.Methods(rotation=rotation))
    simulator.run(start, 1)  # compiled before anything is timed
    return lambda: (partial(simulator.run, start, STEPS, STEPS), lambda: None)


def timed(makers: dict[str, Contestant]) -> dict[str, list[float]]:
    """Nanoseconds a step of each contestant, once a round, in turn; building is not timed."""
    seconds: dict[str, list[float]] = {label: [] for label in makers}
    for _ in range(ROUNDS):
        for label, make in makers.items():
            run, close = make()
            start = time.perf_counter()
            run()
            seconds[label].append((time.perf_counter() - start) / STEPS * 1e9)
            close()
    return seconds


def rotations() -> dict[str, Contestant]:
    """Every rotation method on a free body."""
    body = reference_impl.Body(1.0, np.diag([1.0, 2.0, 3.0]), np.full((1, 3), 0.1))
    start = np.array([0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0.3, 0.8, -0.5])
    return {name: prepared(start, body, reference_impl.World(), name) for name in ROTATIONS}


def parts() -> dict[str, Contestant]:
    """A ball in flight with everything modelled, and with one part after the other left out."""
    ball = reference_impl.Body(1.0, 0.004 * np.eye(3), np.zeros((1, 3)), 0.1)
    turning = np.array([0, 1e3, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1e-3])
    still = np.array([0, 1e3, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.0])
    g, floor = np.array([0, -9.8, 0]), reference_impl.Floor(0.5, 0.0)
    return {
        "everything": prepared(turning, ball, reference_impl.World(g, floor, (0.1, 0.1))),
        "no damping": prepared(turning, ball, reference_impl.World(g, floor)),
        "no floor": prepared(turning, ball, reference_impl.World(g)),
        "no gravity": prepared(turning, ball, reference_impl.World()),
        "cannot turn": prepared(still, ball, reference_impl.World(g)),
    }


def first_call(cached: bool) -> float:
    """Seconds of the first simulate in a fresh process, import of numba apart."""
    program = (
        "import time, numpy as np, reference_impl as r\n"
        "b = r.Body(1.0, np.eye(3), np.ones((8, 3))); w = r.World(np.array([0, -9.8, 0]), r.Floor(.5, np.inf))\n"
        "s = np.array([0, 5, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.]); t = time.perf_counter(); r.simulate(s, b, w, 1e-3, 10)\n"
        "print(time.perf_counter() - t)\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": folder}
        for _ in range(2 if cached else 1):
            done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    return float(done.stdout)


def report(title: str, nanoseconds: dict[str, list[float]], base: str) -> dict[str, dict[str, float]]:
    """Print one comparison: best and median, and how many times the base each takes."""
    print(f"\n{title} [ns a step; times {base}, best and median]")
    table = {}
    for label, values in nanoseconds.items():
        best, median = min(values), statistics.median(values)
        ratios = best / min(nanoseconds[base]), median / statistics.median(nanoseconds[base])
        table[label] = {"best": best, "median": median, "best_ratio": ratios[0], "median_ratio": ratios[1]}
        print(f"  {label:22} {best:9.1f} {median:9.1f}   x {ratios[0]:7.2f} {ratios[1]:7.2f}")
    return table


def plot(results: dict[str, dict[str, dict[str, float]]], path: Path) -> None:
    """Bars of the best times, a panel for each comparison."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 2.2 * ((len(results) + 1) // 2)), layout="constrained")
    for number, (title, table) in enumerate(results.items(), start=1):
        axes = figure.add_subplot((len(results) + 1) // 2, 2, number)
        axes.barh(list(table), [row["best"] for row in table.values()], color="#0072B2")
        axes.set_xscale("log")
        axes.set_title(title, fontsize=9)
        axes.set_xlabel("ns a step", fontsize=8)
        axes.tick_params(labelsize=8)
        axes.invert_yaxis()
    figure.savefig(path)


def main() -> None:
    """Run all comparisons, print them, and write `out/bench.json` and `out/bench.svg`."""
    OUT.mkdir(exist_ok=True)
    results = {}
    for name in ("flight", "drop", "rest"):
        for recording in (False, True):
            title = f"{name}, {'every step recorded' if recording else 'stepping alone'}"
            results[title] = report(title, timed(contestants(name, recording)), "document")
    results["rotation methods"] = report("rotation methods", timed(rotations()), "note")
    results["what leaving out saves"] = report("what leaving out saves", timed(parts()), "everything")
    first = {"cold": first_call(cached=False), "warm": first_call(cached=True)}
    print(f"\nfirst call in a fresh process: {first['cold']:.2f} s without a cache, {first['warm']:.2f} s with")
    stamp = {"versions": versions(), "cpu": processor()}
    (OUT / "bench.json").write_text(json.dumps({"results": results, "first_call": first} | stamp, indent=1))
    plot(results, OUT / "bench.svg")
    print(f"Written: {OUT / 'bench.json'}, {OUT / 'bench.svg'}")


if __name__ == "__main__":
    main()
