"""Speed of Wang's method (the engine `wang`) compared with MuJoCo and PyBullet: `make bench`.

All entries step the same box in one process, in turn, round after round. Ratios of the best and of the median times are printed, because
absolute times on a shared machine are noise. The models differ: MuJoCo and PyBullet solve four contact points with friction cones for
articulated systems, Wang's method one impulse.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dropspin import reference_impl, scenarios
from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.results.provenance import processor, versions
from dropspin.reference_impl.methods import ROTATIONS
from dropspin.reference_impl.threads import usable_cores

Array = NDArray[np.float64]

ROUNDS = 15
WINDOW = 0.02
"""Seconds that each entry runs in a round, repeatedly: long compared with the time in which a processor settles after the previous one."""
STEPS = 5000
DT = 1e-3
BODIES = 1024
SIZES = (16, 128, 1024, 10_000, 100_000)
BOX = {"shape": "box", "half_extents": [0.1, 0.05, 0.15], "mass": 1.0}
OUT = Path("out")


def scene(name: str) -> scenarios.Scenario:
    """A box of 1 kg in flight, without a floor or over one far below; dropped from 1 m; or lying on the floor."""
    content = {
        "name": name,
        "duration": STEPS * DT,
        "body": BOX,
        "start": {"position": [0.0, 1.05, 0.0], "angular_velocity": [1.0, 2.0, 3.0]},
        "gravity": {"acceleration": [0.0, -9.8, 0.0]},
    }
    floor = {"restitution": 0.5, "friction": "infinite"}
    if name == "drop":
        content |= {"floor": floor}
    if name == "far":
        content |= {"floor": floor, "start": content["start"] | {"position": [0.0, 900.0, 0.0]}}
    if name == "rest":
        content |= {"floor": floor, "start": {"position": [0.0, 0.05, 0.0]}}
    return scenarios.load(content)


@dataclass(frozen=True)
class Run:
    """A run to time: a number of steps of a number of bodies."""

    go: Callable[[], object]
    body_steps: int = STEPS
    close: Callable[[], None] = lambda: None


Entry = Callable[[], Run]
"""Builds a new run; building is not timed."""


def alone(label: str, name: str, recording: bool) -> Entry:
    """An engine with one body, stepping only or recording every step."""
    chosen = engine(label)

    def build() -> Run:
        simulation = chosen.prepare(scene(name), DT)
        return Run(partial(simulation.record if recording else simulation.advance, STEPS), close=simulation.close)

    return build


def rollout(name: str) -> Entry:
    """MuJoCo's own loop that records every step."""
    import mujoco
    from mujoco.rollout import rollout as mujoco_rollout

    def build() -> Run:
        simulation: Any = engine("mujoco").prepare(scene(name), DT)
        model, data = simulation._model, simulation._data
        size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        start, rows = np.empty(size), np.empty((1, STEPS, size))
        mujoco.mj_getState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        return Run(partial(mujoco_rollout, model, data, start[None], nstep=STEPS, state=rows, sensordata=np.empty((1, STEPS, 0))))

    return build


def ensemble(name: str, bodies: int = BODIES, steps: int = STEPS, threads: int = 1) -> Entry:
    """The reference implementation with many bodies in one call, each with its own start (at rest: the same)."""
    spread = np.random.default_rng(0).normal(size=(bodies, 7)) if name != "rest" else np.zeros((bodies, 7))
    starts = np.tile(scene(name).initial_state, (bodies, 1))
    starts[:, 3:7] += 0.3 * spread[:, :4]
    starts[:, 3:7] /= np.linalg.norm(starts[:, 3:7], axis=1, keepdims=True)
    starts[:, 10:13] += spread[:, 4:]
    simulator = reference_impl.Simulator(*body_and_world(name), DT)
    simulator.run(starts, 1)  # compiles before anything is timed
    return lambda: Run(partial(simulator.run, starts, steps, steps, threads=threads), bodies * steps)


def body_and_world(name: str) -> tuple[reference_impl.Body, reference_impl.World]:
    """The box of the scenes, as the reference implementation takes it."""
    half = np.array(BOX["half_extents"])
    corners = np.array(list(product((-1, 1), repeat=3))) * half
    floor = None if name == "flight" else reference_impl.Floor(0.5, np.inf)
    body = reference_impl.Body(1.0, reference_impl.solid_box_inertia(1.0, half), corners)
    return body, reference_impl.World(np.array([0.0, -9.8, 0.0]), floor)


def prepared(start: Array, body: reference_impl.Body, world: reference_impl.World, rotation: str = "note") -> Entry:
    """The reference implementation without the adapter."""
    simulator = reference_impl.Simulator(body, world, DT, reference_impl.Methods(rotation=rotation))
    simulator.run(start, 1)
    return lambda: Run(partial(simulator.run, start, STEPS, STEPS))


def timed(makers: dict[str, Entry]) -> dict[str, list[float]]:
    """Nanoseconds per step and body of each entry, one value per round."""
    runs = {}
    for label, make in makers.items():
        first = make()
        runs[label] = max(1, round(WINDOW / (nanoseconds_a_step([first]) * first.body_steps * 1e-9)))
    nanoseconds: dict[str, list[float]] = {label: [] for label in makers}
    for _ in range(ROUNDS):
        for label, make in makers.items():
            nanoseconds[label].append(nanoseconds_a_step([make() for _ in range(runs[label])]))
    return nanoseconds


def nanoseconds_a_step(runs: list[Run]) -> float:
    """Nanoseconds per step and body of runs one after the other."""
    start = time.perf_counter()
    for run in runs:
        run.go()
    taken = time.perf_counter() - start
    for run in runs:
        run.close()
    return taken / sum(run.body_steps for run in runs) * 1e9


def rotations() -> dict[str, Entry]:
    """Every rotation method with a free body."""
    body = reference_impl.Body(1.0, np.diag([1.0, 2.0, 3.0]), np.full((1, 3), 0.1))
    start = np.array([0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0.3, 0.8, -0.5])
    return {name: prepared(start, body, reference_impl.World(), name) for name in ROTATIONS}


def parts() -> dict[str, Entry]:
    """A ball in flight with everything modelled, and with one part after the other not modelled."""
    ball = reference_impl.Body(1.0, 0.004 * np.eye(3), np.zeros((1, 3)), (0.1, 0.1, 0.1))
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


def floors() -> dict[str, Entry]:
    """Each engine in flight, without a floor and with one that the body does not reach."""
    names = {"flight": "no floor", "far": "a floor far below"}
    return {
        f"{label}, {floor}": alone(label, name, recording=False)
        for label in ("wang", "mujoco", "pybullet")
        for name, floor in names.items()
    }


def first_call(cached: bool, width: str) -> float:
    """Duration of the first `simulate` in a new process [s], without the import of numba."""
    program = (
        "import time, numpy as np, reference_impl as r\n"
        "b = r.Body(1.0, np.eye(3), np.ones((8, 3))); w = r.World(np.array([0, -9.8, 0]), r.Floor(.5, np.inf))\n"
        "s = np.array([0, 5, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.])\n"
        f"if {width == 'ensemble'}: s = np.tile(s, (32, 1))\n"
        "t = time.perf_counter(); r.simulate(s, b, w, 1e-3, 10)\n"
        "print(time.perf_counter() - t)\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": folder}
        for _ in range(2 if cached else 1):
            done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    return float(done.stdout)


Table = dict[str, dict[str, float]]


def report(title: str, nanoseconds: dict[str, list[float]], base: str) -> Table:
    """Print one comparison: best and median times, and their ratios to those of the base."""
    print(f"\n{title} [ns a step; times {base}: best, median]")
    table = {}
    for label, values in nanoseconds.items():
        best, median = min(values), statistics.median(values)
        ratios = best / min(nanoseconds[base]), median / statistics.median(nanoseconds[base])
        table[label] = {"best": best, "median": median, "best_ratio": ratios[0], "median_ratio": ratios[1]}
        print(f"  {label:22} {best:9.1f} {median:9.1f}   x {ratios[0]:7.2f} {ratios[1]:7.2f}")
    return table


def lead(title: str, table: Table, ours: str, engines: Iterable[str]) -> dict[str, float]:
    """The speed of one of our entries relative to the fastest of some engines."""
    ratios = {kind: min(table[label][kind] for label in engines) / table[ours][kind] for kind in ("best", "median")}
    print(f"  {title}: {ratios['best']:.1f} times as many steps a second as the faster engine (by the medians {ratios['median']:.1f})")
    return ratios


def plot(results: dict[str, Table], path: Path) -> None:
    """Plot the best times, a panel for each comparison, all on one logarithmic scale."""
    from matplotlib.figure import Figure

    rows = -(-len(results) // 3)
    figure = Figure(figsize=(13, 2.1 * rows), layout="constrained")
    for axes, (title, table) in zip(figure.subplots(rows, 3, sharex=True).flat, results.items(), strict=False):
        best = [row["best"] for row in table.values()]
        axes.plot(best, list(table), "o", color="#0072B2")
        for place, nanoseconds in enumerate(best):
            axes.annotate(
                f"{nanoseconds:,.0f}" if nanoseconds >= 100 else f"{nanoseconds:.1f}",
                (nanoseconds, place),
                (6, -3),
                textcoords="offset points",
                fontsize=8,
            )
        axes.set(xscale="log", xlim=(1, 5e4), ylim=(len(best) - 0.5, -0.5))
        axes.set_title(f"{title} [ns a step]", fontsize=9)
        axes.tick_params(labelsize=8, labelbottom=True)
        axes.grid(axis="x", alpha=0.3)
    figure.savefig(path)


def main() -> None:
    """Run all comparisons, print them, and write `out/bench.json` and `out/bench.svg`."""
    OUT.mkdir(exist_ok=True)
    results: dict[str, Table] = {}
    leads = {}
    many = f"wang, {BODIES} at once"
    for name in ("flight", "drop", "rest"):
        stepping = {label: alone(label, name, recording=False) for label in ("wang", "mujoco", "pybullet")}
        title = f"{name}, stepping alone"
        results[title] = table = report(title, timed(stepping | {many: ensemble(name), "mujoco.rollout": rollout(name)}), "wang")
        for ours in ("wang", many):
            leads[f"{ours}: {name}"] = lead(ours, table, ours, ("mujoco", "mujoco.rollout", "pybullet"))
        recording = {label: alone(label, name, recording=True) for label in ("wang", "mujoco", "pybullet")}
        title = f"{name}, every step recorded"
        results[title] = table = report(title, timed(recording | {"mujoco.rollout": rollout(name)}), "wang")
        leads[f"wang, recording: {name}"] = lead("wang", table, "wang", ("mujoco", "mujoco.rollout", "pybullet"))
        sizes = {f"{size} bodies": ensemble(name, size, steps=1000) for size in SIZES}
        title = f"{name}, ensembles, 1,000 steps a call"
        results[title] = report(title, timed(sizes), f"{BODIES} bodies")
    cores = {f"threads: {threads}": ensemble("drop", threads=threads) for threads in sorted({1, 2, usable_cores()})}
    results["drop, ensembles, threads"] = report("drop, ensembles, threads", timed(cores), "threads: 1")
    results["rotation methods"] = report("rotation methods", timed(rotations()), "note")
    results["parts that are not modelled"] = report("parts that are not modelled", timed(parts()), "everything")
    results["a floor that is not reached"] = report("a floor that is not reached", timed(floors()), "wang, no floor")
    first = {f"{kind}, {width}": first_call(kind == "cached", width) for width in ("one body", "ensemble") for kind in ("cold", "cached")}
    print("\nfirst call in a new process: " + "; ".join(f"{label} {seconds:.2f} s" for label, seconds in first.items()))
    stamp = {"versions": versions(), "cpu": processor()}
    (OUT / "bench.json").write_text(json.dumps({"results": results, "leads": leads, "first_call": first} | stamp, indent=1))
    plot(results, OUT / "bench.svg")
    print(f"Written: {OUT / 'bench.json'}, {OUT / 'bench.svg'}")


if __name__ == "__main__":
    main()
