"""Simulations with PyBullet: the scene built in a physics server of this process, limitations reported."""

import math
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, partial
from importlib import import_module
from itertools import chain
from struct import pack
from typing import Any

import numpy as np

from dropspin.comparisons.engines.base import Array, AsBuilt, KnownLimitation, Simulation
from dropspin.comparisons.engines.mapping import (
    FLOOR_HALF_SIZE,
    SQUARE,
    TRIANGLES,
    bodies_in,
    box_of,
    built,
    friction_of,
    principal_frame,
)
from dropspin.comparisons.engines.packages import version
from dropspin.scenarios import Scenario, Trajectory
from dropspin.scenarios.bodies import Body, Box, Capsule, Cylinder, Ellipsoid, Mesh, OnAxis, Sphere
from dropspin.scenarios.bodies.inertia import is_diagonal
from dropspin.scenarios.mechanics import angular_momentum, kinetic_energy
from dropspin.scenarios.rotations import conjugate, multiply, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, RATES, SPIN, UP, VELOCITY
from dropspin.scenarios.surfaces import Floor, Surface, Wall

ALMOST = 0.999
NO_PUSH = 1e-6  # relative to what gravity adds in a step
BALL = 1e-9  # of the body's size; the radius of the balls that are its vertices, which must not be 0
MOST_BALLS = 16  # createCollisionShapeArray drops all others without notice
STRONGEST_FRICTION = 10.0  # Bullet clamps the coefficient of a contact to this
CONTACT = ("restitution", "lateralFriction", "contactProcessingThreshold")
"""The properties of a body that are of its contacts."""
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
Z_TO_Y = np.array([-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
"""The rotation that takes the z axis, along which Bullet has capsules and cylinders, to the y axis."""
UPRIGHT, LEVEL = 0.01, 1e-6  # rad; a difference of heights of corners, relative to the size of the body
CHUNK = 512  # states that are read before they are stored as numbers of an array
MOST_USES = 50
"""Simulations after which a connection is reset, which takes as long as 500 steps; until then the shapes of removed bodies take memory."""
LARGEST_TURN = np.pi / 4  # rad a step; beyond it Bullet's rotation is too small


class PyBulletSimulation(Simulation):
    """A connection to the physics server in this process, which no other simulation uses until it is closed."""

    def __init__(
        self, scene: Scenario, dt: float, form: Mapping[str, str], floor: str, parameters: dict[str, float], dynamics: dict[str, float]
    ) -> None:
        """Build a scene.

        Args:
            scene: The scene.
            dt: Time step [s].
            form: The profile (`calibrated` or `default`), the coordinates (`maximal` or `multibody`), and how body and floor are built.
            floor: `plane`, `box`, or `mesh` (two triangles); walls are then boxes if the floor is one, else planes.
            parameters: Of the physics engine.
            dynamics: Properties of the body.
        """
        self._scene, self._dt, self.velocity_lag = scene, dt, 0.5 * dt
        self._is_maximal, self._idle = form["coordinates"] == "maximal", _idle.setdefault(form["profile"], [])
        self._bullet, self._uses = self._idle.pop() if self._idle else (_Connection(), 0)
        tensor = scene.body.inertia_tensor
        self._to_body = None if is_diagonal(tensor) else conjugate(principal_frame(tensor)[1])
        self.settings = {"version": version("pybullet"), **form, **parameters, **dynamics}
        try:
            self._bullet.setPhysicsEngineParameter(**parameters)
            self._bullet.setGravity(*map(float, scene.acceleration))
            # Bullet multiplies the coefficients of the two bodies; with 1 for one of them, the product is the scene's value.
            if scene.wall is not None:
                dynamics = dynamics | {"restitution": 1.0, "lateralFriction": 1.0}
            for surface in scene.surfaces:
                own = {"restitution": surface.restitution, "lateralFriction": friction_of(surface, STRONGEST_FRICTION)}
                contact = {name: dynamics[name] for name in CONTACT if name in dynamics}
                contact |= own if scene.wall is not None else {"restitution": 1.0, "lateralFriction": 1.0}
                self._bullet.changeDynamics(self._add_plane(surface, floor), -1, **contact)
            self._body, *_ = [self._add_body(one, form["body"], dynamics) for one in bodies_in(scene, form["beside"])]
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
        if kind == "hull" or _is_hull(body):
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
        balls, radii = [bullet.GEOM_SPHERE] * len(corners), [BALL * body.size] * len(corners)
        return bullet.createCollisionShapeArray(balls, radii=radii, collisionFramePositions=corners)

    def _add_plane(self, surface: Surface, kind: str) -> int:
        """Add the floor, or a wall, and return its number."""
        bullet, half = self._bullet, [FLOOR_HALF_SIZE] * 3
        normal, point = (surface.normal, surface.point) if isinstance(surface, Wall) else (UP, np.zeros(3))
        if isinstance(surface, Floor) and kind == "mesh":
            flags, indices = bullet.GEOM_FORCE_CONCAVE_TRIMESH, list(chain(*TRIANGLES))
            return self._add(0.0, bullet.createCollisionShape(bullet.GEOM_MESH, flags=flags, vertices=SQUARE, indices=indices), [0, 0, 0])
        if kind != "box" and not (isinstance(surface, Floor) and surface.ends):
            return self._add(0.0, bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=list(normal)), list(point))
        # A box, because on a plane Bullet gives a box one contact point per step.
        if isinstance(surface, Floor):
            half = box_of(surface)
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
        """The states after each of `count` times `steps` steps, shape (count, 13), without look-ups: reading costs as much as a step."""
        bullet, client, body, numbers = self._bullet.module, self._bullet.client, self._body, list[float]()
        step, pose, rates = bullet.stepSimulation, bullet.getBasePositionAndOrientation, bullet.getBaseVelocity
        for _ in range(count):
            for _ in range(steps):
                step(client)
            position, orientation = pose(body, client)
            velocity, spin = rates(body, client)
            numbers += position
            numbers += orientation
            numbers += velocity
            numbers += spin
        rows = np.frombuffer(pack(f"{len(numbers)}d", *numbers)).reshape(-1, 13)
        if self._to_body is None:
            return rows
        return np.hstack([rows[:, POSITION], multiply(rows[:, ORIENTATION], self._to_body), rows[:, RATES]])

    def record(self, steps: int, every: int = 1) -> Array:
        rows = np.empty((1 + steps // every, 13))
        rows[0] = self.state()
        for first in range(1, len(rows), CHUNK):
            rows[first : first + CHUNK] = self._states_after_each(every, min(CHUNK, len(rows) - first))
        self.known_limitations = list(_limitations_met(self._scene, rows, self._dt, self._is_maximal)) if every == 1 else []
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


class _Connection:
    """A connection to a physics server in this process: PyBullet's functions with its number."""

    def __init__(self) -> None:
        self.module = _import_quietly()
        self.client = int(self.module.connect(self.module.DIRECT))
        if self.client < 0:
            raise RuntimeError("PyBullet returned no connection")

    def __getattr__(self, name: str) -> Any:
        found = getattr(self.module, name)
        return partial(found, physicsClientId=self.client) if callable(found) else found


_idle: dict[str, list[tuple[_Connection, int]]] = {}
"""Unused connections, by profile, and how often each was used since it was reset; they give the bits that new ones give."""


def _limitations_met(scene: Scenario, rows: Array, dt: float, is_maximal: bool) -> Iterator[KnownLimitation]:
    """Bullet's known limitations that a motion met, with states at every step, shape (n, 13)."""
    turn = float(np.linalg.norm(rows[:, SPIN], axis=1).max()) * dt
    if turn > LARGEST_TURN:
        yield KnownLimitation(
            f"the body turns by up to {turn:.3g} rad a step; Bullet's rotations are too small beyond π/4", {"orientation_error": np.pi}
        )
    if scene.floor is None:
        return
    if isinstance(scene.body, Ellipsoid):
        yield KnownLimitation(f"Bullet has no ellipsoids: this one is the convex hull of {len(scene.body.outline.vertices)} points")
    if isinstance(scene.body, Cylinder) and _stands(scene.body, rows):
        yield KnownLimitation("Bullet gives a cylinder that lands upright one contact point in the first step, so that it tips")
    if scene.wall is not None:
        return  # the impulse of the floor is not known apart from those of walls
    fall, friction = dt * scene.acceleration, scene.floor.coefficient
    pushes = np.diff(rows[:, VELOCITY], axis=0) - fall
    along, up = np.hypot(pushes[:, 0], pushes[:, 2]), pushes[:, 1]
    if _is_hull(scene.body) and _lands_flat(scene.body, rows[int(np.argmax(up > NO_PUSH * np.linalg.norm(fall)))]):
        yield KnownLimitation("Bullet gives a convex hull one contact point in a step: one that lands on a face or an edge tips")
    if np.isinf(friction) and bool(np.any((up > NO_PUSH * np.linalg.norm(fall)) & (along > ALMOST * STRONGEST_FRICTION * up))):
        yield KnownLimitation(
            f"a contact needs more than {STRONGEST_FRICTION:g} times its normal force to stick; Bullet clamps friction there, so it slips"
        )
    if is_maximal and 0.0 < friction < np.inf:
        struck = (up > NO_PUSH * np.abs(up).max()) & (along > (1.0 + NO_PUSH) * friction * up)
        if struck.any():
            ratio = float((along[struck] / up[struck]).max()) / friction
            yield _turning_slip(scene, rows, dt, ratio, friction * float(up[struck].max()))


def _is_hull(body: Body) -> bool:
    """Whether a body is Bullet's convex hull of its corners, because these are too many for a compound shape."""
    return isinstance(body, Mesh) and len(body.hull) > MOST_BALLS


def _stands(body: Cylinder, rows: Array) -> bool:
    """Whether a cylinder comes to the floor with its axis within `UPRIGHT` of the vertical, in states of shape (n, 13)."""
    is_upright = np.abs(rotate(rows[:, ORIENTATION], np.broadcast_to(UP, (len(rows), 3)))[:, 1]) > np.cos(UPRIGHT)
    return bool(np.any(is_upright & (rows[:, 1] <= body.size)))


def _lands_flat(body: Body, state: Array) -> bool:
    """Whether several corners are lowest in a state, shape (13,)."""
    return bool(np.ptp(body.lowest(state[ORIENTATION], LEVEL), axis=0).max() > UPRIGHT * body.size)


def _turning_slip(scene: Scenario, rows: Array, dt: float, ratio: float, wrong: float) -> KnownLimitation:
    """The limitation of friction in maximal coordinates.

    Bullet limits friction along the first direction of the slip and across it, each by µ times the normal force. Where the slip turns in an
    impact with the normal impulse J, the impulse along the floor is wrong by up to µ J, and the velocity at the floor by a = µ J/M.

    Args:
        scene: The scene.
        rows: States at every step, shape (n, 13).
        dt: Time step [s].
        ratio: The largest impulse along the floor, over µ times the normal one.
        wrong: a, the error of the velocity at the floor [m/s].
    """
    body, motion, left = scene.body, Trajectory.from_states(dt * np.arange(len(rows), dtype=float), rows), dt * len(rows)
    fastest = float(np.max(np.linalg.norm(motion.velocity, axis=1) + body.size * np.linalg.norm(motion.angular_velocity, axis=1)))
    height = scene.clearance if scene.starts_above_floor else body.size
    g, kinetic = abs(float(scene.acceleration[1])), float(kinetic_energy(scene, motion)[0])
    energy = max(body.mass * g * height, kinetic)
    spin = float(np.linalg.norm(angular_momentum(scene, motion), axis=1).max())
    sizes = {
        "position_error": wrong * left,
        "orientation_error": min(np.pi, body.mass * body.size * wrong / float(np.linalg.eigvalsh(body.inertia_tensor)[0]) * left),
        "energy_error": body.mass * wrong * (fastest + 0.5 * wrong) / energy,
        "friction_cone_excess": (np.sqrt(2.0) - 1.0) * wrong / np.sqrt(2.0 * energy / body.mass),
        "friction_push": body.mass * wrong * fastest / energy,
    }
    if spin > 0.0:
        turned = body.mass * body.size * wrong / spin
        sizes |= {"angular_momentum_error": turned, "angular_momentum_direction_error": min(np.pi, 0.5 * np.pi * turned)}
    if g > 0.0 and scene.starts_above_floor:
        sizes["bounce_height_error"] = wrong * (fastest + 0.5 * wrong) / (g * height)
    return KnownLimitation(
        "in maximal coordinates Bullet limits friction along the initial slip and across it separately: the slip turns, and the impulse "
        f"along the floor is up to {ratio:.3g} µ times the normal one; coordinates=multibody keeps the cone",
        sizes,
    )


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
