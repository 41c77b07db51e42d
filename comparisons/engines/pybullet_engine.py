"""The engine `pybullet`: calibrated, the scene as meant, by settings Bullet has but does not default to; or with its defaults.

Maximal coordinates (btRigidBody) give v+ = -e v exactly, once the contact thresholds that start a collision early, the error
reduction that adds penetration to the rebound, and the speed below which restitution is dropped are all set to 0.
"""

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import Any, ClassVar

import numpy as np

from comparisons.engines.base import (
    EXPLICIT_GYROSCOPIC,
    IMPLICIT_GYROSCOPIC,
    LATE_IMPACTS,
    PROFILES,
    SEMI_IMPLICIT_EULER,
    Array,
    AsBuilt,
    Engine,
    KnownLimitation,
    Simulation,
    may_tumble,
    version,
)
from comparisons.engines.programs import can_be_pasted, rendered
from comparisons.measuring.predictions import bounce_error, flight_error
from scenarios import DropspinError, Scenario, Truth
from scenarios.body import Box, Sphere
from scenarios.mechanics import is_diagonal
from scenarios.state import SPIN, VELOCITY

STRONGEST_FRICTION = 10.0  # Bullet clamps the coefficient of a contact there
ALMOST = 0.999
NO_PUSH = 1e-6  # of a step's gravity
FASTEST = 1e12  # m/s and rad/s; Bullet clamps the speeds of a multibody to 100 by default
LARGEST_TURN = np.pi / 4  # rad a step; Bullet turns by less than it should beyond
SMALLEST_INERTIA = 2.3e-16  # (kg m²)³; Bullet's own solver of three equations takes a smaller determinant for 0
FASTEST_DECAY = 30.0  # 1/s; 1 - exp(-rate) is 1 from 37 on, and the body stops
FLOOR_HALF_SIZE = 1e3  # m; thick enough that nothing tunnels, and Bullet loses no digits to it


REASONS = {
    "coordinates": "maximal: a rebound of e times the approach; a multibody's is e (u + g dt), and its speeds are clamped at 100",
    "fixedTimeStep": "the step asked for; Bullet's own is 1/240 s",
    "numSubSteps": "no steps within a step, of which nobody would see the states",
    "deterministicOverlappingPairs": "contacts in the same order in every run",
    "restitution": "as asked; Bullet multiplies those of two bodies, and the floor's is 1",
    "solverResidualThreshold": "solves contacts to the end; left at 1e-7 a resting box trembles at 5 mm/s and a corner rebounds 5e-6 off",
    "contactERP": "pushes no depth out; left at 0.08 a resting box trembles at 3 mm/s, and rebounds are faster by the depth over a step",
    "erp": "as contactERP, for joints",
    "frictionERP": "as contactERP, for friction",
    "contactSlop": "lets no depth stand",
    "restitutionVelocityThreshold": "as asked, 0 if nothing is; Bullet drops restitution below 0.2 m/s",
    "useSplitImpulse": "keeps what is pushed out of a depth out of the velocities",
    "splitImpulsePenetrationThreshold": "at any depth",
    "enableConeFriction": "the same friction in every direction; a pyramid's is up to 1.41 times larger",
    "lateralFriction": f"as asked; {STRONGEST_FRICTION:g} where the floor grips, which is as much as Bullet takes",
    "contactProcessingThreshold": "bounces where bodies touch, not before; left as it is 0.5 becomes 0.248 at 1 ms and 0.024 at 0.25 ms",
    "linearDamping": "1 - exp(-rate), 0 for none; a multibody's default is 0.04",
    "angularDamping": "as linearDamping",
    "activationState": "never falls asleep",
    "maxJointVelocity": "no clamp of a multibody's speeds, at 100 m/s and 100 rad/s by default (velocity_clamp=kept leaves it)",
}
"""Effects were measured on a ball dropped from 1 m and a box at rest, restitution 0.5, with the one setting left out."""


class PyBullet(Engine):
    """Bullet's rigid body on a plane (ball) or a large box (anything with corners); or as it comes (profile=default)."""

    name = "pybullet"
    order = 1.0
    reasons = REASONS
    choices: ClassVar = {"coordinates": ("maximal", "multibody"), "profile": PROFILES, "velocity_clamp": ("lifted", "kept")}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.is_default and {"coordinates", "velocity_clamp"} & self.options.keys():
            raise DropspinError(f"engine {self.label!r}: profile=default is a multibody that clamps its speeds; leave the rest out.")
        if self.option("velocity_clamp") == "kept" and not self.is_multibody:
            raise DropspinError(f"engine {self.label!r}: only multibodies clamp speeds; add coordinates=multibody.")

    @property
    def is_default(self) -> bool:
        """Whether only the obvious is set."""
        return self.option("profile") == "default"

    @property
    def is_multibody(self) -> bool:
        """Whether the body is Bullet's btMultiBody, its default, rather than a btRigidBody."""
        return self.is_default or self.option("coordinates") == "multibody"

    @property
    def is_unclamped(self) -> bool:
        """Whether the clamp of a multibody's speeds is to be lifted."""
        return self.is_multibody and not self.is_default and self.option("velocity_clamp") == "lifted"

    def discretisation(self, scene: Scenario) -> str | None:
        """Maximal coordinates solve the gyroscopic term implicitly, by one Newton step; multibodies do not, nor share contacts."""
        gyroscopic = EXPLICIT_GYROSCOPIC if self.is_multibody else IMPLICIT_GYROSCOPIC
        flight = gyroscopic if may_tumble(scene) else SEMI_IMPLICIT_EULER
        if scene.floor is None:
            return flight
        return None if self.is_multibody else f"{flight}, {LATE_IMPACTS}"

    def predicted_error(self, scene: Scenario, truth: Truth | None, metric: str, dt: float) -> float | None:
        """Semi-implicit Euler about a fixed axis; a flat bounce, noticed late in maximal coordinates, after gravity in a multibody."""
        if self.is_default or np.linalg.norm(scene.start.angular_velocity) * dt > LARGEST_TURN:
            return None
        flight = flight_error(scene, truth, metric, dt, exact_rotation=True)
        return bounce_error(scene, truth, metric, dt, gravity_first=self.is_multibody) if flight is None else flight

    def declines(self, scene: Scenario) -> str | None:
        """What calibration cannot map."""
        inertia = scene.body.inertia_tensor
        if not is_diagonal(inertia):
            return "PyBullet takes inertia along the body's own axes only; these are not principal axes"
        floor = scene.floor
        if not self.is_multibody and may_tumble(scene) and np.prod(np.diag(inertia)) < SMALLEST_INERTIA:
            return f"Bullet leaves the gyroscopic term out where the product of the moments is below {SMALLEST_INERTIA:g}; scale the units"
        if scene.damping is not None and not self.is_default and max(scene.damping.linear, scene.damping.angular) > FASTEST_DECAY:
            return f"Bullet's damping takes no decay faster than {FASTEST_DECAY:g} per second"
        if scene.damping is not None and self.is_multibody and not self.is_default:
            return "Bullet's multibodies damp by a law of their own, k v (1 + |v|)"
        if floor is None:
            return None
        travel = np.linalg.norm(scene.start.position) + np.linalg.norm(scene.start.velocity) * scene.duration
        if isinstance(scene.body, Box) and travel + scene.body.size > FLOOR_HALF_SIZE:
            return f"the floor is a box of {2 * FLOOR_HALF_SIZE:g} m, and the body may leave it"
        if not isinstance(scene.body, (Sphere, Box)):
            return "only spheres and boxes are mapped onto a floor"
        if not isinstance(floor.friction, str) and floor.friction > STRONGEST_FRICTION:
            return f"Bullet caps friction at {STRONGEST_FRICTION:g}, got {floor.friction:g}"
        return None

    def programs(self, scene: Scenario, dt: float) -> Mapping[str, str]:
        """As Python and as URDF, which has the body's part of it."""
        if self.is_default or not can_be_pasted(scene):
            return {}
        moments = np.diag(scene.body.inertia_tensor)[[2, 0, 1]].tolist()
        sizes = [2.0 * scene.body.half_extents[axis] for axis in (2, 0, 1)] if isinstance(scene.body, Box) else []
        surface = {**_contact_properties(scene, default=False), **_damping(scene, default=False)}
        surface |= {"maxJointVelocity": FASTEST} if self.is_unclamped else {}
        parameters = {name: value for name, value in _parameters(scene, dt).items() if name != "fixedTimeStep"}
        values = {"engine": "PyBullet", "dt": dt, "maximal": not self.is_multibody, "surface": surface}
        return {
            "python": rendered("pybullet.py.jinja", scene, why=REASONS, parameters=parameters, floor_half_size=FLOOR_HALF_SIZE, **values),
            "urdf": rendered("pybullet.urdf.jinja", scene, moments=moments, sizes=sizes, **values),
        }

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return PyBulletSimulation(scene, dt, default=self.is_default, multibody=self.is_multibody, unclamped=self.is_unclamped)


class PyBulletSimulation(Simulation):
    """A connection to the physics server in this process, for as long as it lasts its own."""

    staggered = True

    def __init__(self, scene: Scenario, dt: float, *, default: bool, multibody: bool, unclamped: bool) -> None:
        self._bullet = _import_quietly()
        self._dt, self._fall = dt, dt * scene.acceleration
        self._grips = scene.floor is not None and scene.floor.friction == "infinite"
        self._idle = _idle.setdefault(default, [])
        self._client = self._idle.pop() if self._idle else self._bullet.connect(self._bullet.DIRECT)
        if self._client < 0:
            raise RuntimeError("PyBullet gave no connection")
        try:
            self._build(scene, dt, default, multibody, unclamped)
        except BaseException:
            self.close()
            raise

    def _build(self, scene: Scenario, dt: float, default: bool, multibody: bool, unclamped: bool) -> None:
        bullet, client = self._bullet, self._client
        parameters = {"fixedTimeStep": dt} if default else _parameters(scene, dt)
        bullet.setPhysicsEngineParameter(physicsClientId=client, **parameters)
        bullet.setGravity(*map(float, scene.acceleration), physicsClientId=client)
        contact = {} if scene.floor is None else _contact_properties(scene, default)
        if scene.floor is not None:
            self._add_floor(scene, contact, default, multibody)
        self._body = bullet.createMultiBody(
            baseMass=scene.body.mass,
            baseCollisionShapeIndex=-1 if scene.floor is None else self._shape(scene),
            basePosition=scene.start.position,
            baseOrientation=scene.start.orientation,
            useMaximalCoordinates=not multibody,
            physicsClientId=client,
        )
        dynamics = contact | _damping(scene, default)
        if not default:
            dynamics["activationState"] = bullet.ACTIVATION_STATE_DISABLE_SLEEPING
        if unclamped:
            dynamics["maxJointVelocity"] = FASTEST
        bullet.changeDynamics(
            self._body,
            -1,
            mass=scene.body.mass,
            localInertiaDiagonal=[float(moment) for moment in np.diag(scene.body.inertia_tensor)],
            physicsClientId=client,
            **dynamics,
        )
        bullet.resetBaseVelocity(self._body, scene.start.velocity, scene.start.angular_velocity, physicsClientId=client)
        self.settings = {
            "version": version("pybullet"),
            "profile": "default" if default else "calibrated",
            "coordinates": "multibody" if multibody else "maximal",
            **parameters,
            **dynamics,
        }

    def _shape(self, scene: Scenario) -> int:
        bullet, client = self._bullet, self._client
        if isinstance(scene.body, Sphere):
            return int(bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=scene.body.radius, physicsClientId=client))
        assert isinstance(scene.body, Box)
        return int(bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=scene.body.half_extents, physicsClientId=client))

    def _add_floor(self, scene: Scenario, contact: dict[str, float], default: bool, multibody: bool) -> None:
        bullet, client = self._bullet, self._client
        if default or isinstance(scene.body, Sphere):
            shape = bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=[0, 1, 0], physicsClientId=client)
            top = 0.0
        else:  # on a plane, a box gets one contact point a step
            shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=[FLOOR_HALF_SIZE] * 3, physicsClientId=client)
            top = FLOOR_HALF_SIZE
        floor = bullet.createMultiBody(0, shape, basePosition=[0, -top, 0], useMaximalCoordinates=not multibody, physicsClientId=client)
        # Bullet multiplies the two bodies' coefficients; the floor's are 1, so the body's are the scene's.
        bullet.changeDynamics(floor, -1, **contact | {"restitution": 1.0, "lateralFriction": 1.0}, physicsClientId=client)

    def advance(self, steps: int) -> None:
        step, client = self._bullet.stepSimulation, self._client
        for _ in range(steps):
            step(client)

    def state(self) -> Array:
        position, orientation = self._bullet.getBasePositionAndOrientation(self._body, self._client)
        velocity, angular_velocity = self._bullet.getBaseVelocity(self._body, self._client)
        return np.array(position + orientation + velocity + angular_velocity)

    def record(self, steps: int, every: int = 1) -> Array:
        rows = super().record(steps, every)
        self.known_limitations = list(_limitations_met(rows, self._dt, self._fall if self._grips else None)) if every == 1 else []
        return rows

    def as_built(self) -> AsBuilt:
        dynamics = self._bullet.getDynamicsInfo(self._body, -1, physicsClientId=self._client)
        world = self._bullet.getPhysicsEngineParameters(physicsClientId=self._client)
        gravity = np.array([world[f"gravityAcceleration{axis}"] for axis in "XYZ"])
        return AsBuilt(dynamics[0], np.diag(dynamics[2]), gravity)

    def close(self) -> None:
        self._bullet.resetSimulation(physicsClientId=self._client)
        self._idle.append(self._client)


_idle: dict[bool, list[int]] = {}
"""Connections at rest, by whether they are for defaults: to empty one takes a fifth of a new one's time, and gives the same bits."""


def _limitations_met(rows: Array, dt: float, fall: Array | None) -> Iterator[KnownLimitation]:
    """Bullet's own limits that a motion has reached, from its states at every step.

    `fall` is what gravity adds to the velocity in a step [m/s], where a floor is to grip.
    """
    turn = float(np.linalg.norm(rows[:, SPIN], axis=1).max()) * dt
    if turn > LARGEST_TURN:
        yield KnownLimitation(
            f"the body turns by up to {turn:.3g} rad a step; beyond π/4 Bullet's rotations fall short", {"orientation_error": np.pi}
        )
    if fall is None:
        return
    pushes = np.diff(rows[:, VELOCITY], axis=0) - fall
    along, up = np.hypot(pushes[:, 0], pushes[:, 2]), pushes[:, 1]
    if bool(np.any((up > NO_PUSH * np.linalg.norm(fall)) & (along > ALMOST * STRONGEST_FRICTION * up))):
        yield KnownLimitation(
            f"a contact needs more than {STRONGEST_FRICTION:g} times its normal push to stick; Bullet's friction ends there, and it slips"
        )


def _parameters(scene: Scenario, dt: float) -> dict[str, float]:
    """What calibration sets of the world."""
    return {
        "fixedTimeStep": dt,
        "numSubSteps": 0,
        "solverResidualThreshold": 1e-14,
        "erp": 0.0,
        "contactERP": 0.0,
        "frictionERP": 0.0,
        "contactSlop": 0.0,
        "restitutionVelocityThreshold": 0.0 if scene.floor is None else scene.floor.rest_speed,
        "useSplitImpulse": 1,
        "splitImpulsePenetrationThreshold": 0.0,
        "enableConeFriction": 1,
        "deterministicOverlappingPairs": 1,
    }


def _damping(scene: Scenario, default: bool) -> dict[str, float]:
    """Maximal coordinates damp as v (1 - k)^t: 1 - exp(-rate) is the scene's decay. Who leaves the defaults, leaves Bullet's own 0.04."""
    if scene.damping is None:
        return {} if default else {"linearDamping": 0.0, "angularDamping": 0.0}
    linear, angular = scene.damping.linear, scene.damping.angular
    if default:
        return {"linearDamping": linear, "angularDamping": angular}
    return {"linearDamping": float(-np.expm1(-linear)), "angularDamping": float(-np.expm1(-angular))}


def _contact_properties(scene: Scenario, default: bool) -> dict[str, float]:
    assert scene.floor is not None
    friction = {"none": 0.0, "infinite": STRONGEST_FRICTION}.get(str(scene.floor.friction))
    surface = {"restitution": scene.floor.restitution, "lateralFriction": float(scene.floor.friction) if friction is None else friction}
    return surface if default else surface | {"contactProcessingThreshold": 0.0}


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
