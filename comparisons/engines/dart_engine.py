"""The engine `dart`: DART's free joint over a half-space. DART solves contacts after gravity has acted, hence v+ = e (u + g dt)."""

from collections.abc import Mapping
from typing import Any, ClassVar

import dartpy as dart
import numpy as np

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.base import AsBuilt, Diverged, Engine, KnownLimitation, Simulation
from dropspin.comparisons.engines.mapping import FLOOR_HALF_SIZE
from dropspin.comparisons.engines.packages import version
from dropspin.scenarios.bodies import Box
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.rotations import cross, rotate
from dropspin.scenarios.state import ORIENTATION, SPIN, Array
from dropspin.scenarios.surfaces import Floor

REASONS = {
    "deactivation": "never falls asleep; else a block that tips over more slowly than 0.05 rad/s stops halfway",
    "collision_detector": "finds all corners on the half-space; the default, FCL, finds one, and an edge rebounds with 0.217, not 0.5",
    "split_impulse": "corrects depth without changing velocities; else a ball of restitution 0 rebounds at 1 mm/s, at any step",
    "lcp_solver": "Coulomb's cone, to 1e-8 m/s, for a coefficient; with the default pyramid a turning box loses or gains 0.23 of its spin",
    "restitution": "e + (1 + e) 1e-5: DART's contacts are compliant by 1e-5, which Python cannot set; uncorrected, 0.5 becomes 0.499985",
    "friction": "the scene's coefficient; 1e6 where the floor grips (1e2 to 1e9 give the same)",
}
"""Effects were measured on balls dropped from 1 m and boxes on an edge, tipping and turning flat, without the one setting."""


class Dart(Engine):
    """DART's rigid body over a plane or box, or its defaults."""

    name, order, reasons = "dart", 1.0, REASONS
    shapes: ClassVar = ("sphere", "box")
    choices: ClassVar = {"profile": mapping.PROFILES, "floor": ("plane", "box"), "beside": mapping.BESIDE}
    representations: ClassVar = ("floor", "beside")

    def discretisation(self, scene: Scenario) -> str | None:
        """Free flight agrees with MuJoCo's Euler to 1e-13 (to 1e-7 below 1e-3 rad a step, where DART truncates a series)."""
        flight = mapping.EXPLICIT_GYROSCOPIC if mapping.may_tumble(scene) else mapping.SEMI_IMPLICIT_EULER
        return flight if scene.floor is None and scene.damping is None else None

    def declines(self, scene: Scenario) -> str | None:
        unfit = mapping.refusal_of_unequal_damping(scene) or mapping.refusal_of_floor(scene, self.option("floor"))
        if unfit is None and scene.floor is not None and not hasattr(dart.constraint, "NsgsFrictionSolver"):
            return f"dartpy {version('dartpy')} is installed, without the settings of exact contacts; update it to 6.20 or later"
        return unfit or mapping.refusal_of_rest_speed(scene, "DART", "it sets rebounds below 0.1 m/s to 0")

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return DartSimulation(scene, dt, {name: self.option(name) for name in self.choices})


class DartSimulation(Simulation):
    """A DART world with the body's skeleton and, if the scene has a floor, the floor's."""

    def __init__(self, scene: Scenario, dt: float, form: Mapping[str, str]) -> None:
        self.velocity_lag = 0.5 * dt
        self._scene, self._world = scene, dart.simulation.World()
        self._world.setTimeStep(dt)
        self._world.setGravity(scene.acceleration)
        self.settings = {"version": version("dartpy"), **form}
        if scene.floor is not None:
            self.settings |= self._add_floor(scene.floor, form["floor"], is_calibrated=form["profile"] == "calibrated")
        self._body, *_ = [self._add_body(one) for one in mapping.bodies_in(scene, form["beside"])]

    def _add_body(self, scene: Scenario) -> Any:
        skeleton, mounting = dart.dynamics.Skeleton(f"body {self._world.getNumSkeletons()}"), dart.math.Isometry3()
        joint, body = skeleton.createFreeJointAndBodyNodePair()
        body.setInertia(dart.dynamics.Inertia(scene.body.mass, np.zeros(3), scene.body.inertia_tensor))
        if scene.floor is not None:
            size = 2.0 * scene.body.vertices.max(axis=0)
            shape = dart.dynamics.BoxShape(size) if isinstance(scene.body, Box) else dart.dynamics.SphereShape(scene.body.size)
            _add_shape(body, shape, self.settings["restitution"], self.settings["friction"])
        if scene.damping is not None:
            rates = scene.damping.angular * scene.body.inertia_tensor[0, 0], scene.damping.linear * scene.body.mass
            for axis, rate in enumerate(np.repeat(rates, 3)):
                joint.setDampingCoefficient(axis, rate)
        mounting.set_quaternion(dart.math.Quaternion(*np.array(scene.start.orientation)[[3, 0, 1, 2]] * [1.0, -1.0, -1.0, -1.0]))
        joint.setTransformFromChildBodyNode(mounting)  # as a coordinate, a rotation below 1e-3 rad would be wrong by up to 1e-10
        joint.setPositions([0.0, 0.0, 0.0, *scene.start.position])
        joint.setAngularVelocity(scene.start.angular_velocity)
        joint.setLinearVelocity(scene.start.velocity)
        self._world.addSkeleton(skeleton)
        return body

    def _add_floor(self, floor: Floor, kind: str, *, is_calibrated: bool) -> dict[str, Any]:
        solver, sleep = self._world.getConstraintSolver(), dart.simulation.DeactivationOptions()
        friction, restitution = mapping.friction_of(floor, gripping=1e6), floor.restitution
        if is_calibrated:
            sleep.mEnabled = False
            self._world.setDeactivationOptions(sleep)
            self._world.setCollisionDetector(dart.collision.OdeCollisionDetector())
            solver.setSplitImpulseEnabled(True)
            restitution = min(1.0, restitution + (1.0 + restitution) * 1e-5)
            if not isinstance(floor.friction, str):
                options = dart.constraint.NsgsFrictionSolver.Options()
                options.tolerance = 1e-8
                solver.setBoxedLcpSolver(dart.constraint.NsgsFrictionSolver(options))
        ground, half = dart.dynamics.Skeleton("floor"), np.full(3, FLOOR_HALF_SIZE)
        shape = dart.dynamics.BoxShape(2.0 * half) if kind == "box" else dart.dynamics.PlaneShape([0.0, 1.0, 0.0], 0.0)
        # DART multiplies the two restitutions and uses the smaller friction.
        part = _add_shape(ground.createWeldJointAndBodyNodePair()[1], shape, 1.0, friction)
        if kind == "box":
            part.setRelativeTranslation([0.0, -FLOOR_HALF_SIZE, 0.0])
        self._world.addSkeleton(ground)
        detector, lcp = self._world.getCollisionDetector().getType(), solver.getBoxedLcpSolver().getType()
        solved = {"collision_detector": detector, "lcp_solver": lcp, "split_impulse": solver.isSplitImpulseEnabled()}
        return solved | {"deactivation": self._world.getDeactivationOptions().mEnabled, "restitution": restitution, "friction": friction}

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self._world.step()
        if not np.abs(self._body.getAngularVelocity()).max() < 1e10:  # DART resets a state that is not finite, and goes on
            raise Diverged("the body turns faster than 1e10 rad/s")

    def state(self) -> Array:
        transform, body = self._body.getWorldTransform(), self._body  # the transform must outlive its translation, a view
        pose = transform.translation(), transform.quaternion().wxyz()[[1, 2, 3, 0]]
        return np.concatenate([*pose, body.getCOMLinearVelocity(), body.getAngularVelocity()])

    def record(self, steps: int, every: int = 1) -> Array:
        rows, floor, body, dt = super().record(steps, every), self._scene.floor, self._scene.body, self._world.getTimeStep()
        if floor is not None and every == 1:
            before, fall = rows[:-1, None], dt * self._world.getGravity()[1]
            arms = rotate(before[..., ORIENTATION], body.vertices)
            approach = -(before[..., 8] + cross(before[..., SPIN], arms)[..., 1] + fall)
            rebounds = floor.restitution * approach[(before[..., 1] + arms[..., 1] < body.semi_axes[0]) & (approach > 0.0)]
            lost = {"restitution_error": 1.0, "bounce_height_error": 1.0, "position_error": 0.1**2 / 2.0 * dt / abs(fall) if fall else 0.0}
            if not np.all((rebounds == 0.0) | (rebounds >= 0.1) & (rebounds <= 100.0)):
                self.known_limitations = [KnownLimitation("DART sets rebounds below 0.1 m/s to 0 and clamps those above 100 m/s", lost)]
        return rows

    def as_built(self) -> AsBuilt:
        return AsBuilt(self._body.getMass(), self._body.getInertia().getMoment(), self._world.getGravity())


def _add_shape(node: Any, shape: Any, restitution: float, friction: float) -> Any:
    part = node.createShapeNode(shape)
    part.createCollisionAspect()
    part.createDynamicsAspect().setRestitutionCoeff(restitution)
    part.getDynamicsAspect().setFrictionCoeff(friction)
    return part
