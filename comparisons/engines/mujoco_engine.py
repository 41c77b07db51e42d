"""The engine `mujoco`: calibrated, the scene as meant, by settings MuJoCo has but does not default to; or with its defaults."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, ClassVar

import mujoco
import numpy as np
from mujoco import rollout

from comparisons.engines.base import (
    LATE_IMPACTS,
    MIDPOINT_GYROSCOPIC,
    PROFILES,
    SEMI_IMPLICIT_EULER,
    Array,
    AsBuilt,
    BatchSimulation,
    Diverged,
    Engine,
    KnownLimitation,
    NumericOption,
    Simulation,
    may_tumble,
)
from comparisons.engines.mujoco_contact import IMPEDANCE, contact
from comparisons.engines.mujoco_versions import SIDE_BY_SIDE, flight_of, numbers_of, refusal, refusal_of_boxes, solver
from comparisons.engines.programs import can_be_pasted, rendered
from comparisons.measuring.predictions import bounce_error, flight_error
from reference_impl.threads import usable_cores
from scenarios import DropspinError, Scenario, Truth
from scenarios.body import Box, Sphere
from scenarios.mechanics import is_diagonal, principal_axes
from scenarios.rotations import conjugate, cross, rotate
from scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY

VERSION = numbers_of(mujoco.__version__)
DEFAULT_INFINITE_FRICTION = 10.0  # with the pyramidal cones of the default, 1e6 would be no friction and no contact at all
INTEGRATORS = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
}
FLOOR_QUATERNION = [np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0]  # [w, x, y, z]: the plane's normal from z to y
LEAST_OF_A_SPRING = 0.01  # damped 5 times over; from there on it hardly pushes
FEWEST_SPRING_STEPS = 5  # with fewer the rebound is anything between a quarter and half as much again
NO_SLIP = 1e-3  # m/s; what is left of a slip that friction stops
ROW = slice(1, 14)  # of a full state, after the time: position, quaternion, velocities
FULL_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
BAD_STATE = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)

REASONS = {
    "solref": "[0, -(1 + e)/dt]: a damper that turns v into -e v in one step; the default's spring leaves 0.13, whatever is asked",
    "solimp": "the hardest MuJoCo takes, the same at any depth; left at 0.9 to 0.95, 0.5 becomes 0.466 at 0.25 ms, boxes rest 2 mm deep",
    "solreffriction": "stops sliding in a step; left to follow solref a gripping corner's slip is reversed: 0.51 of its angular momentum",
    "condim": "1 without friction, 3 with",
    "friction": "as asked; 1e6 where the floor grips",
    "cone": "friction alike in every direction; with pyramids, a friction of 1e6 would be no contact at all",
    "jacobian": "what MuJoCo takes for few bodies anyway; said, as version 4.0.0 has a fault in its sparse solver",
    "diagexact": "the contact's exact inertia, not an estimate; at an impedance of 0.9999 that is 1e-4 of a corner's energy",
    "island": "one body is one island; looking for it takes a seventh of a step",
    "autoreset": "a state that breaks down stays broken; MuJoCo would put it back to its start, unnoticed",
}
"""Effects were measured on a ball dropped from 1 m and boxes on a corner and at rest, restitution 0.5, with the one setting left out."""
SPRING = "a spring that only pushes, so stiff that it pushes for so many steps and so damped that e is left; its numbers are for this step"


class MuJoCo(Engine):
    """MuJoCo with exact restitution: one free body, one explicit contact pair with the floor; or as it comes (profile=default)."""

    name = "mujoco"
    choices: ClassVar = {"integrator": tuple(INTEGRATORS), "profile": PROFILES}
    numbers: ClassVar = {"kappa": NumericOption(0.0, 0.0, 1.0), "spring_steps": NumericOption(0.0, 0.0, 1e4)}

    def __post_init__(self) -> None:
        super().__post_init__()
        one_of = [option for option in ("kappa", "spring_steps", "profile") if option in self.options]
        if len(one_of) > 1:
            raise DropspinError(f"engine {self.label!r}: {' and '.join(one_of)} do not go together; the contact is one of them.")
        if 0.0 < float(self.option("spring_steps")) < FEWEST_SPRING_STEPS:
            raise DropspinError(f"engine {self.label!r}: a spring takes at least {FEWEST_SPRING_STEPS} steps; 0 is the damper.")

    @property
    def reasons(self) -> Mapping[str, str]:  # type: ignore[override]  # they depend on the options
        """Why each setting is what it is."""
        return REASONS | ({"solref": SPRING} if "spring_steps" in self.options else {})

    @property
    def order(self) -> float:  # type: ignore[override]  # the claim depends on the option
        """Order of accuracy that the manual of any version claims for the integrator; RK4's turns keep it from 4.0 on."""
        return 4.0 if self.option("integrator") == "rk4" else 1.0

    def discretisation(self, scene: Scenario) -> str | None:
        """Of the integrator; they differ in the gyroscopic term. The default's contacts are like nobody else's."""
        integrator = self.option("integrator")
        tumbling = flight_of(integrator, VERSION)
        if integrator == "rk4":
            return tumbling
        # The midpoint's turns are by the mean of two angular velocities, which differ under any torque.
        torque = tumbling == MIDPOINT_GYROSCOPIC and (scene.damping is not None or scene.floor is not None)
        flight = tumbling if torque or may_tumble(scene) else SEMI_IMPLICIT_EULER
        if scene.floor is None:
            return flight
        return f"{flight}, {LATE_IMPACTS}" if self._stops_in_a_step else None

    @property
    def _stops_in_a_step(self) -> bool:
        """Whether a contact is the damper over one step, and nothing else."""
        return not {"profile", "kappa", "spring_steps"} & set(self.options)

    def predicted_error(self, scene: Scenario, truth: Truth | None, metric: str, dt: float) -> float | None:
        """Semi-implicit Euler about a fixed axis; a flat bounce that is noticed late, and loses (1 - d) g dt to the impedance."""
        if self.option("integrator") == "rk4" or self.option("profile") == "default":
            return None
        flight = flight_error(scene, truth, metric, dt, exact_rotation=True)
        if flight is not None or not self._stops_in_a_step:
            return flight
        if metric == "restitution_error" and not isinstance(scene.body, Sphere):
            return None  # several contacts share the impedance in a way of their own
        return bounce_error(scene, truth, metric, dt, restitution_lost=1.0 - IMPEDANCE)

    def declines(self, scene: Scenario) -> str | None:
        """What calibration cannot map, and what the installed version cannot do."""
        body, floor = scene.body, scene.floor
        if (too_old := refusal(VERSION)) is not None:
            return too_old
        if min(body.mass, *np.linalg.eigvalsh(body.inertia_tensor)) < mujoco.mjMINVAL:
            return f"MuJoCo refuses a mass or a moment of inertia below {mujoco.mjMINVAL:g}; scale the scene's units"
        if scene.damping is not None and not is_diagonal(body.inertia_tensor):
            return "MuJoCo damps along the body's own axes; these are not principal axes"
        if floor is None:
            return None
        if not isinstance(body, (Sphere, Box)):
            return "only spheres and boxes are mapped onto a floor"
        if self.option("profile") == "default":
            return None
        if isinstance(body, Box) and (too_old := refusal_of_boxes(VERSION)) is not None:
            return too_old
        if self.option("integrator") == "rk4" and "spring_steps" not in self.options:
            return "RK4 has no restitution in one step: all its stages see the contact's damper; use integrator=euler, or spring_steps=20"
        if floor.restitution < LEAST_OF_A_SPRING and "spring_steps" in self.options:
            return f"a spring that only pushes has no restitution below {LEAST_OF_A_SPRING:g}; leave out spring_steps"
        if floor.rest_speed > 0.0:
            return "MuJoCo has no speed below which restitution is 0 (floor.rest_speed)"
        return None

    def programs(self, scene: Scenario, dt: float) -> Mapping[str, str]:
        """As Python and as MJCF."""
        if self.option("profile") == "default" or not can_be_pasted(scene):
            return {}
        settings = {"integrator": self.option("integrator"), "solver": solver(VERSION), "pair": self._pair(scene, dt)}
        values = {"engine": "MuJoCo", "dt": dt} | settings
        return {
            "python": rendered("mujoco.py.jinja", scene, why=self.reasons, **values),
            "mjcf": rendered("mujoco.xml.jinja", scene, **values),
        }

    def _pair(self, scene: Scenario, dt: float) -> dict[str, Any]:
        """Settings of the contact, none where there is no floor."""
        if scene.floor is None:
            return {}
        kappa, steps = (float(self.option(name)) for name in ("kappa", "spring_steps"))
        return contact(scene.floor.restitution, scene.floor.friction, dt, kappa, steps)

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return self._prepare(scene, dt)

    def prepare_batch(self, members: Sequence[Scenario], dt: float) -> BatchSimulation | None:
        if VERSION < SIDE_BY_SIDE:
            return None
        return MuJoCoBatch([self._prepare(member, dt) for member in members])

    def _prepare(self, scene: Scenario, dt: float) -> "MuJoCoSimulation":
        settings = {name: self.option(name) for name in ("profile", "integrator")}
        if self.option("profile") == "default":
            return MuJoCoSimulation(scene, _default_specification(scene, dt, self.option("integrator")), settings)
        pair = self._pair(scene, dt)
        settings |= solver(VERSION) if pair else {"autoreset": "disable"}
        return MuJoCoSimulation(scene, _specification(scene, dt, self.option("integrator"), pair), settings | pair)


class MuJoCoSimulation(Simulation):
    """A compiled model and its data."""

    def __init__(self, scene: Scenario, specification: Any, settings: Mapping[str, Any]) -> None:
        self._scene = scene
        self._model = specification.compile()
        self.staggered = settings["integrator"] != "rk4"
        self.settings = {"version": mujoco.__version__, **settings}
        if scene.damping is not None:
            rates = np.repeat([scene.damping.linear * scene.body.mass, scene.damping.angular], 3)
            rates[3:] *= np.diag(scene.body.inertia_tensor)
            self._model.dof_damping[:] = rates
        self._data = mujoco.MjData(self._model)
        start = scene.initial_state
        self._data.qpos[0:3] = start[POSITION]
        self._data.qpos[3:7] = start[[6, 3, 4, 5]]
        self._data.qvel[0:3] = start[VELOCITY]
        self._data.qvel[3:6] = rotate(conjugate(start[ORIENTATION]), start[SPIN])
        self._steps = 0

    def advance(self, steps: int) -> None:
        with _quiet():
            mujoco.mj_step(self._model, self._data, steps)
        self._steps += steps
        self._raise_if_bad(f"within the first {self._steps} steps")

    def state(self) -> Array:
        rows = np.concatenate([self._data.qpos, self._data.qvel])[None]
        return _to_world(rows)[0]

    def record(self, steps: int, every: int = 1) -> Array:
        with _quiet():
            rows = self._each_step(steps) if every == 1 and steps else self._some_steps(steps, every)
        self._raise_if_bad(f"in step {self._steps + _last_good_row(rows) * every + 1}")
        self._steps += (len(rows) - 1) * every
        states = _to_world(rows)
        self.known_limitations = (
            list(_limitations_met(self._scene, states)) if every == 1 and self.settings["profile"] == "calibrated" else []
        )
        return states

    def _each_step(self, steps: int) -> Array:
        """MuJoCo's own recording, which takes a fifth to a quarter less time than a loop here, for the same bits."""
        now = self.full_state()
        warm = self._data.qacc_warmstart.copy()
        states, _ = rollout.rollout(self._model, self._data, now, nstep=steps, initial_warmstart=warm)
        return np.vstack([now, states[0]])[:, ROW]

    def full_state(self) -> Array:
        """The state as MuJoCo's rollout takes it."""
        now = np.empty(mujoco.mj_stateSize(self._model, FULL_STATE))
        mujoco.mj_getState(self._model, self._data, now, FULL_STATE)
        return now

    @property
    def built(self) -> tuple[Any, Any]:
        """The model and its data."""
        return self._model, self._data

    def _some_steps(self, steps: int, every: int) -> Array:
        rows = np.empty((1 + steps // every, 13))
        positions, velocities = rows[:, :7], rows[:, 7:]
        data, model, step = self._data, self._model, mujoco.mj_step
        qpos, qvel = data.qpos, data.qvel
        positions[0], velocities[0] = qpos, qvel
        for row in range(1, len(rows)):
            step(model, data, every)
            positions[row], velocities[row] = qpos, qvel
        return rows

    def as_built(self) -> AsBuilt:
        axes = rotate(self._model.body_iquat[1][[1, 2, 3, 0]], np.eye(3))
        inertia = axes.T @ np.diag(self._model.body_inertia[1]) @ axes
        return AsBuilt(float(self._model.body_mass[1]), inertia, self._model.opt.gravity.copy())

    def _raise_if_bad(self, when: str) -> None:
        for kind in BAD_STATE:
            if self._data.warning[kind].number > 0:
                raise Diverged(f"MuJoCo's {kind.name} (a number beyond {mujoco.mjMAXVAL:g} or NaN) {when}")


class MuJoCoBatch(BatchSimulation):
    """Starts that MuJoCo's rollout takes side by side, in threads; it records them all as it goes."""

    def __init__(self, simulations: Sequence[MuJoCoSimulation]) -> None:
        self._now = np.array([simulation.full_state() for simulation in simulations])
        self._model, data = simulations[0].built
        self._datas = [data, *(mujoco.MjData(self._model) for _ in range(usable_cores() - 1))]

    def advance(self, steps: int) -> None:
        with _quiet():
            states, _ = rollout.rollout(self._model, self._datas, self._now, nstep=steps)
        self._now = states[:, -1].copy()

    def states(self) -> Array:
        return _to_world(self._now[:, ROW])


def _last_good_row(rows: Array) -> int:
    """The last row before a number went bad, or before MuJoCo's recording broke off and repeated its last state."""
    bad = ~(np.abs(rows) < mujoco.mjMAXVAL).all(axis=1) | (rows == rows[-1]).all(axis=1)
    return max(0, int(np.argmax(bad)) - 1)


def _limitations_met(scene: Scenario, states: Array) -> Iterator[KnownLimitation]:
    """How fast contacts slip that Coulomb friction should slow: of each step, the corners that begin it below the floor.

    MuJoCo's cone is convex: a contact that slips at s gets up to a = µ s of rebound on top (dual cone, one-step damper). The hop takes
    2 (e u + a)/g; by 2 a/g of it friction acts too late, so that the slip is off by up to 2 µ a until the landing makes up for it.
    """
    if scene.floor is None or isinstance(scene.floor.friction, str):
        return
    before, after = states[:-1], states[1:]
    arms = rotate(before[:, None, ORIENTATION], scene.body.vertices) - [0.0, scene.body.rounding, 0.0]
    touching = before[:, None, 1] + arms[..., 1] <= 0.0
    velocities = after[:, None, VELOCITY] + cross(after[:, None, SPIN], arms)
    slip = float(np.hypot(velocities[..., 0], velocities[..., 2])[touching].max(initial=0.0))
    if slip <= NO_SLIP:
        return
    friction, g = scene.floor.friction, float(np.linalg.norm(scene.acceleration))
    added = friction * slip
    late, e, fastest = 2.0 * friction * added, scene.floor.restitution, float(-states[:, 8].min())
    hop = 2.0 * (e * max(0.0, fastest) + added) / g if g else 0.0
    sizes = {
        "position_error": (late + added) * hop,
        "orientation_error": (late + added) * hop / scene.body.size,
        "angular_momentum_error": (late + added) / slip,
        "energy_error": (2.0 * slip * late + added**2) / slip**2,
        "energy_gain": (added / slip) ** 2,
    }
    if fastest > added:
        sizes |= {"restitution_error": added / fastest, "bounce_height_error": (2.0 * e * added * fastest + added**2) / fastest**2}
    yield KnownLimitation(
        f"contacts slip by up to {slip:.3g} m/s, to which MuJoCo's friction cone adds up to µ slip, {added:.3g} m/s of rebound", sizes
    )


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


def _specification(scene: Scenario, dt: float, integrator: str, pair: Mapping[str, Any]) -> Any:
    """The solver's settings and those of a contact pair; without a pair, neither contacts nor constraints are looked for."""
    spec, body = _free_body(scene, dt, integrator)
    option, disable = spec.option, mujoco.mjtDisableBit
    if not pair:
        option.disableflags |= disable.mjDSBL_CONTACT | disable.mjDSBL_CONSTRAINT
        return spec
    flags = solver(VERSION)
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    if "island" in flags:
        option.disableflags |= disable.mjDSBL_ISLAND
    if "diagexact" in flags:
        option.enableflags = mujoco.mjtEnableBit.mjENBL_DIAGEXACT
    passive = {"contype": 0, "conaffinity": 0}  # the pair is all there is
    _add_shape(body, scene, name="shape", **passive)
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0], quat=FLOOR_QUATERNION, **passive)
    spec.add_pair(geomname1="floor", geomname2="shape", **pair)
    return spec


def _principal(inertia: Array) -> tuple[Array, Array]:
    """Principal moments and the quaternion [w, x, y, z] of their axes; the identity where the tensor is diagonal."""
    if is_diagonal(inertia):
        return np.diag(inertia), np.array([1.0, 0.0, 0.0, 0.0])
    from scipy.spatial.transform import Rotation

    moments, axes = principal_axes(inertia)
    # A flat body's largest moment is the sum of the others, which MuJoCo does not let rounding exceed.
    moments[2] = min(moments[2], np.nextafter(moments[0] + moments[1], 0.0))
    return moments, Rotation.from_matrix(axes).as_quat(scalar_first=True)


def _add_shape(body: Any, scene: Scenario, **properties: Any) -> None:
    if isinstance(scene.body, Sphere):
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[scene.body.radius, 0.0, 0.0], **properties)
    elif isinstance(scene.body, Box):
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=scene.body.half_extents, **properties)


def _to_world(rows: Array) -> Array:
    """From [x, q = w x y z, v, ω in the body] to the project's order and frame."""
    states = np.empty_like(rows)
    states[:, POSITION] = rows[:, POSITION]
    states[:, 3:6], states[:, 6] = rows[:, 4:7], rows[:, 3]
    states[:, VELOCITY] = rows[:, VELOCITY]
    states[:, SPIN] = rotate(states[:, ORIENTATION], rows[:, SPIN])
    return states


@contextmanager
def _quiet() -> Iterator[None]:
    """MuJoCo appends its warnings to a file in the working directory, unless a handler takes them; the counters tell us."""
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(None)
