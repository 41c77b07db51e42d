"""Simulations with PyBullet: the scene built in a physics server of this process, limitations reported."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from itertools import product
from struct import pack
from typing import Any

import numpy as np

from dropspin.comparisons.engines.base import FLOOR_HALF_SIZE, Array, AsBuilt, KnownLimitation, Simulation, version
from dropspin.comparisons.engines.pybullet_settings import (
    FASTEST,
    STRONGEST_FRICTION,
    contact_properties,
    damping_properties,
    world_parameters,
)
from dropspin.scenarios import Scenario, Trajectory
from dropspin.scenarios.bodies import Box, Sphere, Vertices
from dropspin.scenarios.mechanics import angular_momentum, kinetic_energy
from dropspin.scenarios.state import SPIN, VELOCITY
from dropspin.scenarios.variations import heavy_neighbour

ALMOST = 0.999
NO_PUSH = 1e-6  # relative to what gravity adds in a step
BALL = 1e-9  # of the body's size; the radius of the balls that are its vertices, which must not be 0
MOST_BALLS = 16  # createCollisionShapeArray drops all others without notice
SQUARE = {
    "vertices": [[x, 0.0, z] for x, z in product((-FLOOR_HALF_SIZE, FLOOR_HALF_SIZE), repeat=2)],
    "indices": [0, 1, 2, 2, 1, 3],
}
"""The floor as a mesh: two triangles, with upward normals."""
CHUNK = 512  # states that are read before they are stored as numbers of an array
MOST_USES = 50
"""Simulations after which a connection is reset, which takes as long as 500 steps; until then the shapes of removed bodies take memory."""
LARGEST_TURN = np.pi / 4  # rad a step; beyond it Bullet's rotation is too small


@dataclass(frozen=True)
class Form:
    """How a scene is built.

    Attributes:
        default: Whether Bullet keeps its defaults.
        multibody: Whether the body is a btMultiBody rather than a btRigidBody.
        unclamped: Whether the clamp of a multibody's speeds is removed.
        body: `shape`, or `hull`, a body with corners as their convex hull.
        floor: `plane`, `box`, `mesh` (two triangles), or `fitting`: with calibrated settings a box for boxes, else a plane.
        beside: `none`, or `heavy`, a second body far away.
    """

    default: bool
    multibody: bool
    unclamped: bool
    body: str = "shape"
    floor: str = "fitting"
    beside: str = "none"

    def floor_in(self, scene: Scenario) -> str:
        """The floor of a scene: `plane`, `box` or `mesh`."""
        if self.floor == "fitting":
            return "plane" if self.default or not isinstance(scene.body, Box) else "box"
        return self.floor


class PyBulletSimulation(Simulation):
    """A connection to the physics server in this process, which no other simulation uses until it is closed."""

    def __init__(self, scene: Scenario, dt: float, form: Form) -> None:
        self._bullet = _import_quietly()
        self._dt, self._fall, self.velocity_lag = dt, dt * scene.acceleration, 0.5 * dt
        self._grips = scene.floor is not None and scene.floor.friction == "infinite"
        self._turning_slip_of = scene if scene.floor is not None and 0.0 < scene.floor.coefficient < np.inf and not form.multibody else None
        self._idle = _idle.setdefault(form.default, [])
        self._client, self._uses = self._idle.pop() if self._idle else (int(self._bullet.connect(self._bullet.DIRECT)), 0)
        if self._client < 0:
            raise RuntimeError("PyBullet returned no connection")
        try:
            self._build(scene, dt, form)
        except BaseException:
            self._reset()
            raise

    def _build(self, scene: Scenario, dt: float, form: Form) -> None:
        bullet, client, default = self._bullet, self._client, form.default
        parameters = {"fixedTimeStep": dt} if default else world_parameters(scene, dt)
        bullet.setPhysicsEngineParameter(physicsClientId=client, **parameters)
        bullet.setGravity(*map(float, scene.acceleration), physicsClientId=client)
        contact = {} if scene.floor is None else contact_properties(scene, default)
        if scene.floor is not None:
            self._add_floor(scene, contact, form)
        self._body, dynamics = self._add_body(scene, contact, form)
        if form.beside == "heavy":
            self._add_body(heavy_neighbour(scene), contact, form)
        self.settings = {
            "version": version("pybullet"),
            "profile": "default" if default else "calibrated",
            "coordinates": "multibody" if form.multibody else "maximal",
            "body": form.body,
            "floor": form.floor,
            "beside": form.beside,
            **parameters,
            **dynamics,
        }

    def _add_body(self, scene: Scenario, contact: dict[str, float], form: Form) -> tuple[int, dict[str, float]]:
        """Add a scene's body, and return its number and its dynamics."""
        bullet, client = self._bullet, self._client
        body = bullet.createMultiBody(
            baseMass=scene.body.mass,
            baseCollisionShapeIndex=-1 if scene.floor is None else self._shape(scene, form),
            basePosition=scene.start.position,
            baseOrientation=scene.start.orientation,
            useMaximalCoordinates=not form.multibody,
            physicsClientId=client,
        )
        dynamics = contact | damping_properties(scene, form.default)
        if not form.default:
            dynamics["activationState"] = bullet.ACTIVATION_STATE_DISABLE_SLEEPING
        if form.unclamped:
            dynamics["maxJointVelocity"] = FASTEST
        bullet.changeDynamics(
            body,
            -1,
            mass=scene.body.mass,
            localInertiaDiagonal=[float(moment) for moment in np.diag(scene.body.inertia_tensor)],
            physicsClientId=client,
            **dynamics,
        )
        bullet.resetBaseVelocity(body, scene.start.velocity, scene.start.angular_velocity, physicsClientId=client)
        return body, dynamics

    def _shape(self, scene: Scenario, form: Form) -> int:
        bullet, client = self._bullet, self._client
        if form.body == "hull":
            corners = scene.body.hull.tolist()
            return int(bullet.createCollisionShape(bullet.GEOM_MESH, vertices=corners, physicsClientId=client))
        if isinstance(scene.body, Vertices):
            # Bullet gives a convex hull one contact point per step: a prism that rolls leaves its course by 0.07 m in 1.7 m, at 1 ms.
            balls = [bullet.GEOM_SPHERE] * len(scene.body.hull)
            radii, places = [BALL * scene.body.size] * len(balls), scene.body.hull.tolist()
            return int(bullet.createCollisionShapeArray(balls, radii=radii, collisionFramePositions=places, physicsClientId=client))
        if isinstance(scene.body, Sphere):
            return int(bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=scene.body.radius, physicsClientId=client))
        assert isinstance(scene.body, Box)
        return int(bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=scene.body.half_extents, physicsClientId=client))

    def _add_floor(self, scene: Scenario, contact: dict[str, float], form: Form) -> None:
        bullet, client, kind = self._bullet, self._client, form.floor_in(scene)
        if kind == "plane":
            shape = bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=[0, 1, 0], physicsClientId=client)
            top = 0.0
        elif kind == "mesh":
            shape = bullet.createCollisionShape(bullet.GEOM_MESH, physicsClientId=client, flags=bullet.GEOM_FORCE_CONCAVE_TRIMESH, **SQUARE)
            top = 0.0
        else:  # on a plane, Bullet gives a box one contact point per step
            shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=[FLOOR_HALF_SIZE] * 3, physicsClientId=client)
            top = FLOOR_HALF_SIZE
        floor = bullet.createMultiBody(
            0, shape, basePosition=[0, -top, 0], useMaximalCoordinates=not form.multibody, physicsClientId=client
        )
        # Bullet multiplies the coefficients of the two bodies; with 1 for the floor, the product is the scene's value.
        bullet.changeDynamics(floor, -1, **contact | {"restitution": 1.0, "lateralFriction": 1.0}, physicsClientId=client)

    def advance(self, steps: int) -> None:
        step, client = self._bullet.stepSimulation, self._client
        for _ in range(steps):
            step(client)

    def state(self) -> Array:
        return self._states_after_each(0, 1)[0].copy()

    def _states_after_each(self, steps: int, count: int) -> Array:
        """The states after each of `count` times `steps` steps, shape (count, 13), without look-ups: reading costs as much as a step."""
        step, pose, rates = self._bullet.stepSimulation, self._bullet.getBasePositionAndOrientation, self._bullet.getBaseVelocity
        body, client, numbers = self._body, self._client, list[float]()
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

    def record(self, steps: int, every: int = 1) -> Array:
        rows = np.empty((1 + steps // every, 13))
        rows[0] = self.state()
        for first in range(1, len(rows), CHUNK):
            rows[first : first + CHUNK] = self._states_after_each(every, min(CHUNK, len(rows) - first))
        self.known_limitations = list(_limitations_met(rows, self._dt, self._fall if self._grips else None)) if every == 1 else []
        if every == 1 and self._turning_slip_of is not None:
            self.known_limitations += _turning_slip(self._turning_slip_of, rows, self._dt)
        return rows

    def as_built(self) -> AsBuilt:
        dynamics = self._bullet.getDynamicsInfo(self._body, -1, physicsClientId=self._client)
        world = self._bullet.getPhysicsEngineParameters(physicsClientId=self._client)
        gravity = np.array([world[f"gravityAcceleration{axis}"] for axis in "XYZ"])
        return AsBuilt(dynamics[0], np.diag(dynamics[2]), gravity)

    def close(self) -> None:
        if self._uses == MOST_USES or not np.isfinite(self.state()).all():
            self._reset()
            return
        for number in reversed(range(self._bullet.getNumBodies(physicsClientId=self._client))):
            body = self._bullet.getBodyUniqueId(number, physicsClientId=self._client)
            self._bullet.removeBody(body, physicsClientId=self._client)
        self._idle.append((self._client, self._uses + 1))

    def _reset(self) -> None:
        self._bullet.resetSimulation(physicsClientId=self._client)
        self._idle.append((self._client, 0))


_idle: dict[bool, list[tuple[int, int]]] = {}
"""Unused connections, by profile (True: default), and how often each was used since it was reset; they give the bits that new ones give."""


def _limitations_met(rows: Array, dt: float, fall: Array | None) -> Iterator[KnownLimitation]:
    """Bullet's known limitations that a motion met.

    Args:
        rows: States at every step, shape (n, 13).
        dt: Time step [s].
        fall: The velocity that gravity adds in a step [m/s], shape (3,), where the floor grips; else None.
    """
    turn = float(np.linalg.norm(rows[:, SPIN], axis=1).max()) * dt
    if turn > LARGEST_TURN:
        yield KnownLimitation(
            f"the body turns by up to {turn:.3g} rad a step; Bullet's rotations are too small beyond π/4", {"orientation_error": np.pi}
        )
    if fall is None:
        return
    pushes = np.diff(rows[:, VELOCITY], axis=0) - fall
    along, up = np.hypot(pushes[:, 0], pushes[:, 2]), pushes[:, 1]
    if bool(np.any((up > NO_PUSH * np.linalg.norm(fall)) & (along > ALMOST * STRONGEST_FRICTION * up))):
        yield KnownLimitation(
            f"a contact needs more than {STRONGEST_FRICTION:g} times its normal force to stick; Bullet clamps friction there, so it slips"
        )


def _turning_slip(scene: Scenario, rows: Array, dt: float) -> Iterator[KnownLimitation]:
    """The limitation of friction in maximal coordinates, for a motion with states at every step, shape (n, 13).

    Bullet limits friction along the first direction of the slip and across it, each by µ times the normal force. Where the slip turns in an
    impact with the normal impulse J, the impulse along the floor is wrong by up to µ J, and the velocity at the floor by a = µ J/M.
    """
    assert scene.floor is not None
    pushes = np.diff(rows[:, VELOCITY], axis=0) - dt * scene.acceleration
    along, up = np.hypot(pushes[:, 0], pushes[:, 2]), pushes[:, 1]
    struck = (up > NO_PUSH * np.abs(up).max()) & (along > (1.0 + NO_PUSH) * scene.floor.coefficient * up)
    if not struck.any():
        return
    ratio = float((along[struck] / up[struck]).max()) / scene.floor.coefficient
    wrong = scene.floor.coefficient * float(up[struck].max())
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
    yield KnownLimitation(
        "in maximal coordinates Bullet limits friction along the initial slip and across it separately: the slip turns, and the impulse "
        f"along the floor is up to {ratio:.3g} µ times the normal one; coordinates=multibody keeps the cone",
        sizes,
    )


@cache
def _import_quietly() -> Any:
    """Import pybullet without the build date that it writes to the standard error of every process."""
    with _no_standard_error():
        return import_module("pybullet")


@contextmanager
def _no_standard_error() -> Iterator[None]:
    sys.stderr.flush()
    kept = os.dup(2)
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
