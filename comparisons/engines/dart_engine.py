"""The engine `dart`: DART's free joint over a half-space. DART solves contacts after gravity has acted, hence v+ = e (u + g dt)."""

from typing import Any, ClassVar

import dartpy as dart
import numpy as np

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.base import AsBuilt, Diverged, Engine, KnownLimitation, Simulation
from dropspin.comparisons.engines.mapping import FLOOR_HALF_SIZE
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.engines.settings import calibrated_values, settings_beside
from dropspin.scenarios.bodies import Box
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.rotations import cross, rotate
from dropspin.scenarios.state import ORIENTATION, SPIN, Array
from dropspin.scenarios.surfaces import Floor

WORLD, SURFACE = settings_beside(__file__).values()
DETECTORS = {"dart": "DARTCollisionDetector", "bullet": "BulletCollisionDetector", "ode": "OdeCollisionDetector"}


class Dart(Engine):
    """DART's rigid body over a plane or box, or its defaults."""

    name, order = "dart", 1.0
    shapes: ClassVar = ("sphere", "box")
    choices: ClassVar = {"profile": mapping.PROFILES, "floor": ("plane", "box"), "beside": mapping.BESIDE}
    representations: ClassVar = ("floor", "beside")
    settings: ClassVar = WORLD | SURFACE

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
        return DartSimulation(scene, dt, self)

    def chosen(self, floor: Floor) -> dict[str, Any]:
        """The settings for a floor."""
        restitution, friction = floor.restitution, mapping.friction_of(floor, gripping=1e6)
        world: dict[str, Any] = {name: setting.default for name, setting in WORLD.items()}
        if not self.is_default:
            restitution = min(1.0, restitution + (1.0 + restitution) * 1e-5)
            world |= calibrated_values(WORLD)
            world["lcp_solver"] = "dantzig" if isinstance(floor.friction, str) else "nsgs"
        surfaces = {"restitution": restitution, "friction": friction, "floor_restitution": 1.0, "floor_friction": friction}
        return world | surfaces | self.given


class DartSimulation(Simulation):
    """A DART world with the body's skeleton and, if the scene has a floor, the floor's."""

    def __init__(self, scene: Scenario, dt: float, engine: Dart) -> None:
        self.velocity_lag = 0.5 * dt
        self._scene, self._world = scene, dart.simulation.World()
        self._world.setTimeStep(dt)
        self._world.setGravity(scene.acceleration)
        self.settings = {"version": version("dartpy"), **engine.options_in_force}
        if scene.floor is not None:
            self.settings |= self._add_floor(engine.option("floor"), engine.chosen(scene.floor))
        self._body, *_ = [self._add_body(one) for one in mapping.bodies_in(scene, engine.option("beside"))]

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

    def _add_floor(self, kind: str, chosen: dict[str, Any]) -> dict[str, Any]:
        """Set the world's settings and add the floor; the settings, those of the world read back."""
        solver, sleep = self._world.getConstraintSolver(), dart.simulation.DeactivationOptions()
        sleep.mEnabled = chosen["deactivation"]
        self._world.setDeactivationOptions(sleep)
        if chosen["collision_detector"] in DETECTORS:
            self._world.setCollisionDetector(getattr(dart.collision, DETECTORS[chosen["collision_detector"]])())
        solver.setSplitImpulseEnabled(chosen["split_impulse"])
        if chosen["lcp_solver"] == "nsgs":
            options = dart.constraint.NsgsFrictionSolver.Options()
            options.tolerance = 1e-8
            solver.setBoxedLcpSolver(dart.constraint.NsgsFrictionSolver(options))
        elif chosen["lcp_solver"] == "pgs":
            solver.setBoxedLcpSolver(dart.constraint.PgsBoxedLcpSolver())
        ground, half = dart.dynamics.Skeleton("floor"), np.full(3, FLOOR_HALF_SIZE)
        shape = dart.dynamics.BoxShape(2.0 * half) if kind == "box" else dart.dynamics.PlaneShape([0.0, 1.0, 0.0], 0.0)
        surface = chosen["floor_restitution"], chosen["floor_friction"]
        part = _add_shape(ground.createWeldJointAndBodyNodePair()[1], shape, *surface)
        if kind == "box":
            part.setRelativeTranslation([0.0, -FLOOR_HALF_SIZE, 0.0])
        self._world.addSkeleton(ground)
        lcp = solver.getBoxedLcpSolver().getType().removesuffix("BoxedLcpSolver").removesuffix("FrictionSolver").lower()
        switches = solver.isSplitImpulseEnabled(), self._world.getDeactivationOptions().mEnabled
        found = {"collision_detector": self._world.getCollisionDetector().getType(), "lcp_solver": lcp}
        return chosen | found | dict(zip(("split_impulse", "deactivation"), switches, strict=True))

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
