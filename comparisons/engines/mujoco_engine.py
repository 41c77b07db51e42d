"""The engine `mujoco`: calibrated settings that reproduce the scene, or MuJoCo's defaults (profile=default); and what its versions have.

Source of what versions have: MuJoCo's changelog, under the versions named here. Also measured in each minor version from 3.2.4 to 4.0.0,
with MuJoCo's own free-body test (a box of half extents .1 .2 .3 m, ω = (1, 2, 3) rad/s, 500 steps of 10 ms): the final E/E₀ is 1.0868946
with the gyroscopic term explicit, .9260083 with it implicit, and 1 - 7e-15 with the midpoint rule.
"""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import mujoco
import numpy as np

from dropspin.comparisons.engines.base import BatchSimulation, Engine
from dropspin.comparisons.engines.mapping import (
    BESIDE,
    EXPLICIT_GYROSCOPIC,
    IMPLICIT_GYROSCOPIC,
    LATE_IMPACTS,
    MIDPOINT_GYROSCOPIC,
    PROFILES,
    SEMI_IMPLICIT_EULER,
    friction_of,
    may_tumble,
    refusal_of_floor,
    refusal_of_hull,
    refusal_of_neighbour,
    refusal_of_rest_speed,
)
from dropspin.comparisons.engines.mujoco_model import (
    FORM,
    INTEGRATORS,
    calibrated_specification,
    contact,
    damped_axes,
    default_specification,
)
from dropspin.comparisons.engines.mujoco_settings import CONTACT, FLAGS, IMPEDANCE, OPTION, SETTINGS
from dropspin.comparisons.engines.mujoco_simulation import MuJoCoBatch, MuJoCoSimulation
from dropspin.comparisons.engines.options import NumericOption
from dropspin.comparisons.engines.packages import Version, formatted, numbers_of
from dropspin.comparisons.engines.programs import can_be_pasted, rendered
from dropspin.comparisons.measuring.predictions import bounce_error, flight_error
from dropspin.scenarios import DropspinError, Scenario, Truth
from dropspin.scenarios.bodies import SHAPES, Mesh, Sphere, Vertices
from dropspin.scenarios.model import differ_in_start_alone

VERSION = numbers_of(mujoco.__version__)
OLDEST: Version = (3, 2, 4)
"""The first version in which Python can set the options of a specification."""
BATCHES: Version = (3, 2, 7)
"""The first version whose rollouts step many bodies in threads."""
EXACT_DIAGONAL: Version = (3, 9)
"""The first version with the flag diagexact.

Without the flag, MuJoCo assumes that each contact is in line with the centre of mass. That holds for a ball, whose motion is the same
to the last bit. For a box that lands flat or on a corner, the error of restitution does not vanish as dt → 0: it tends to 1.1e-4 or
3e-5 (e = 0.5, steps of 4, 2 and 1 ms).
"""
FOUR_POINTS: Version = (4, 0)
"""A version that gives a mesh four contact points with a plane; some between 3.9.0 and it may do so too.

Earlier versions give a mesh at most three contact points with a plane, so that one end of an edge may be without any. Measured with
3.2.4, 3.3.7 and 3.9.0 at 1 ms.
"""
CONTACTS_SINCE: Mapping[str, tuple[Version, str]] = {
    "box": (
        EXACT_DIAGONAL,
        "which gives boxes a coefficient of restitution that is wrong by about 1e-4 at every time step; versions from "
        f"{formatted(EXACT_DIAGONAL)} on have the flag diagexact, which corrects this: update mujoco, or use profile=default",
    ),
    "vertices": (
        FOUR_POINTS,
        "which gives a mesh at most three contact points with a plane, so that a prism that rolls over its edges leaves its course by 6 to "
        f"8 mm in 1.8 m; versions from {formatted(FOUR_POINTS)} on give it four: update mujoco, or use profile=default",
    ),
}
"""By shape, the first version whose calibrated contacts with a floor are right, and what is wrong in earlier ones."""

SOLVER = {name: str(setting.calibrated) for name, setting in (OPTION | FLAGS).items() if setting.calibrated} | {"autoreset": "disable"}
"""The solver settings of calibrated contacts, by their names in MJCF."""
FLAGS_SINCE: Mapping[str, Version] = {"diagexact": EXACT_DIAGONAL, "island": (3, 3, 6)}  # earlier versions look for islands on request only
FLIGHT_SINCE: Mapping[str, Mapping[Version, str]] = {
    "euler": {OLDEST: EXPLICIT_GYROSCOPIC},
    "implicit": {OLDEST: IMPLICIT_GYROSCOPIC, (3, 7): MIDPOINT_GYROSCOPIC, (3, 8, 1): IMPLICIT_GYROSCOPIC},
    "implicitfast": {OLDEST: EXPLICIT_GYROSCOPIC, (3, 7): MIDPOINT_GYROSCOPIC, (3, 11): IMPLICIT_GYROSCOPIC},
    "rk4": {
        # It averaged its stages' angular velocities as if rotations commuted.
        OLDEST: "classical Runge-Kutta with rotations of second order",
        (4, 0): "classical Runge-Kutta",
    },
}
STRONGEST_FRICTION = 1e9
"""The largest coefficient that the adapter sets."""
LEAST_OF_A_SPRING = 0.01  # restitution; the damping ratio there is 5, and a contact that is damped more hardly pushes
FEWEST_SPRING_STEPS = 5  # with fewer steps the restitution is between 0.25 and 1.5 times the one asked for
REASONS = {name: setting.why for name, setting in (CONTACT | OPTION | FLAGS).items() if setting.why} | {
    "autoreset": "a simulation that broke down stays broken; MuJoCo would put it back to its start without notice",
}
"""Effects were measured on a ball dropped from 1 m and boxes on a corner and at rest, restitution 0.5, without the one setting."""
SPRING = "a spring that only pushes, with stiffness and damping for this many steps of contact and for e; the values hold for this dt only"


def flight_of(integrator: str, version: Version) -> str:
    """The name of an integrator's discretisation of a tumbling body in a version."""
    since = FLIGHT_SINCE[integrator]
    return since[max(first for first in since if first <= version)]


class MuJoCo(Engine):
    """MuJoCo with exact restitution, or with its defaults."""

    name = "mujoco"
    mixes_scenes = True
    shapes, takes_offsets, takes_walls = SHAPES, True, True
    choices: ClassVar = {
        "integrator": tuple(INTEGRATORS),
        "profile": PROFILES,
        "body": ("geom", "mesh", "child"),
        "floor": ("plane", "box", "mesh"),
        "beside": BESIDE,
    }
    representations: ClassVar = tuple(FORM)
    settings: ClassVar = SETTINGS
    numbers: ClassVar = {"kappa": NumericOption(0.0, 0.0, 1.0), "spring_steps": NumericOption(0.0, 0.0, 1e4)}

    def __post_init__(self) -> None:
        super().__post_init__()
        one_of = [option for option in ("kappa", "spring_steps", "profile") if option in self.options]
        if len(one_of) > 1:
            raise DropspinError(f"engine {self.label!r}: {' and '.join(one_of)} do not go together; give one of them.")
        if 0.0 < float(self.option("spring_steps")) < FEWEST_SPRING_STEPS:
            raise DropspinError(f"engine {self.label!r}: a spring takes at least {FEWEST_SPRING_STEPS} steps; 0 is the damper.")

    @property
    def reasons(self) -> Mapping[str, str]:  # they depend on the options
        """Why each setting is what it is."""
        return REASONS | ({"solref": SPRING} if "spring_steps" in self.options else {})

    @property
    def order(self) -> float:  # type: ignore[override]  # the claim depends on the option
        """The order of accuracy that the manuals of all versions claim for the integrator; RK4's rotations reach it from 4.0 on."""
        return 4.0 if self.option("integrator") == "rk4" else 1.0

    @property
    def _stops_in_a_step(self) -> bool:
        """Whether a contact is the damper over one step alone."""
        return not {"profile", "kappa", "spring_steps", *self.given} & set(self.options)

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

    def predicted_error(self, scene: Scenario, truth: Truth | None, metric: str, dt: float) -> float | None:
        """The error of semi-implicit Euler about a fixed axis, and of a flat bounce detected late that loses (1 - d) g dt to impedance."""
        if self.option("integrator") == "rk4" or not self.is_calibrated:
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
        if VERSION < OLDEST:
            return (
                f"MuJoCo {formatted(VERSION)} is installed, whose options Python cannot set; update mujoco to {formatted(OLDEST)} or later"
            )
        if min(body.mass, *np.linalg.eigvalsh(body.inertia_tensor)) < mujoco.mjMINVAL:
            return f"MuJoCo refuses a mass or a moment of inertia below {mujoco.mjMINVAL:g}; scale the scene's units"
        unfit = refusal_of_hull(scene, "mesh") if self.option("body") == "mesh" else None
        unfit = unfit or refusal_of_floor(scene, self.option("floor")) or refusal_of_neighbour(scene, self.option("beside"))
        if unfit is not None or floor is None:
            return unfit
        if isinstance(body, Vertices | Mesh) and body.resting_height == 0.0:
            return "the adapter maps a body of vertices on a floor as a mesh, and MuJoCo has no convex hull of a flat mesh"
        return None if self.is_default else self._refusal_of_contacts(scene)

    def _refusal_of_contacts(self, scene: Scenario) -> str | None:
        """Why calibrated contacts cannot reproduce those of a scene."""
        strongest = max(friction_of(surface, gripping=0.0) for surface in scene.surfaces)
        if strongest > STRONGEST_FRICTION:
            return f"the adapter takes coefficients of friction up to {STRONGEST_FRICTION:g}; the scene has {strongest:g}"
        since, wrong = CONTACTS_SINCE.get(scene.body.shape, (OLDEST, ""))
        if since > VERSION:
            return f"MuJoCo {formatted(VERSION)} is installed, {wrong}"
        if self.option("integrator") == "rk4" and not {"spring_steps", "solref"} & set(self.options):
            return (
                "with RK4 the adapter's one-step damper acts in all stages, and no body rebounds; use integrator=euler, or spring_steps=20"
            )
        if min(surface.restitution for surface in scene.surfaces) < LEAST_OF_A_SPRING and "spring_steps" in self.options:
            return f"the adapter sets springs for a restitution of at least {LEAST_OF_A_SPRING:g}; leave out spring_steps"
        return refusal_of_rest_speed(scene, "MuJoCo")

    def _flags(self) -> dict[str, str]:
        """The settings of `SOLVER` that the installed version has."""
        return {name: value for name, value in SOLVER.items() if FLAGS_SINCE.get(name, OLDEST) <= VERSION}

    def _pairs(self, scene: Scenario, dt: float) -> list[dict[str, Any]]:
        """Settings of the contact pairs of the floor and each wall."""
        return [contact(surface, dt, *(float(self.option(name)) for name in self.numbers)) for surface in scene.surfaces]

    def programs(self, scene: Scenario, dt: float) -> Mapping[str, str]:
        """The settings as Python and as MJCF."""
        if not self.is_calibrated or not can_be_pasted(scene):
            return {}
        settings = {"integrator": self.option("integrator"), "solver": self._flags(), "pair": self._pairs(scene, dt)[0]}
        values = {"engine": "MuJoCo", "dt": dt} | settings
        return {
            "python": rendered("mujoco.py.jinja", scene, why=self.reasons, **values),
            "mjcf": rendered("mujoco.xml.jinja", scene, **values),
        }

    def prepare(self, scene: Scenario, dt: float) -> MuJoCoSimulation:
        integrator = self.option("integrator")
        form = {name: self.option(name) for name in FORM}
        settings = {"profile": self.option("profile"), "integrator": integrator} | form
        if self.is_default:
            specification = default_specification(scene, dt, integrator, form)
        else:
            specification = calibrated_specification(scene, dt, integrator, form, self._pairs(scene, dt), self._flags())
        return MuJoCoSimulation(scene, specification, settings, self.given)

    def prepare_batch(self, members: Sequence[Scenario], dt: float) -> BatchSimulation | None:
        if VERSION < BATCHES:
            return None
        first = self.prepare(members[0], dt)
        if differ_in_start_alone(members):
            return MuJoCoBatch(first, [first.model] * len(members), members)
        if any(damped_axes(member) is not None for member in members):
            return None
        models = [first.model, *(self.prepare(member, dt).model for member in members[1:])]
        # Models of other sizes in the same data give NaN; MuJoCo's signature does not count the sizes of meshes.
        sizes = {(model.signature, model.nbuffer, model.nbvh) for model in models}
        return MuJoCoBatch(first, models, members) if len(sizes) == 1 else None
