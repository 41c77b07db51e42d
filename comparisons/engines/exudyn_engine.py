"""The engine `exudyn`: Exudyn's rigid body in free flight, on a rotation vector that each step starts anew (a Lie-group integrator)."""

from collections.abc import Sequence
from typing import ClassVar

import exudyn as exu
import numpy as np
from exudyn import utilities as items
from scipy.spatial.transform import Rotation

from dropspin.comparisons.engines.base import AsBuilt, Diverged, Engine, Simulation
from dropspin.comparisons.engines.mapping import PROFILES
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.engines.settings import calibrated_values, settings_beside
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.state import Array

INTEGRATORS = {
    "generalized-alpha": ("GeneralizedAlpha", 2.0),
    "trapezoidal": ("TrapezoidalIndex2", 2.0),
    "midpoint": ("ExplicitMidpoint", 2.0),
    "rk44": ("RK44", 4.0),
    "rk67": ("RK67", 6.0),
}
"""The name of Exudyn's solver, and its order, by the option `integrator`."""
OUTPUTS = [getattr(exu.OutputVariableType, name) for name in ("Position", "RotationMatrix", "Velocity", "AngularVelocity")]
TIME, NEWTON, ALPHA = settings_beside(__file__).values()
SETTINGS = TIME | NEWTON | ALPHA
REASONS = {"damping": "N s/m, and N m s in the body's axes: m c and I c, which give the scene's decay"}
REASONS |= {name: setting.why for name, setting in SETTINGS.items() if setting.why}


class Exudyn(Engine):
    """Exudyn's rigid body without contacts."""

    name, reasons = "exudyn", REASONS
    choices: ClassVar = {"profile": PROFILES, "integrator": tuple(INTEGRATORS)}
    settings: ClassVar = SETTINGS

    @property
    def order(self) -> float:  # type: ignore[override]  # it depends on the option
        return INTEGRATORS[self.option("integrator")][1]

    def declines(self, scene: Scenario) -> str | None:
        if scene.floor is None:
            return None
        return "Exudyn's contacts are springs: with restitution 0.5 a ball rebounds with 0.481 or 0.498, by their stiffness"

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return ExudynSimulation(scene, dt, self)


class ExudynSimulation(Simulation):
    """A system of one body, and a solver that takes one step a call."""

    def __init__(self, scene: Scenario, dt: float, engine: Exudyn) -> None:
        start, inertia, mass = scene.start, scene.body.inertia_tensor, scene.body.mass
        self._container = exu.SystemContainer()  # holds the system
        self._system = self._container.AddSystem()
        turned = Rotation.from_quat(start.orientation)
        spin = turned.inv().apply(start.angular_velocity)
        node = items.NodeRigidBodyRotVecLG(
            referenceCoordinates=[*start.position, *turned.as_rotvec()], initialVelocities=[*start.velocity, *spin]
        )
        moments = inertia[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
        self._node = self._system.AddNode(node)
        self._body = self._system.AddObject(items.ObjectRigidBody(mass=mass, inertia=moments, nodeNumber=self._node))
        weight = self._system.AddMarker(items.MarkerBodyMass(bodyNumber=self._body))
        self._load = self._system.AddLoad(items.LoadMassProportional(markerNumber=weight, loadVector=scene.acceleration))
        damping = {}
        if scene.damping is not None:
            damping = {"linear": scene.damping.linear * mass * np.eye(3), "angular": scene.damping.angular * inertia}
            self._damp(**damping)
        self._system.Assemble()
        solver, _ = INTEGRATORS[engine.option("integrator")]
        is_implicit = solver in ("GeneralizedAlpha", "TrapezoidalIndex2")
        self._options = exu.SimulationSettings()
        self._options.solution.file.write = False
        time, alpha = self._options.timeIntegration, self._options.timeIntegration.generalizedAlpha
        time.numberOfSteps, time.endTime, time.solverType = 1, dt, getattr(exu.DynamicSolverType, solver)
        alpha.useNewmark = alpha.useIndex2Constraints = solver == "TrapezoidalIndex2"
        chosen = ({} if engine.is_default else calibrated_values(SETTINGS)) | engine.given
        in_force = {}
        for table, names in ((time, TIME), (time.newton, NEWTON), (alpha, ALPHA)):
            for name in names:
                if engine.unmet_need(name) is None:
                    setattr(table, name, chosen.get(name, getattr(table, name)))
                    in_force[name] = getattr(table, name)
        self._solver = exu.MainSolverImplicitSecondOrder() if is_implicit else exu.MainSolverExplicit()
        self._solver.InitializeSolver(self._system, self._options)
        self.settings = {"version": version("exudyn"), "profile": engine.option("profile"), "solverType": solver, **in_force}
        self.settings |= {"damping": {motion: rates.tolist() for motion, rates in damping.items()}} if damping else {}

    def _damp(self, linear: Array, angular: Array) -> None:
        rates = np.zeros((6, 6))
        rates[:3, :3], rates[3:, 3:] = linear, angular
        ground = self._system.AddObject(items.ObjectGround())
        bodies = [self._system.AddMarker(items.MarkerBodyRigid(bodyNumber=body)) for body in (self._body, ground)]
        self._system.AddObject(items.ObjectConnectorRigidBodySpringDamper(markerNumbers=bodies, stiffness=np.zeros((6, 6)), damping=rates))

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self._solver.it.currentTime, self._solver.it.currentStepIndex = 0.0, 1  # else only the first call would step
            if not self._solver.SolveSteps(self._system, self._options):
                raise Diverged("Exudyn's solver does not converge")

    def state(self) -> Array:
        return _states([self._outputs()])[0]

    def record(self, steps: int, every: int = 1) -> Array:
        rows = [self._outputs()]
        for _ in range(steps // every):
            self.advance(every)
            rows.append(self._outputs())
        return _states(rows)

    def _outputs(self) -> Array:
        return np.concatenate([self._system.GetNodeOutput(self._node, output) for output in OUTPUTS])

    def as_built(self) -> AsBuilt:
        body, gravity = self._system.GetObject(self._body), self._system.GetLoad(self._load)["loadVector"]
        xx, yy, zz, yz, xz, xy = body["inertia"]
        return AsBuilt(body["mass"], np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), np.array(gravity))


def _states(rows: Sequence[Array]) -> Array:
    """States of position, rotation matrix, velocity and spin; together, as SciPy takes 60 µs for one rotation."""
    position, turned, velocity, spin = np.split(np.array(rows), [3, 12, 15], axis=1)
    return np.concatenate([position, Rotation.from_matrix(turned.reshape(-1, 3, 3)).as_quat(), velocity, spin], axis=1)
