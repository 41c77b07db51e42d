"""The engine `dart`: DART's free joint over a half-space. Contacts are solved after gravity has acted, hence v+ = e (u + g dt)."""

import dartpy as dart
import numpy as np

from comparisons.engines.base import (
    EXPLICIT_GYROSCOPIC,
    SEMI_IMPLICIT_EULER,
    AsBuilt,
    Diverged,
    Engine,
    KnownLimitation,
    Simulation,
    may_tumble,
    version,
)
from scenarios.body import Array, Body, Box, Sphere
from scenarios.model import Floor, Scenario
from scenarios.rotations import cross, rotate
from scenarios.state import ORIENTATION, SPIN

REASONS = {
    "deactivation": "never falls asleep; else a block that tips over slower than 0.05 rad/s stops halfway",
    "collision_detector": "finds all corners on the half-space; the default, FCL, finds one, and an edge rebounds with 0.217 for 0.5",
    "split_impulse": "pushes depth out apart from the velocities; else a ball of restitution 0 rebounds at 1 mm/s, at any step",
    "lcp_solver": "Coulomb's cone, to 1e-8 m/s, for a coefficient; the default's pyramid leaves a turning box 0.23 of its spin off",
    "restitution": "e + (1 + e) 1e-5: DART's contacts give way by 1e-5, which Python cannot set; as it is, 0.5 becomes 0.499985",
    "friction": "the scene's; 1e6 where the floor grips (1e2 to 1e9 do the same)",
}
"""Effects were measured on balls dropped from 1 m and boxes on an edge, tipping and turning flat, with the one setting left out."""


class Dart(Engine):
    """DART's rigid body over a plane."""

    name, order, reasons = "dart", 1.0, REASONS

    def discretisation(self, scene: Scenario) -> str | None:
        """MuJoCo's Euler to 1e-13 (to 1e-7 below 1e-3 rad a step, where DART cuts a series off); contacts are like nobody else's."""
        flight = EXPLICIT_GYROSCOPIC if may_tumble(scene) else SEMI_IMPLICIT_EULER
        return flight if scene.floor is None and scene.damping is None else None

    def declines(self, scene: Scenario) -> str | None:
        moments, floor = np.linalg.eigvalsh(scene.body.inertia_tensor), scene.floor
        if scene.damping is not None and scene.damping.angular > 0.0 and np.ptp(moments) > 1e-12 * moments[-1]:
            return "DART damps a free joint about the world's axes; angular damping needs a body of equal moments"
        if floor is not None and not isinstance(scene.body, (Sphere, Box)):
            return "only spheres and boxes are mapped onto a floor"
        if floor is not None and floor.rest_speed > 0.0:
            return "DART's own speed below which restitution is 0, a rebound of 0.1 m/s, cannot be set (floor.rest_speed)"
        return None

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return DartSimulation(scene, dt)


class DartSimulation(Simulation):
    """A world of the body's skeleton, and the floor's where there is one."""

    staggered = True

    def __init__(self, scene: Scenario, dt: float) -> None:
        self._scene, self._world, skeleton, mounting = scene, dart.simulation.World(), dart.dynamics.Skeleton("body"), dart.math.Isometry3()
        self._world.setTimeStep(dt)
        self._world.setGravity(scene.acceleration)
        joint, self._body = skeleton.createFreeJointAndBodyNodePair()
        self._body.setInertia(dart.dynamics.Inertia(scene.body.mass, np.zeros(3), scene.body.inertia_tensor))
        self.settings = {"version": version("dartpy")} | ({} if scene.floor is None else self._add_floor(scene.floor, scene.body))
        if scene.damping is not None:
            rates = scene.damping.angular * scene.body.inertia_tensor[0, 0], scene.damping.linear * scene.body.mass
            for axis, rate in enumerate(np.repeat(rates, 3)):
                joint.setDampingCoefficient(axis, rate)
        mounting.set_quaternion(dart.math.Quaternion(*np.array(scene.start.orientation)[[3, 0, 1, 2]] * [1.0, -1.0, -1.0, -1.0]))
        joint.setTransformFromChildBodyNode(mounting)  # as a coordinate, a turn below 1e-3 rad would be up to 1e-10 off
        joint.setPositions([0.0, 0.0, 0.0, *scene.start.position])
        joint.setAngularVelocity(scene.start.angular_velocity)
        joint.setLinearVelocity(scene.start.velocity)
        self._world.addSkeleton(skeleton)

    def _add_floor(self, floor: Floor, body: Body) -> dict[str, str | float]:
        solver, sleep = self._world.getConstraintSolver(), dart.simulation.DeactivationOptions()
        sleep.mEnabled = False
        self._world.setDeactivationOptions(sleep)
        self._world.setCollisionDetector(dart.collision.OdeCollisionDetector())
        solver.setSplitImpulseEnabled(True)
        if not isinstance(floor.friction, str):
            options = dart.constraint.NsgsFrictionSolver.Options()
            options.tolerance = 1e-8
            solver.setBoxedLcpSolver(dart.constraint.NsgsFrictionSolver(options))
        friction = {"none": 0.0, "infinite": 1e6}[floor.friction] if isinstance(floor.friction, str) else floor.friction
        restitution = min(1.0, floor.restitution + (1.0 + floor.restitution) * 1e-5)
        shape = dart.dynamics.BoxShape(2.0 * np.array(body.half_extents)) if isinstance(body, Box) else dart.dynamics.SphereShape(body.size)
        ground, plane = dart.dynamics.Skeleton("floor"), dart.dynamics.PlaneShape([0.0, 1.0, 0.0], 0.0)
        # DART multiplies the two restitutions, and takes the lesser friction.
        for node, form, share in ((self._body, shape, restitution), (ground.createWeldJointAndBodyNodePair()[1], plane, 1.0)):
            part = node.createShapeNode(form)
            part.createCollisionAspect()
            part.createDynamicsAspect().setRestitutionCoeff(share)
            part.getDynamicsAspect().setFrictionCoeff(friction)
        self._world.addSkeleton(ground)
        solved = {"collision_detector": "ode", "lcp_solver": solver.getBoxedLcpSolver().getType(), "split_impulse": True}
        return solved | {"deactivation": False, "restitution": restitution, "friction": friction}

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self._world.step()
        if not np.abs(self._body.getAngularVelocity()).max() < 1e10:  # DART resets what is not finite, and goes on
            raise Diverged("the body turns faster than 1e10 rad/s")

    def state(self) -> Array:
        place, body = self._body.getWorldTransform(), self._body  # the first has to outlive its translation, a view
        pose = place.translation(), place.quaternion().wxyz()[[1, 2, 3, 0]]
        return np.concatenate([*pose, body.getCOMLinearVelocity(), body.getAngularVelocity()])

    def record(self, steps: int, every: int = 1) -> Array:
        rows, floor, body, dt = super().record(steps, every), self._scene.floor, self._scene.body, self._world.getTimeStep()
        if floor is not None and every == 1:
            before, fall = rows[:-1, None], dt * self._world.getGravity()[1]
            arms = rotate(before[..., ORIENTATION], body.vertices)
            approach = -(before[..., 8] + cross(before[..., SPIN], arms)[..., 1] + fall)
            rebounds = floor.restitution * approach[(before[..., 1] + arms[..., 1] < body.rounding) & (approach > 0.0)]
            height = 0.1**2 / 2.0 * dt / abs(fall) if fall else 0.0
            lost = {"restitution_error": 1.0, "bounce_height_error": 1.0, "position_error": height}
            if not np.all((rebounds == 0.0) | (rebounds >= 0.1) & (rebounds <= 100.0)):
                self.known_limitations = [
                    KnownLimitation("DART's rebounds below 0.1 m/s are none, and those above 100 m/s are 100 m/s", lost)
                ]
        return rows

    def as_built(self) -> AsBuilt:
        return AsBuilt(self._body.getMass(), self._body.getInertia().getMoment(), self._world.getGravity())
