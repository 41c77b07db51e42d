"""The engine `pybullet`: calibrated settings that reproduce the scene, or Bullet's defaults (profile=default).

Maximal coordinates (btRigidBody) give v+ = -e v exactly once three settings are 0: the contact thresholds that start a collision early,
the error reduction that adds penetration to the rebound, and the speed below which Bullet drops restitution.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from dropspin.comparisons.engines.base import Engine, Simulation
from dropspin.comparisons.engines.mapping import (
    BESIDE,
    EXPLICIT_GYROSCOPIC,
    FLOOR_HALF_SIZE,
    IMPLICIT_GYROSCOPIC,
    LATE_IMPACTS,
    PROFILES,
    SEMI_IMPLICIT_EULER,
    friction_of,
    may_tumble,
    refusal_of_floor,
    refusal_of_hull,
    refusal_of_neighbour,
)
from dropspin.comparisons.engines.programs import can_be_pasted, rendered
from dropspin.comparisons.engines.pybullet_limitations import LARGEST_TURN, MOST_BALLS, STRONGEST_FRICTION
from dropspin.comparisons.engines.pybullet_settings import BODY, FLOOR, SETTINGS, WORLD
from dropspin.comparisons.engines.pybullet_simulation import PyBulletSimulation
from dropspin.comparisons.engines.settings import calibrated_values
from dropspin.comparisons.measuring.predictions import bounce_error, flight_error
from dropspin.scenarios import DropspinError, Scenario, Truth
from dropspin.scenarios.bodies import SHAPES, Box, OnAxis, Vertices
from dropspin.scenarios.surfaces import Surface

SMALLEST_INERTIA = 2.3e-16  # (kg m²)³; Bullet's solver of three equations takes a smaller determinant for 0
FASTEST_DECAY = 30.0  # 1/s; from 37 on 1 - exp(-rate) is 1 in double precision, and the body stops
RESIDUAL = float(np.finfo(float).eps)  # of the speed that gravity gives in a step; Bullet's residuals are squares of speeds
REASONS = {name: setting.why for name, setting in SETTINGS.items() if setting.why} | {
    "fixedTimeStep": "the step asked for; Bullet's own is 1/240 s",
    "coordinates": "maximal: a rebound of e times the approach speed; a multibody's is e (u + g dt), and its speeds are clamped at 100",
}
"""Effects were measured on a ball dropped from 1 m and a box at rest, restitution 0.5, without the one setting."""


COEFFICIENTS = ("restitution", "lateralFriction")


class PyBullet(Engine):
    """Bullet's rigid body on a plane, or on a large box."""

    name = "pybullet"
    order = 1.0
    reasons = REASONS
    shapes, takes_offsets, takes_walls = SHAPES, True, True
    choices: ClassVar = {
        "coordinates": ("maximal", "multibody"),
        "profile": PROFILES,
        "velocity_clamp": ("lifted", "kept"),
        "body": ("shape", "hull"),
        "floor": ("fitting", "plane", "box", "mesh"),
        "beside": BESIDE,
    }
    representations: ClassVar = ("body", "floor", "beside")
    settings: ClassVar = SETTINGS

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.is_default and {"coordinates", "velocity_clamp"} & self.options.keys():
            raise DropspinError(f"engine {self.label!r}: profile=default sets coordinates and velocity_clamp; leave these out.")
        for of in ("", "floor_"):
            if len({f"{of}contactStiffness", f"{of}contactDamping"} & self.given.keys()) == 1:
                raise DropspinError(
                    f"engine {self.label!r}: {of}contactStiffness and {of}contactDamping go together; give both, or neither."
                )
        if self.option("velocity_clamp") == "kept" and not self.is_multibody:
            raise DropspinError(f"engine {self.label!r}: only multibodies clamp speeds; add coordinates=multibody.")

    def option(self, name: str) -> str:
        """An option's value; the default profile sets the coordinates."""
        return "multibody" if name == "coordinates" and self.is_default else super().option(name)

    @property
    def is_multibody(self) -> bool:
        """Whether the body is Bullet's btMultiBody, its default, rather than a btRigidBody."""
        return self.option("coordinates") == "multibody"

    def discretisation(self, scene: Scenario) -> str | None:
        """Maximal coordinates solve the gyroscopic term implicitly, with one Newton step; multibodies do not, and have other contacts."""
        gyroscopic = EXPLICIT_GYROSCOPIC if self.is_multibody else IMPLICIT_GYROSCOPIC
        flight = gyroscopic if may_tumble(scene) else SEMI_IMPLICIT_EULER
        if scene.floor is None:
            return flight
        return None if self.is_multibody or self.given else f"{flight}, {LATE_IMPACTS}"

    def predicted_error(self, scene: Scenario, truth: Truth | None, metric: str, dt: float) -> float | None:
        """The error of semi-implicit Euler about a fixed axis, and of a flat bounce: detected late, or in a multibody after gravity."""
        if not self.is_calibrated or np.linalg.norm(scene.start.angular_velocity) * dt > LARGEST_TURN:
            return None
        flight = flight_error(scene, truth, metric, dt, exact_rotation=True)
        return bounce_error(scene, truth, metric, dt, gravity_first=self.is_multibody) if flight is None else flight

    def declines(self, scene: Scenario) -> str | None:
        """Why calibration cannot reproduce the scene."""
        floor, damping = scene.floor, scene.damping
        is_hull = self.option("body") == "hull"
        if not self.is_multibody and may_tumble(scene) and np.prod(np.diag(scene.body.inertia_tensor)) < SMALLEST_INERTIA:
            return f"Bullet omits the gyroscopic term if the product of the moments is below {SMALLEST_INERTIA:g}; scale the scene's units"
        if damping is not None and not self.is_default and max(damping.linear, damping.angular) > FASTEST_DECAY:
            return f"the adapter sets no decay faster than {FASTEST_DECAY:g} per second; Bullet's coefficient, 1 - exp(-rate), loses digits"
        if damping is not None and self.is_multibody and self.is_calibrated:
            return "Bullet's multibodies damp by another law, k v (1 + |v|)"
        unfit = refusal_of_hull(scene, "hull") if is_hull else None
        if unfit is not None or floor is None:
            return unfit
        if isinstance(scene.body, Vertices) and not is_hull and len(scene.body.hull) > MOST_BALLS:
            return f"the adapter builds compound shapes of at most {MOST_BALLS} parts; the convex hull has {len(scene.body.hull)} vertices"
        unfit = refusal_of_floor(scene, self._floor_in(scene)) or refusal_of_neighbour(scene, self.option("beside"))
        strongest = max(friction_of(surface, gripping=0.0) for surface in scene.surfaces)
        if unfit is None and strongest > STRONGEST_FRICTION:
            return f"Bullet caps friction at {STRONGEST_FRICTION:g}; the scene has {strongest:g}"
        if unfit is None and floor.ends and self.option("floor") == "mesh":
            return "the adapter builds a floor that ends as a box"
        if unfit is None and not self.is_default and any(surface.rest_speed != floor.rest_speed for surface in scene.surfaces):
            return "Bullet has one speed below which restitution is 0; those of the floor and the walls differ"
        return unfit

    def _floor_in(self, scene: Scenario) -> str:
        """The floor of a scene, and its walls: `plane`, `box` or `mesh`; `fitting` is a plane, or, calibrated, a box for what can lie."""
        if self.option("floor") == "fitting":
            return "box" if isinstance(scene.body, Box | OnAxis) and not self.is_default else "plane"
        return self.option("floor")

    def _parameters(self, scene: Scenario, dt: float) -> dict[str, Any]:
        """The parameters of the physics engine at a time step [s]."""
        if self.is_default:
            return {"fixedTimeStep": dt} | self.given_of(WORLD)
        computed = {
            "fixedTimeStep": dt,
            "solverResidualThreshold": (RESIDUAL * float(np.linalg.norm(scene.acceleration)) * dt) ** 2,
            "restitutionVelocityThreshold": 0.0 if scene.floor is None else scene.floor.rest_speed,
        }
        return calibrated_values(WORLD) | computed | self.given_of(WORLD)

    def _dynamics(self, scene: Scenario) -> dict[str, Any]:
        """The properties of the body: contact, damping, sleep and clamp.

        Bullet multiplies the coefficients of the two bodies; with 1 for one of them, the product is the scene's value: for the floor, or
        for the body if there are walls. Maximal coordinates damp as v (1 - k)^t, so that k = 1 - exp(-rate) is the scene's decay. In the
        default profile a scene without damping keeps Bullet's default of 0.04.
        """
        floor, damping = scene.floor, scene.damping
        rates = {f"{motion}Damping": rate for motion, rate in damping.rates.items()} if damping else {}
        found: dict[str, Any] = {}
        if floor is not None:
            found = dict.fromkeys(COEFFICIENTS, 1.0) if scene.wall else _coefficients(floor)
        if self.is_default:
            return found | rates | self.given_of(BODY)
        is_clamped = not self.is_multibody or self.option("velocity_clamp") == "kept"
        without = {"contactProcessingThreshold": floor is None, "maxJointVelocity": is_clamped}
        found |= {name: value for name, value in calibrated_values(BODY).items() if not without.get(name)}
        found |= {name: float(-np.expm1(-rates.get(name, 0.0))) for name in ("linearDamping", "angularDamping")}
        return found | self.given_of(BODY)

    def _surfaces(self, scene: Scenario) -> list[dict[str, Any]]:
        """The properties of the floor and each wall."""
        of_floor = ({} if self.is_default else calibrated_values(FLOOR)) | self.given_of(FLOOR)
        properties = {name.removeprefix("floor_"): value for name, value in of_floor.items()}
        return [(_coefficients(one) if scene.wall else dict.fromkeys(COEFFICIENTS, 1.0)) | properties for one in scene.surfaces]

    def programs(self, scene: Scenario, dt: float) -> Mapping[str, str]:
        """The settings as Python, and the body's part of them as URDF."""
        if not self.is_calibrated or not can_be_pasted(scene):
            return {}
        moments = np.diag(scene.body.inertia_tensor)[[2, 0, 1]].tolist()
        sizes = [2.0 * scene.body.half_extents[axis] for axis in (2, 0, 1)] if isinstance(scene.body, Box) else []
        surface = {name: value for name, value in self._dynamics(scene).items() if name != "activationState"}
        parameters = {name: value for name, value in self._parameters(scene, dt).items() if name != "fixedTimeStep"}
        values = {"engine": "PyBullet", "dt": dt, "maximal": not self.is_multibody, "surface": surface}
        return {
            "python": rendered("pybullet.py.jinja", scene, why=REASONS, parameters=parameters, floor_half_size=FLOOR_HALF_SIZE, **values),
            "urdf": rendered("pybullet.urdf.jinja", scene, moments=moments, sizes=sizes, **values),
        }

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        coordinates = "multibody" if self.is_multibody else "maximal"
        form = {"profile": self.option("profile"), "coordinates": coordinates}
        form |= {name: self.option(name) for name in self.representations}
        form |= {"floor": self._floor_in(scene)} if scene.floor else {}
        return PyBulletSimulation(scene, dt, form, self._parameters(scene, dt), self._dynamics(scene), self._surfaces(scene))


def _coefficients(surface: Surface) -> dict[str, float]:
    """Restitution and friction of a floor or a wall."""
    return dict(zip(COEFFICIENTS, (surface.restitution, friction_of(surface, STRONGEST_FRICTION)), strict=True))
