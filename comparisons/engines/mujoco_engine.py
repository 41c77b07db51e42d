"""The engine `mujoco`: calibrated, the scene as meant, by settings MuJoCo has but does not default to; or with its defaults.

MuJoCo has no coefficient of restitution. A contact is a damped spring whose reference acceleration is
a_ref = -b v - k r; with k = 0 and b = (1 + e) / dt, one step of a one-stage integrator turns the normal velocity v into
-e v, exactly but for the impedance d < 1, which leaves (1 - d) g dt behind.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

import mujoco
import numpy as np

from comparisons.engines.base import (
    EXPLICIT_GYROSCOPIC,
    IMPLICIT_GYROSCOPIC,
    LATE_IMPACTS,
    PROFILES,
    SEMI_IMPLICIT_EULER,
    Array,
    AsBuilt,
    Diverged,
    Engine,
    Simulation,
    may_tumble,
    version,
)
from comparisons.predictions import bounce_error, flight_error
from scenarios import Scenario, Truth
from scenarios.body import Box, Sphere
from scenarios.rotations import conjugate, rotate

IMPEDANCE = 0.9999  # the largest that MuJoCo takes
INFINITE_FRICTION = 1e6  # sound with elliptic cones up to 1e9
DEFAULT_INFINITE_FRICTION = 10.0  # with the pyramidal cones of the default, 1e6 would be no friction and no contact at all
INTEGRATORS = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
}
FLOOR_QUATERNION = [np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0]  # [w, x, y, z]: the plane's normal from z to y
BAD_STATE = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


REASONS = {
    "solref": "[0, -(1 + e)/dt]: a damper that turns v into -e v in one step; the default's spring rebounds with 0, whatever is asked for",
    "solimp": "the hardest MuJoCo takes, the same at any depth; left at 0.9 to 0.95, 0.5 becomes 0.466 at 0.25 ms, boxes rest 2 mm deep",
    "solreffriction": "stops sliding in a step; left to follow solref a gripping corner's slip is reversed: 0.51 of its angular momentum",
    "condim": "1 without friction, 3 with",
    "friction": "1e6 where the floor grips; with pyramidal instead of elliptic cones that would be no contact at all",
}
"""Effects were measured on a ball dropped from 1 m and boxes on a corner and at rest, restitution 0.5, with the one setting left out."""


class MuJoCo(Engine):
    """MuJoCo with exact restitution: one free body, one explicit contact pair with the floor; or as it comes (profile=default)."""

    name = "mujoco"
    reasons = REASONS
    choices: ClassVar = {"integrator": tuple(INTEGRATORS), "profile": PROFILES}

    @property
    def order(self) -> float:  # type: ignore[override]  # the claim depends on the option
        """Order of accuracy that the manual claims for the integrator."""
        return 4.0 if self.option("integrator") == "rk4" else 1.0

    def discretisation(self, scene: Scenario) -> str | None:
        """Of the integrator; they differ in the gyroscopic term. The default's contacts are like nobody else's."""
        integrator = self.option("integrator")
        if integrator == "rk4":
            return "classical Runge-Kutta"
        gyroscopic = EXPLICIT_GYROSCOPIC if integrator == "euler" else IMPLICIT_GYROSCOPIC
        flight = gyroscopic if may_tumble(scene) else SEMI_IMPLICIT_EULER
        if scene.floor is None:
            return flight
        return f"{flight}, {LATE_IMPACTS}" if self.option("profile") == "calibrated" else None

    def predicted_error(self, scene: Scenario, truth: Truth | None, metric: str, dt: float) -> float | None:
        """Semi-implicit Euler about a fixed axis; a flat bounce that is noticed late, and loses (1 - d) g dt to the impedance."""
        if self.option("integrator") == "rk4" or self.option("profile") == "default":
            return None
        flight = flight_error(scene, truth, metric, dt, exact_rotation=True)
        if flight is not None:
            return flight
        if metric == "restitution_error" and not isinstance(scene.body, Sphere):
            return None  # several contacts share the impedance in a way of their own
        return bounce_error(scene, truth, metric, dt, restitution_lost=1.0 - IMPEDANCE)

    def declines(self, scene: Scenario) -> str | None:
        """What calibration cannot map."""
        body, floor = scene.body, scene.floor
        if min(body.mass, *np.linalg.eigvalsh(body.inertia_tensor)) < mujoco.mjMINVAL:
            return f"MuJoCo refuses a mass or a moment of inertia below {mujoco.mjMINVAL:g}; scale the scene's units"
        if scene.damping is not None and not _is_diagonal(body.inertia_tensor):
            return "MuJoCo damps along the body's own axes; these are not principal axes"
        if floor is None:
            return None
        if not isinstance(body, (Sphere, Box)):
            return "only spheres and boxes are mapped onto a floor"
        if self.option("profile") == "default":
            return None
        if self.option("integrator") == "rk4":
            return "RK4 has no restitution in one step: all its stages see the contact's damper; use integrator=euler on a floor"
        if not isinstance(floor.friction, str):
            return "MuJoCo's convex friction cone adds normal velocity where a contact slips; friction is 'none' or 'infinite'"
        if floor.rest_speed > 0.0:
            return "MuJoCo has no speed below which restitution is 0 (floor.rest_speed)"
        return None

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return MuJoCoSimulation(scene, dt, self.option("integrator"), self.option("profile"))


class MuJoCoSimulation(Simulation):
    """A compiled model and its data."""

    def __init__(self, scene: Scenario, dt: float, integrator: str, profile: str) -> None:
        self.staggered = integrator != "rk4"
        calibrated = profile == "calibrated"
        self._model = (_specification if calibrated else _default_specification)(scene, dt, integrator).compile()
        if scene.damping is not None:
            rates = np.repeat([scene.damping.linear * scene.body.mass, scene.damping.angular], 3)
            rates[3:] *= np.diag(scene.body.inertia_tensor)
            self._model.dof_damping[:] = rates
        self._data = mujoco.MjData(self._model)
        start = scene.initial_state
        self._data.qpos[0:3] = start[0:3]
        self._data.qpos[3:7] = start[[6, 3, 4, 5]]
        self._data.qvel[0:3] = start[7:10]
        self._data.qvel[3:6] = rotate(conjugate(start[3:7]), start[10:13])
        self._steps = 0
        self.settings = {"version": version("mujoco"), "profile": profile, "integrator": integrator}
        if scene.floor is not None and calibrated:
            self.settings |= {
                "solref": self._model.pair_solref[0].tolist(),
                "solimp": self._model.pair_solimp[0].tolist(),
                "solreffriction": self._model.pair_solreffriction[0].tolist(),
                "condim": int(self._model.pair_dim[0]),
                "friction": float(self._model.pair_friction[0, 0]),
            }

    def advance(self, steps: int) -> None:
        with _quiet():
            mujoco.mj_step(self._model, self._data, steps)
        self._steps += steps
        self._raise_if_bad()

    def state(self) -> Array:
        rows = np.concatenate([self._data.qpos, self._data.qvel])[None]
        return _to_world(rows)[0]

    def record(self, steps: int, every: int = 1) -> Array:
        rows = np.empty((1 + steps // every, 13))
        positions, velocities = rows[:, :7], rows[:, 7:]
        data, model, step = self._data, self._model, mujoco.mj_step
        qpos, qvel = data.qpos, data.qvel
        positions[0], velocities[0] = qpos, qvel
        with _quiet():
            for row in range(1, len(rows)):
                step(model, data, every)
                positions[row], velocities[row] = qpos, qvel
        self._steps += (len(rows) - 1) * every
        self._raise_if_bad()
        return _to_world(rows)

    def as_built(self) -> AsBuilt:
        axes = rotate(self._model.body_iquat[1][[1, 2, 3, 0]], np.eye(3))
        inertia = axes.T @ np.diag(self._model.body_inertia[1]) @ axes
        return AsBuilt(float(self._model.body_mass[1]), inertia, self._model.opt.gravity.copy())

    def _raise_if_bad(self) -> None:
        for kind in BAD_STATE:
            if self._data.warning[kind].number > 0:
                raise Diverged(f"MuJoCo's {kind.name} (a number beyond 1e10 or NaN) within the first {self._steps} steps")


def _free_body(scene: Scenario, dt: float, integrator: str) -> tuple[Any, Any]:
    """What every profile sets: step, gravity, integrator, and a free body's mass and inertia; the specification and its body.

    The automatic reset would put a simulation that broke down back to its start, unnoticed.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = dt
    spec.option.gravity = scene.acceleration
    spec.option.integrator = INTEGRATORS[integrator]
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
    body = spec.worldbody.add_body(name="body")
    body.add_freejoint()
    body.explicitinertial = True
    body.mass = scene.body.mass
    body.ipos = [0.0, 0.0, 0.0]
    body.inertia, body.iquat = _principal(scene.body.inertia_tensor)
    return spec, body


def _default_specification(scene: Scenario, dt: float, integrator: str) -> Any:
    """What a user gets who sets friction on both surfaces and leaves the rest: MuJoCo has no restitution to set."""
    spec, body = _free_body(scene, dt, integrator)
    if scene.floor is not None:
        known = {"none": 0.0, "infinite": DEFAULT_INFINITE_FRICTION}
        friction = known[scene.floor.friction] if isinstance(scene.floor.friction, str) else scene.floor.friction
        surface = {"friction": [friction, 0.005, 0.0001]}  # sliding; torsion and rolling as they come
        _add_shape(body, scene, **surface)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0], quat=FLOOR_QUATERNION, **surface)
    return spec


def _specification(scene: Scenario, dt: float, integrator: str) -> Any:
    spec, body = _free_body(scene, dt, integrator)
    option = spec.option
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    disable, enable = mujoco.mjtDisableBit, mujoco.mjtEnableBit
    option.disableflags |= disable.mjDSBL_ISLAND
    option.enableflags = enable.mjENBL_DIAGEXACT
    if scene.floor is None:
        option.disableflags |= disable.mjDSBL_CONTACT | disable.mjDSBL_CONSTRAINT
    else:
        _add_contact(spec, body, scene, dt)
    return spec


def _principal(inertia: Array) -> tuple[Array, Array]:
    """Principal moments and the quaternion [w, x, y, z] of their axes; the identity where the tensor is diagonal."""
    if _is_diagonal(inertia):
        return np.diag(inertia), np.array([1.0, 0.0, 0.0, 0.0])
    from scipy.spatial.transform import Rotation

    moments, axes = np.linalg.eigh(inertia)
    # A flat body's largest moment is the sum of the others, which MuJoCo does not let rounding exceed.
    moments[2] = min(moments[2], np.nextafter(moments[0] + moments[1], 0.0))
    return moments, Rotation.from_matrix(axes * np.linalg.det(axes)).as_quat(scalar_first=True)


def _is_diagonal(inertia: Array) -> bool:
    return np.count_nonzero(inertia - np.diag(np.diag(inertia))) == 0


def _add_contact(spec: Any, body: Any, scene: Scenario, dt: float) -> None:
    assert scene.floor is not None
    _add_shape(body, scene, name="shape", contype=0, conaffinity=0)
    spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0], quat=FLOOR_QUATERNION, contype=0, conaffinity=0
    )
    sticking = scene.floor.friction == "infinite"
    spec.add_pair(
        geomname1="floor",
        geomname2="shape",
        condim=3 if sticking else 1,
        friction=[INFINITE_FRICTION, INFINITE_FRICTION, 0.0, 0.0, 0.0] if sticking else [0.0] * 5,
        solref=[0.0, -(1.0 + scene.floor.restitution) / dt],
        solimp=[IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0],
        solreffriction=[0.0, -1.0 / dt],
    )


def _add_shape(body: Any, scene: Scenario, **properties: Any) -> None:
    if isinstance(scene.body, Sphere):
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[scene.body.radius, 0.0, 0.0], **properties)
    elif isinstance(scene.body, Box):
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=scene.body.half_extents, **properties)


def _to_world(rows: Array) -> Array:
    """From [x, q = w x y z, v, ω in the body] to the project's order and frame."""
    states = np.empty_like(rows)
    states[:, 0:3] = rows[:, 0:3]
    states[:, 3:6], states[:, 6] = rows[:, 4:7], rows[:, 3]
    states[:, 7:10] = rows[:, 7:10]
    states[:, 10:13] = rotate(states[:, 3:7], rows[:, 10:13])
    return states


@contextmanager
def _quiet() -> Iterator[None]:
    """MuJoCo appends its warnings to a file in the working directory, unless a handler takes them; the counters tell us."""
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(None)
