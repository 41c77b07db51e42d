"""Simulations with PyBullet: the scene built in a physics server of this process, limitations reported."""

import math
import os
import sys
from collections.abc import Mapping, Sequence
from functools import cache, partial
from importlib import import_module
from itertools import chain
from struct import pack
from typing import Any

import numpy as np

from dropspin.comparisons.engines.base import Array, AsBuilt, Simulation
from dropspin.comparisons.engines.mapping import (
    FLOOR_HALF_SIZE,
    SQUARE,
    TRIANGLES,
    bodies_in,
    box_of,
    built,
    principal_frame,
)
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.engines.pybullet_limitations import is_hull, limitations_met
from dropspin.comparisons.engines.pybullet_settings import SETTINGS, read_back
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Body, Box, Capsule, Ellipsoid, OnAxis, Sphere
from dropspin.scenarios.bodies.inertia import is_diagonal
from dropspin.scenarios.rotations import conjugate, multiply, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, RATES, UP
from dropspin.scenarios.surfaces import Floor, Surface, Wall

BALL = 1e-9  # of the body's size; the radius of the balls that are its vertices, which must not be 0
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
Z_TO_Y = np.array([-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
"""The rotation that takes the z axis, along which Bullet has capsules and cylinders, to the y axis."""
CHUNK = 512  # states that are read before they are stored as numbers of an array
MOST_USES = 50
"""Simulations after which a connection is reset, which takes as long as 500 steps; until then the shapes of removed bodies take memory."""


class PyBulletSimulation(Simulation):
    """A connection to the physics server in this process, which no other simulation uses until it is closed."""

    def __init__(
        self,
        scene: Scenario,
        dt: float,
        form: Mapping[str, str],
        parameters: Mapping[str, Any],
        dynamics: Mapping[str, Any],
        surfaces: Sequence[Mapping[str, Any]],
    ) -> None:
        """Build a scene.

        Args:
            scene: The scene.
            dt: Time step [s].
            form: The profile (`calibrated` or `default`), the coordinates (`maximal` or `multibody`), and how body and floor are built; the
                floor is a `plane`, a `box`, or a `mesh` (two triangles), and walls are boxes if the floor is one, else planes.
            parameters: Of the physics engine.
            dynamics: Properties of the body.
            surfaces: Properties of the floor and the walls.
        """
        self._scene, self._dt = scene, dt
        self.velocity_lag = 0.5 * dt / max(1, parameters.get("numSubSteps", 0))
        self._is_maximal = form["coordinates"] == "maximal"
        self._idle = _idle.setdefault(frozenset(parameters), [])
        self._bullet, self._uses = self._idle.pop() if self._idle else (Connection(), 0)
        tensor = scene.body.inertia_tensor
        self._to_body = None if is_diagonal(tensor) else conjugate(principal_frame(tensor)[1])
        try:
            self._bullet.setPhysicsEngineParameter(**parameters)
            self._bullet.setGravity(*map(float, scene.acceleration))
            planes = []
            for surface, properties in zip(scene.surfaces, surfaces, strict=True):
                planes.append(self._add_plane(surface, form["floor"]))
                self._bullet.changeDynamics(planes[-1], -1, **properties)
            self._body, *_ = [self._add_body(one, form["body"], dynamics) for one in bodies_in(scene, form["beside"])]
            of_floor = {f"floor_{name}": value for name, value in surfaces[0].items()} if surfaces else {}
            passed = {**parameters, **dynamics, **of_floor, **({"walls": surfaces[1:]} if scene.wall else {})}
            read = read_back(self._bullet, self._body, planes[0] if planes else None, self._is_maximal)
            differing = {name: value for name, value in read.items() if name in passed or value != SETTINGS[name].default}
            self.settings = {"version": version("pybullet"), **form, **passed, **differing}
        except BaseException:
            self._reset()
            raise

    def _add(self, mass: float, shape: int, position: Sequence[float], **given: Any) -> int:
        """Add a body, and return its number."""
        given["useMaximalCoordinates"] = self._is_maximal
        return int(self._bullet.createMultiBody(mass, shape, basePosition=position, **given))

    def _add_body(self, scene: Scenario, kind: str, dynamics: Mapping[str, float]) -> int:
        body, start = scene.body, scene.start
        moments, axes = principal_frame(body.inertia_tensor)
        orientation = start.orientation if is_diagonal(body.inertia_tensor) else multiply(np.array(start.orientation), axes).tolist()
        shape = -1 if scene.floor is None else self._shape_of(body, kind, axes)
        added = self._add(body.mass, shape, start.position, baseOrientation=orientation)
        self._bullet.changeDynamics(added, -1, mass=body.mass, localInertiaDiagonal=moments.tolist(), **dynamics)
        self._bullet.resetBaseVelocity(added, start.velocity, start.angular_velocity)
        return added

    def _shape_of(self, body: Body, kind: str, axes: Array) -> Any:
        """The shape in the frame of the body's principal axes, a quaternion."""
        bullet, is_turned = self._bullet, axes[3] != 1.0
        corners = (unrotate(axes, body.hull) if is_turned else body.hull).tolist()
        if kind == "hull" or is_hull(body):
            return bullet.createCollisionShape(bullet.GEOM_MESH, vertices=corners)
        at = {"collisionFramePosition": unrotate(axes, -body.centre).tolist()} if body.centre.any() else {}
        along_z = isinstance(body, OnAxis)
        if is_turned or along_z:
            at["collisionFrameOrientation"] = multiply(conjugate(axes), Z_TO_Y if along_z else IDENTITY).tolist()
        if isinstance(body, Sphere):
            return bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=body.radius, **at)
        if isinstance(body, Box):
            return bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=body.half_extents, **at)
        if isinstance(body, OnAxis):
            kind_of = bullet.GEOM_CAPSULE if isinstance(body, Capsule) else bullet.GEOM_CYLINDER
            return bullet.createCollisionShape(kind_of, radius=body.radius, height=2.0 * body.half_length, **at)
        if isinstance(body, Ellipsoid):
            return bullet.createCollisionShape(bullet.GEOM_MESH, vertices=unrotate(axes, body.outline.vertices).tolist())
        # Bullet gives a convex hull one contact point per step: a prism that rolls leaves its course by 0.07 m in 1.7 m, at 1 ms.
        balls = [bullet.GEOM_SPHERE] * len(corners)
        radii = [BALL * body.size] * len(corners)
        return bullet.createCollisionShapeArray(balls, radii=radii, collisionFramePositions=corners)

    def _add_plane(self, surface: Surface, kind: str) -> int:
        """Add the floor, or a wall, and return its number."""
        bullet = self._bullet
        normal, point = (surface.normal, surface.point) if isinstance(surface, Wall) else (UP, np.zeros(3))
        if isinstance(surface, Floor) and kind == "mesh":
            mesh = {"flags": bullet.GEOM_FORCE_CONCAVE_TRIMESH, "vertices": SQUARE, "indices": list(chain(*TRIANGLES))}
            return self._add(0.0, bullet.createCollisionShape(bullet.GEOM_MESH, **mesh), [0, 0, 0])
        if kind != "box" and not (isinstance(surface, Floor) and surface.ends):
            return self._add(0.0, bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=list(normal)), list(point))
        # A box, because on a plane Bullet gives a box one contact point per step.
        half = box_of(surface) if isinstance(surface, Floor) else [FLOOR_HALF_SIZE] * 3
        turn = {"baseOrientation": conjugate(surface.frame).tolist()} if isinstance(surface, Wall) else {}
        position = (np.array(point) - half[1] * np.array(normal)).tolist()
        return self._add(0.0, bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half), position, **turn)

    def advance(self, steps: int) -> None:
        step, client = self._bullet.module.stepSimulation, self._bullet.client
        for _ in range(steps):
            step(client)

    def state(self) -> Array:
        return self._states_after_each(0, 1)[0].copy()

    def _states_after_each(self, steps: int, count: int) -> Array:
        """The states of the scene's body after each of `count` times `steps` steps, shape (count, 13)."""
        rows = self._bullet.states_after_each(self._body, steps, count)
        if self._to_body is None:
            return rows
        return np.hstack([rows[:, POSITION], multiply(rows[:, ORIENTATION], self._to_body), rows[:, RATES]])

    def record(self, steps: int, every: int = 1) -> Array:
        rows = np.empty((1 + steps // every, 13))
        rows[0] = self.state()
        for first in range(1, len(rows), CHUNK):
            rows[first : first + CHUNK] = self._states_after_each(every, min(CHUNK, len(rows) - first))
        self.known_limitations = list(limitations_met(self._scene, rows, self._dt, self._is_maximal)) if every == 1 else []
        return rows

    def as_built(self) -> AsBuilt:
        dynamics = self._bullet.getDynamicsInfo(self._body, -1)
        world = self._bullet.getPhysicsEngineParameters()
        gravity = np.array([world[f"gravityAcceleration{axis}"] for axis in "XYZ"])
        return built(dynamics[0], dynamics[2], IDENTITY if self._to_body is None else conjugate(self._to_body), gravity)

    def close(self) -> None:
        if self._uses == MOST_USES or not np.isfinite(self.state()).all():
            self._reset()
            return
        for number in reversed(range(self._bullet.getNumBodies())):
            self._bullet.removeBody(self._bullet.getBodyUniqueId(number))
        self._idle.append((self._bullet, self._uses + 1))

    def _reset(self) -> None:
        self._bullet.resetSimulation()
        self._idle.append((self._bullet, 0))


class Connection:
    """A connection to a physics server in this process: PyBullet's functions with its number."""

    def __init__(self) -> None:
        self.module = _import_quietly()
        self.client = int(self.module.connect(self.module.DIRECT))
        if self.client < 0:
            raise RuntimeError("PyBullet returned no connection")

    def __getattr__(self, name: str) -> Any:
        found = getattr(self.module, name)
        return partial(found, physicsClientId=self.client) if callable(found) else found

    def states_after_each(self, body: int, steps: int, count: int) -> Array:
        """The states of a body's inertial frame after each of `count` times `steps` steps, shape (count, 13).

        There are no look-ups in the loop, because reading costs as much as a step.
        """
        bullet, client, numbers = self.module, self.client, list[float]()
        step = bullet.stepSimulation
        pose = bullet.getBasePositionAndOrientation
        rates = bullet.getBaseVelocity
        for _ in range(count):
            for _ in range(steps):
                step(client)
            position, orientation = pose(body, client)
            velocity, spin = rates(body, client)
            numbers += position
            numbers += orientation
            numbers += velocity
            numbers += spin
        return np.frombuffer(pack(f"{len(numbers)}d", *numbers)).reshape(-1, 13)


_idle: dict[frozenset[str], list[tuple[Connection, int]]] = {}
"""Unused connections, by the names of the parameters set in them, and how often each was used since it was reset.

They give the bits that new ones give.
"""


@cache
def _import_quietly() -> Any:
    """Import pybullet without the build date that it writes to the standard error of every process."""
    sys.stderr.flush()
    kept = os.dup(2)
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        return import_module("pybullet")
    finally:
        os.dup2(kept, 2)
        os.close(kept)
