"""The engine `jsbsim`: JSBSim's rigid body in flight over a planet without rotation or gravity; an external force is the scene's gravity.

The laws of motion hold in any consistent units, so JSBSim's feet, slugs and pounds are metres, kilograms and newtons here.
"""

import warnings
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import jsbsim
import numpy as np
from scipy.spatial.transform import Rotation

from dropspin.comparisons.engines.base import AsBuilt, Diverged, Engine, Simulation
from dropspin.comparisons.engines.mapping import PROFILES
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.engines.settings import settings_beside
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.state import Array

EULER, TRAPEZOIDAL, AB2, AB3, _, _, BUSS2, LOCAL, AB5 = range(1, 10)
INTEGRATORS = {
    "default": ((EULER, EULER, AB2, AB3), 1.0),
    "trapezoidal": ((TRAPEZOIDAL, TRAPEZOIDAL, TRAPEZOIDAL, TRAPEZOIDAL), 1.0),
    "adams-bashforth-2": ((AB2, AB2, AB2, AB2), 2.0),
    "adams-bashforth-3": ((AB3, AB3, AB3, AB3), 2.0),
    "adams-bashforth-5": ((AB5, AB5, AB5, AB5), 2.0),
    "buss-2": ((AB2, BUSS2, AB2, AB2), 2.0),
    "local-linearization": ((AB2, LOCAL, AB2, AB2), 2.0),
}
"""JSBSim's numbers of the methods of `METHODS`, and the order that they have together, by the option `integrator`."""
(METHODS,) = settings_beside(__file__).values()
CENTRE = np.array([1.0, 1.0, 1.0]) / 3.0  # m, of the planet; JSBSim divides by the distance from it, which is hardly ever 0 there
POUNDS = 32.174049  # JSBSim's weight of a slug; it takes the weight as the mass
STATE = [*(f"position/eci-{axis}-ft" for axis in "xyz"), *(f"velocities/eci-{axis}-fps" for axis in "xyz")]
SPIN = [f"velocities/{rate}i-rad_sec" for rate in "pqr"]
PLANET = """<planet name="none"> <equatorial_radius>1</equatorial_radius> <polar_radius>1</polar_radius>
<rotation_rate>0</rotation_rate> <GM>1e-300</GM> <J2>0</J2> </planet>"""  # it divides by GM
BODY = """<fdm_config name="body" version="2.0"> <metrics/> <ground_reactions/> <aerodynamics/>
<mass_balance negated_crossproduct_inertia="false"> <emptywt>{weight!r}</emptywt> {inertia} </mass_balance>
<external_reactions> <force name="gravity" frame="INERTIAL"> <location/> <direction>{gravity}</direction> </force> {damping}
</external_reactions> </fdm_config>"""
START = """<initialize name="start" version="2.0"> <position frame="ECI">{position}</position> <velocity frame="ECI">{velocity}</velocity>
<orientation frame="ECI">{angles}</orientation> <attitude_rate frame="BODY">{spin}</attitude_rate> </initialize>"""

jsbsim.FGJSBBase().debug_lvl = 0
jsbsim.set_logger(jsbsim.DefaultLogger(jsbsim.LogLevel.ERROR))  # else it prints what a body lacks of an aircraft


class JSBSim(Engine):
    """JSBSim's rigid body in flight."""

    name, reasons = "jsbsim", {"damping": "N s/m, and N m s in the body's axes: m c and I c, which give the scene's decay"}
    choices: ClassVar = {"profile": PROFILES, "integrator": tuple(INTEGRATORS)}
    settings: ClassVar = METHODS

    @property
    def order(self) -> float:  # type: ignore[override]  # it depends on the option
        return INTEGRATORS[self.option("integrator")][1]

    def declines(self, scene: Scenario) -> str | None:
        return None if scene.floor is None else "JSBSim's ground contacts are the springs and dampers of a landing gear"

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        methods = dict(zip(METHODS, map(str, INTEGRATORS[self.option("integrator")][0]), strict=True)) | self.given
        return JSBSimSimulation(scene, dt, {"profile": self.option("profile")} | methods)


def elements(values: Array, names: Iterable[str] = "xyz") -> str:
    """An XML element for each number, with all its digits."""
    return "".join(f"<{name}>{value!r}</{name}>" for name, value in zip(names, values.tolist(), strict=True))


def euler_angles(turned: Array) -> Array:
    """Roll, pitch and yaw [rad] of a rotation matrix; accurate at a pitch of π/2 too, where roll and yaw are about the same axis."""
    yaw = np.arctan2(turned[1, 0], turned[0, 0])
    across = np.array([-np.sin(yaw), np.cos(yaw), 0.0]) @ turned
    return np.array([np.arctan2(-across[2], across[1]), np.arctan2(-turned[2, 0], np.hypot(turned[0, 0], turned[1, 0])), yaw])


def array(matrix: Callable[[], Any]) -> Array:
    """A matrix that JSBSim returns; it is a numpy.matrix, of which NumPy warns."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PendingDeprecationWarning)
        return np.asarray(matrix())


def damping_xml(linear: float, angular: Array) -> str:
    """Forces along the world's axes, by the velocity [N s/m], and moments about the body's, by the spin [N m s], shape (3, 3)."""
    xml = ""
    for axis, (name, row) in enumerate(zip("xyz", angular.tolist(), strict=True)):
        along = f"<direction><{name}>1</{name}></direction>"
        drag, *moments = (
            f"<product><value>{-rate!r}</value><property>{of}</property></product>"
            for rate, of in zip([linear, *row], [STATE[3 + axis], *SPIN], strict=True)
        )
        xml += f'<force name="drag-{name}" frame="INERTIAL"><location/>{along}<function>{drag}</function></force>'
        xml += f'<moment name="drag-about-{name}" frame="BODY">{along}<function><sum>{"".join(moments)}</sum></function></moment>'
    return xml


class JSBSimSimulation(Simulation):
    """A JSBSim executive."""

    def __init__(self, scene: Scenario, dt: float, chosen: Mapping[str, str]) -> None:
        start, damping, mass, inertia = scene.start, scene.damping, scene.body.mass, scene.body.inertia_tensor
        self.settings = {"version": version("jsbsim"), **chosen}
        drag = ""
        if damping is not None:
            linear, angular = damping.linear * mass, damping.angular * inertia
            drag = damping_xml(linear, angular)
            self.settings |= {"damping": {"linear": linear, "angular": angular.tolist()}}
        signs = np.array([1.0, 1.0, 1.0, 1.0, 1.0, -1.0])  # x and z of the frame in which moments are given are the body's reversed
        moments = elements(signs * inertia[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]], ("ixx", "iyy", "izz", "ixy", "iyz", "ixz"))
        turned, velocity = Rotation.from_quat(start.orientation), elements(np.array(start.velocity))
        angles, spin = euler_angles(turned.as_matrix()), turned.inv().apply(start.angular_velocity)
        position, gravity = elements(np.array(start.position) - CENTRE), elements(scene.acceleration)
        body = BODY.format(weight=mass * POUNDS, inertia=moments, gravity=gravity, damping=drag)
        begun = START.format(position=position, velocity=velocity, angles=elements(angles), spin=elements(spin))
        with TemporaryDirectory() as folder:
            for name, text in {"planet": PLANET, "body": body, "start": begun}.items():
                (Path(folder) / f"{name}.xml").write_text(text)
            self._executive = executive = jsbsim.FGFDMExec(folder)
            executive.load_planet(f"{folder}/planet.xml", False)
            executive.load_model_with_paths("body", folder, folder, folder, False)
            executive.get_ic().load(f"{folder}/start.xml", False)
        executive.set_dt(dt)
        weight = {"external_reactions/gravity/magnitude": mass * float(np.linalg.norm(scene.acceleration))}
        for name, number in (weight | {"simulation/gravity-model": 0} | {name: int(chosen[name]) for name in METHODS}).items():
            executive[name] = number
        executive.run_ic()
        self._start, self._first = np.array(start.position), self._read(STATE[:3])

    def _read(self, names: Iterable[str]) -> Array:
        return np.array([self._executive[name] for name in names])

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self._executive.run()
        if not np.isfinite(self._read(STATE + SPIN)).all():
            raise Diverged("the state is not finite")

    def state(self) -> Array:
        linear = self._read(STATE)
        turned = Rotation.from_matrix(array(self._executive.get_propagate().get_Tec2b).T)
        spin, moved = turned.apply(self._read(SPIN)), linear[:3] - self._first  # small starts keep their digits, which CENTRE lacks
        return np.concatenate([self._start + moved, turned.as_quat(), linear[3:], spin])

    def as_built(self) -> AsBuilt:
        mass, gravity = self._executive["inertia/mass-slugs"], "external_reactions/gravity"
        weight = self._executive[f"{gravity}/magnitude"] * self._read([f"{gravity}/{axis}" for axis in "xyz"])
        return AsBuilt(mass, array(self._executive.get_mass_balance().get_J), weight / mass)
