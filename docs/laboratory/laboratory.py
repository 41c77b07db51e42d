"""The laboratory of the lecture note: the scene and its mesh, and the tables of docs/laboratory.md.

python laboratory.py write [CELLS]     writes laboratory.toml and laboratory.obj, of 6 CELLS² + 2 vertices; 22 by default, 2,906 vertices
python laboratory.py tables            prints every table of the page, in a minute
"""

import sys
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import dropspin as ds

Array = NDArray[np.float64]

SCENE = """summary = "The laboratory of the lecture note: a body of {count} vertices, thrown at a floor and a wall"
source = "H. Wang, Rigid Body Dynamics (lecture note), with the settings of its course"
duration = 3.0

[body]
shape = "mesh"
file = "laboratory.obj"
mass = {count}.0              # 1 kg for each vertex
inertia = "vertices"

[start]
position = [0.0, 0.59, 0.0]  # 0.6 m, over a floor at 0.01 m
orientation = [0.0, 0.3, 0.0, 1.0]  # turned about the vertical, so that the impact on the wall is oblique
velocity = [5.0, 2.0, 0.0]

[gravity]
acceleration = [0.0, -9.8, 0.0]

[damping]
linear_factor = 0.999
angular_factor = 0.98
factor_dt = 0.015

[floor]
restitution = 0.5
friction = "infinite"

[[wall]]
point = [2.0, 0.0, 0.0]
normal = [-1.0, 0.0, 0.0]
restitution = 0.5
friction = "infinite"
"""
DT, GRAVITY = 0.015, 9.8
RADIUS = 0.15  # m, without the bumps
BUMPS = (((0.4, 0.9, 0.0), 0.5, 0.02), ((-0.4, 0.9, 0.0), 0.5, 0.02), ((0.0, -0.3, 1.0), 0.25, 0.12), ((0.0, -0.3, -1.0), 0.25, 0.12))
"""Two ears and two cheeks: their directions, heights relative to the radius, and widths. The body axes are principal axes."""
CELLS = (1, 2, 4, 8, 16, 22, 32, 50, 70)


def mesh(cells: int) -> tuple[Array, NDArray[np.intp]]:
    """A closed body with ears: the points of a grid on a cube's faces, moved outwards; points (n, 3) and triangles (m, 3)."""
    along = np.tan(np.pi / 4 * np.linspace(-1.0, 1.0, cells + 1))
    points, triangles = [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            grid = np.array([np.roll([side, a, b], axis) for a in along for b in along])
            numbers = len(points) * len(grid) + np.arange(len(grid)).reshape(cells + 1, cells + 1)
            corners = [numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:]][:: int(side)]
            quads = np.stack([corner.ravel() for corner in corners], axis=1)
            triangles += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
            points.append(grid)
    _, first, merged = np.unique(np.round(np.vstack(points), 9), axis=0, return_index=True, return_inverse=True)
    on_cube = np.vstack(points)[first]  # an edge of the cube belongs to two faces
    directions = on_cube / np.linalg.norm(on_cube, axis=1, keepdims=True)
    radius = np.full(len(directions), RADIUS)
    for towards, height, width in BUMPS:
        cosine = directions @ (np.array(towards) / np.linalg.norm(towards))
        radius *= 1.0 + height * np.exp((cosine - 1.0) / width)
    return directions * radius[:, None], merged.ravel()[np.vstack(triangles)]


def write(folder: str | Path, cells: int = 22) -> Path:
    """Write the scene and its mesh, and return the path of the scene."""
    points, triangles = mesh(cells)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()] + [f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()]
    Path(folder, "laboratory.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    scene = Path(folder, "laboratory.toml")
    scene.write_text(SCENE.format(count=len(points)), encoding="utf-8")
    return scene


def scene_of(cells: int, **without: None) -> ds.Scenario:
    """The scene with a mesh, without some of its tables."""
    with tempfile.TemporaryDirectory() as folder:
        return ds.load(write(folder, cells)).model_copy(update=without)


def impacts(scene: ds.Scenario, states: Array, dt: float) -> Array:
    """For each step, whether the floor or the wall acts: gravity and damping do not explain the change of the velocity."""
    factor = scene.damping.factors["linear_factor"] if scene.damping else 1.0
    change = states[1:, 7:10] - factor * (states[:-1, 7:10] + dt * np.array([0.0, -GRAVITY, 0.0]))
    return np.linalg.norm(change, axis=1) > 1e-9


def rotation(states: Array) -> Array:
    """Rotation matrices from body to world, shape (3, 3, n), of states (n, 13) or of one."""
    x, y, z, w = np.atleast_2d(states)[:, 3:7].T
    first = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)]
    second = [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)]
    return np.array([first, second, [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def energies(scene: ds.Scenario, states: Array) -> tuple[Array, Array]:
    """Kinetic energy and potential energy above the floor, per kilogram [J/kg], shape (n,) each."""
    moments = np.array(scene.body.inertia_tensor) / scene.body.mass
    spins = np.einsum("ijn,ni->nj", rotation(states), states[:, 10:])  # in the body frame
    kinetic = 0.5 * np.sum(states[:, 7:10] ** 2, axis=1) + 0.5 * np.einsum("ni,ij,nj->n", spins, moments, spins)
    return kinetic, GRAVITY * states[:, 1]


def first_impact(states: Array) -> int:
    """The last row before the first impact, at the wall or the floor."""
    return int(np.argmax(np.linalg.norm(np.diff(states[:, [7, 9]], axis=0), axis=1) + np.maximum(np.diff(states[:, 8]), 0.0) > 0.1))


def colliding(scene: ds.Scenario, state: Array) -> int:
    """How many vertices are beyond the wall or the floor in a state."""
    points = state[:3] + scene.body.vertices @ rotation(state)[:, :, 0].T
    return int(np.sum((points[:, 1] < 0.0) | (points[:, 0] > 2.0)))


def by_vertices(dt: float) -> Iterator[list[Any]]:
    """For each mesh: the velocities after the first impact, and the position after 1 and 3 s."""
    for cells in CELLS:
        scene = scene_of(cells)
        states = ds.simulate(scene, "wang", dt).states
        row = first_impact(states)
        after, late, end = states[row + 1], states[round(1.0 / dt)], states[-1]
        count = colliding(scene, states[row])
        yield [len(scene.body.points), count, after[7], after[8], after[10], after[12], late[0], late[1], end[0], end[1]]


def by_steps() -> Iterator[list[Any]]:
    """For each time step: the position after 1 and 3 s, with the damping factors in each step, and with the decay rates."""
    scene = scene_of(22)
    assert scene.damping is not None
    rates = scene.model_copy(update={"damping": scene.damping.model_copy(update={"factor_dt": None})})
    for dt in (DT, DT / 2, DT / 4, DT / 8, DT / 16):
        row: list[Any] = [f"{1e3 * dt:.3g} ms"]
        for one in (scene, rates):
            states = ds.simulate(one, "wang", dt).states
            row += [states[round(1.0 / dt)][0], states[-1][0]]
        yield row


def budget(engine: str, cells: int = 22) -> list[Any]:
    """Energies over 3 s [J/kg]: at the start; changes in flight, at the floor and at the wall; the largest gain in a step; at the end."""
    scene = scene_of(cells)
    states = ds.simulate(scene, engine, DT).states
    kinetic, height = energies(scene, states)
    total, acts = kinetic + height, impacts(scene, states, DT)
    gains = np.diff(total)
    rest = GRAVITY * scene.body.resting_height
    walls = acts & (np.abs(np.diff(states[:, 7])) > np.abs(np.diff(states[:, 8])))
    return [engine, total[0] - rest, gains[~acts].sum(), gains[acts & ~walls].sum(), gains[walls].sum(), gains.max(), total[-1] - rest]


def across_engines() -> Iterator[list[Any]]:
    """For each engine: the velocities after the first impact, which is at the wall, and the position after 1 s."""
    scene = scene_of(22)
    for engine in ("wang", "wang[contact=sequential,law=coulomb]", "mujoco", "pybullet"):
        for dt in (DT, DT / 16):
            states = ds.simulate(scene, engine, dt).states
            after, late = states[first_impact(states) + 2], states[round(1.0 / dt)]
            yield [engine, f"{1e3 * dt:.3g} ms", after[7], after[8], after[10], after[12], late[0], late[1]]


def cell(value: Any) -> str:
    """A value of a table."""
    return f"{value:.3f}" if isinstance(value, float) else f"{value:,}" if isinstance(value, int) else str(value)


def table(title: str, names: str, rows: Iterator[list[Any]]) -> None:
    """Write a table in Markdown."""
    columns = names.split(", ")
    lines = [f"| {' | '.join(map(cell, row))} |" for row in rows]
    sys.stdout.write("\n".join([f"\n{title}\n", f"| {' | '.join(columns)} |", f"|{'---|' * len(columns)}", *lines]) + "\n")


def main(command: str, *given: str) -> None:
    """Write the scene, or its tables."""
    if command == "write":
        write(".", *map(int, given))
        return
    warnings.simplefilter("ignore")  # of contacts that did not converge
    names = "vertices, beyond the wall, v_x, v_y, ω_x, ω_z, x at 1 s, y at 1 s, x at 3 s, y at 3 s"
    table("Wang's method at 15 ms", names, by_vertices(DT))
    table("Wang's method, 2,906 vertices", "dt, factors: x at 1 s, x at 3 s, rates: x at 1 s, x at 3 s", by_steps())
    engines = ("wang", "wang[rotation=exact]", "wang[law=poisson]", "wang[contact=sequential,law=coulomb]")
    table("Energy in J/kg", "engine, start, in flight, floor, wall, largest gain, end", map(budget, engines))
    table("Engines, 2,906 vertices", "engine, dt, v_x, v_y, ω_x, ω_z, x at 1 s, y at 1 s", across_engines())


if __name__ == "__main__":
    main(*sys.argv[1:])
