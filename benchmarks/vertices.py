"""The cost of a step of Wang's method that looks at the vertices of a mesh, beside one read of their array: `make bench`.

The mesh is that of the laboratory (docs/laboratory/laboratory.py), with as many vertices and faces as the bunny of the note's course. A
step looks at them where a floor or a wall is within reach of the body. Reading is the fastest of NumPy's max, sum and dot.
"""

import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from dropspin.reference_impl import Body, Floor, Simulator, Wall, World, vertex_inertia

sys.path.insert(0, str(Path(__file__).parents[1] / "docs/laboratory"))
from laboratory import mesh

VERTICES, STEPS, DT, ROUNDS = 29_416, 200, 0.015, 60


def bunny() -> Body:
    """The mesh of the laboratory with 70 cells, and the centres of some of its faces, which become three faces each."""
    points, triangles = mesh(70)
    points = np.vstack([points, points[triangles[: VERTICES - len(points)]].mean(axis=1)])
    return Body(float(VERTICES), vertex_inertia(points, np.ones(VERTICES)), points)


def main() -> None:
    """Print the costs of steps near a floor, near a floor and a wall, and on a floor, where vertices collide."""
    body = bunny()
    numbers, reach = body.points.ravel(), float(np.linalg.norm(body.points, axis=1).max())
    floor, wall = Floor(0.5, np.inf), Wall(np.array([reach, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0]), Floor(0.5, np.inf))
    start = np.array([0.0, reach, 0.0, 0.1, 0.2, 0.3, 0.9, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-9])
    still, corner = Simulator(body, World(None, floor), DT), Simulator(body, World(None, floor, walls=(wall,)), DT)
    falling = Simulator(body, World(np.array([0.0, -9.8, 0.0]), floor, (0.1, 1.0)), DT)
    above = start - 1e-6 * np.eye(13)[1] + 1e-6 * np.eye(13)[0]
    readings: dict[str, Callable[[], object]] = {"numpy's max": numbers.max, "sum": numbers.sum, "dot": partial(numbers.dot, numbers)}
    steps = {"near a floor": (still, above), "near a floor and a wall": (corner, above), "on a floor": (falling, start)}
    runs = {label: partial(simulator.run, state, STEPS, STEPS) for label, (simulator, state) in steps.items()}
    times: dict[str, list[float]] = {label: [] for label in (*readings, *runs)}
    for run in runs.values():
        run()  # compiles
    for _ in range(ROUNDS):
        for label, reading in readings.items():
            began = time.perf_counter()
            for _ in range(STEPS):
                reading()
            times[label].append(time.perf_counter() - began)
        for label, run in runs.items():
            began = time.perf_counter()
            run()
            times[label].append(time.perf_counter() - began)
    best, median = ({label: function(spent) / STEPS * 1e6 for label, spent in times.items()} for function in (min, statistics.median))
    least = [min(values[label] for label in readings) for values in (best, median)]
    print(f"\n{VERTICES:,} vertices [µs a step; times the fastest read of their array: best, median]")
    for label in times:
        ratios = f"x {best[label] / least[0]:5.2f} {median[label] / least[1]:5.2f}"
        print(f"  {label:24} {best[label]:7.1f} {median[label]:7.1f}   {ratios}")


if __name__ == "__main__":
    main()
