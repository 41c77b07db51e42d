"""The engine `mujoco`: calibrated settings that reproduce the scene, or MuJoCo's defaults (profile=default)."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import mujoco
import numpy as np

from dropspin.comparisons.engines.base import (
    LATE_IMPACTS,
    MIDPOINT_GYROSCOPIC,
    PROFILES,
    SEMI_IMPLICIT_EULER,
    BatchSimulation,
    Engine,
    NumericOption,
    Simulation,
    may_tumble,
    refusal_of_axes,
    refusal_of_floor,
    refusal_of_hull,
    refusal_of_rest_speed,
)
from dropspin.comparisons.engines.mujoco_contact import IMPEDANCE, STRONGEST_FRICTION, contact
from dropspin.comparisons.engines.mujoco_model import INTEGRATORS, Form, calibrated_specification, default_specification
from dropspin.comparisons.engines.mujoco_simulation import MuJoCoBatch, MuJoCoSimulation
from dropspin.comparisons.engines.mujoco_versions import (
    BATCHES,
    flight_of,
    numbers_of,
    refusal,
    refusal_of_boxes,
    refusal_of_meshes,
    solver,
)
from dropspin.comparisons.engines.programs import can_be_pasted, rendered
from dropspin.comparisons.measuring.predictions import bounce_error, flight_error
from dropspin.scenarios import DropspinError, Scenario, Truth
from dropspin.scenarios.bodies import Box, Sphere, Vertices
from dropspin.scenarios.model import differ_in_start_alone

VERSION = numbers_of(mujoco.__version__)
LEAST_OF_A_SPRING = 0.01  # restitution; the damping ratio there is 5, and a contact that is damped more hardly pushes
FEWEST_SPRING_STEPS = 5  # with fewer steps the restitution is between 0.25 and 1.5 times the one asked for

REASONS = {
    "solref": "[0, -(1 + e)/dt]: a damper that turns v into -e v in one step; with the default spring the restitution is 0.13 for any e",
    "solimp": "the hardest contact that MuJoCo allows, at any depth; at the default 0.9 to 0.95, restitution 0.5 becomes 0.466 at 0.25 ms, "
    "and boxes rest 2 mm deep",
    "solreffriction": "stops sliding in one step; if it follows solref, a gripping corner's slip is reversed, which costs 0.51 of its "
    "angular momentum",
    "condim": "1 without friction, 3 with",
    "friction": "the scene's coefficient; 1e6 where the floor grips",
    "cone": "elliptic: the same friction in every direction; with pyramidal cones a friction of 1e6 leaves no contact",
    "jacobian": "MuJoCo's own choice for few bodies, set explicitly because version 4.0.0 has a fault in its sparse solver",
    "diagexact": "the contact's exact inertia, not an estimate; at an impedance of 0.9999 the difference is 1e-4 of a corner's energy",
    "island": "one body is one island; the search for it takes a seventh of a step",
    "autoreset": "a simulation that broke down stays broken; MuJoCo would put it back to its start without notice",
}
"""Effects were measured on a ball dropped from 1 m and boxes on a corner and at rest, restitution 0.5, without the one setting."""
SPRING = "a spring that only pushes, with stiffness and damping for this many steps of contact and for e; the values hold for this dt only"


class MuJoCo(Engine):
    """MuJoCo with exact restitution: one free body and one explicit contact pair with the floor; or its defaults (profile=default)."""

    name = "mujoco"
    choices: ClassVar = {
        "integrator": tuple(INTEGRATORS),
        "profile": PROFILES,
        "body": ("geom", "mesh", "child"),
        "floor": ("plane", "box", "mesh"),
        "beside": ("none", "heavy"),
    }
    representations: ClassVar = ("body", "floor", "beside")
    mixes_scenes = True
    numbers: ClassVar = {"kappa": NumericOption(0.0, 0.0, 1.0), "spring_steps": NumericOption(0.0, 0.0, 1e4)}

    def __post_init__(self) -> None:
        super().__post_init__()
        one_of = [option for option in ("kappa", "spring_steps", "profile") if option in self.options]
        if len(one_of) > 1:
            raise DropspinError(f"engine {self.label!r}: {' and '.join(one_of)} do not go together; give one of them.")
        if 0.0 < float(self.option("spring_steps")) < FEWEST_SPRING_STEPS:
            raise DropspinError(f"engine {self.label!r}: a spring takes at least {FEWEST_SPRING_STEPS} steps; 0 is the damper.")

    @property
    def reasons(self) -> Mapping[str, str]:  # type: ignore[override]  # they depend on the options
        """Why each setting is what it is."""
        return REASONS | ({"solref": SPRING} if "spring_steps" in self.options else {})

    @property
    def order(self) -> float:  # type: ignore[override]  # the claim depends on the option
        """The order of accuracy that the manuals of all versions claim for the integrator; RK4's rotations reach it from 4.0 on."""
        return 4.0 if self.option("integrator") == "rk4" else 1.0

    def discretisation(self, scene: Scenario) -> str | None:
        """The integrator's scheme, which depends on the gyroscopic term; contacts of the default profile have no name in common use."""
        integrator = self.option("integrator")
        tumbling = flight_of(integrator, VERSION)
        if integrator == "rk4":
            return tumbling
        # The midpoint rule rotates by the mean of two angular velocities, which differ under any torque.
        torque = tumbling == MIDPOINT_GYROSCOPIC and (scene.damping is not None or scene.floor is not None)
        flight = tumbling if torque or may_tumble(scene) else SEMI_IMPLICIT_EULER
        if scene.floor is None:
            return flight
        return f"{flight}, {LATE_IMPACTS}" if self._stops_in_a_step else None

    @property
    def _stops_in_a_step(self) -> bool:
        """Whether a contact is the damper over one step alone."""
        return not {"profile", "kappa", "spring_steps"} & set(self.options)

    def predicted_error(self, scene: Scenario, truth: Truth | None, metric: str, dt: float) -> float | None:
        """The error of semi-implicit Euler about a fixed axis, and of a flat bounce detected late that loses (1 - d) g dt to impedance."""
        if self.option("integrator") == "rk4" or self.option("profile") == "default":
            return None
        flight = flight_error(scene, truth, metric, dt, exact_rotation=True)
        if flight is not None or not self._stops_in_a_step:
            return flight
        if metric == "restitution_error" and not isinstance(scene.body, Sphere):
            return None  # several contacts share the impedance in a way that has no closed form here
        return bounce_error(scene, truth, metric, dt, restitution_lost=1.0 - IMPEDANCE)

    def declines(self, scene: Scenario) -> str | None:
        """Why calibration cannot reproduce the scene, or the installed version cannot run it."""
        body, floor = scene.body, scene.floor
        if (too_old := refusal(VERSION)) is not None:
            return too_old
        if min(body.mass, *np.linalg.eigvalsh(body.inertia_tensor)) < mujoco.mjMINVAL:
            return f"MuJoCo refuses a mass or a moment of inertia below {mujoco.mjMINVAL:g}; scale the scene's units"
        unfit = refusal_of_axes(scene, "damps") if scene.damping is not None else None
        if (unfit := unfit or self._refusal_of_shape(scene)) is not None:
            return unfit
        if floor is None or self.option("profile") == "default":
            return None
        if not isinstance(floor.friction, str) and floor.friction > STRONGEST_FRICTION:
            return f"the adapter takes coefficients of friction up to {STRONGEST_FRICTION:g}; the floor has {floor.friction:g}"
        refusal_of_contacts = {Box: refusal_of_boxes, Vertices: refusal_of_meshes}.get(type(body))
        if refusal_of_contacts is not None and (too_old := refusal_of_contacts(VERSION)) is not None:
            return too_old
        if self.option("integrator") == "rk4" and "spring_steps" not in self.options:
            return (
                "with RK4 the adapter's one-step damper acts in all stages, and no body rebounds; use integrator=euler, or spring_steps=20"
            )
        if floor.restitution < LEAST_OF_A_SPRING and "spring_steps" in self.options:
            return f"the adapter sets springs for a restitution of at least {LEAST_OF_A_SPRING:g}; leave out spring_steps"
        return refusal_of_rest_speed(scene, "MuJoCo")

    def _refusal_of_shape(self, scene: Scenario) -> str | None:
        """Why the shape of a scene's body cannot strike a floor."""
        unfit = refusal_of_hull(scene, "mesh") if self.option("body") == "mesh" else None
        unfit = unfit or refusal_of_floor(scene, self.option("floor"))
        if unfit is None and scene.floor is not None and isinstance(scene.body, Vertices) and scene.body.resting_height == 0.0:
            return "the adapter maps a body of vertices on a floor as a mesh, and MuJoCo has no convex hull of a flat mesh"
        return unfit

    def programs(self, scene: Scenario, dt: float) -> Mapping[str, str]:
        """The settings as Python and as MJCF."""
        if self.option("profile") == "default" or not can_be_pasted(scene):
            return {}
        settings = {"integrator": self.option("integrator"), "solver": solver(VERSION), "pair": self._pair(scene, dt)}
        values = {"engine": "MuJoCo", "dt": dt} | settings
        return {
            "python": rendered("mujoco.py.jinja", scene, why=self.reasons, **values),
            "mjcf": rendered("mujoco.xml.jinja", scene, **values),
        }

    def _pair(self, scene: Scenario, dt: float) -> dict[str, Any]:
        """Settings of the contact pair; empty without a floor."""
        if scene.floor is None:
            return {}
        kappa, steps = (float(self.option(name)) for name in ("kappa", "spring_steps"))
        return contact(scene.floor.restitution, scene.floor.friction, dt, kappa, steps)

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return self._prepare(scene, dt)

    def prepare_batch(self, members: Sequence[Scenario], dt: float) -> BatchSimulation | None:
        if VERSION < BATCHES:
            return None
        first = self._prepare(members[0], dt)
        model, _ = first.built
        if differ_in_start_alone(members):
            return MuJoCoBatch(first, [model] * len(members), members)
        models = [model, *(self._prepare(member, dt).built[0] for member in members[1:])]
        # Models of other sizes in the same data give NaN; MuJoCo's signature does not count the sizes of meshes.
        sizes = {(one.signature, one.nbuffer, one.nbvh) for one in models}
        return MuJoCoBatch(first, models, members) if len(sizes) == 1 else None

    def _prepare(self, scene: Scenario, dt: float) -> "MuJoCoSimulation":
        form = Form(self.option("integrator"), **{name: self.option(name) for name in self.representations})
        settings = {name: self.option(name) for name in ("profile", "integrator", *self.representations)}
        if self.option("profile") == "default":
            return MuJoCoSimulation(scene, default_specification(scene, dt, form), settings)
        pair = self._pair(scene, dt)
        flags = solver(VERSION) if pair else {"autoreset": "disable"}
        specification = calibrated_specification(scene, dt, form, pair, flags)
        return MuJoCoSimulation(scene, specification, settings | flags | pair)
