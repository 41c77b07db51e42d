"""The engine `pybullet`: calibrated settings that reproduce the scene, or Bullet's defaults (profile=default)."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from dropspin.comparisons.engines.base import (
    EXPLICIT_GYROSCOPIC,
    FLOOR_HALF_SIZE,
    IMPLICIT_GYROSCOPIC,
    LATE_IMPACTS,
    PROFILES,
    SEMI_IMPLICIT_EULER,
    Engine,
    Simulation,
    may_tumble,
    refusal_of_axes,
    refusal_of_floor,
    refusal_of_hull,
)
from dropspin.comparisons.engines.programs import can_be_pasted, rendered
from dropspin.comparisons.engines.pybullet_settings import (
    FASTEST,
    REASONS,
    STRONGEST_FRICTION,
    contact_properties,
    damping_properties,
    world_parameters,
)
from dropspin.comparisons.engines.pybullet_simulation import LARGEST_TURN, MOST_BALLS, Form, PyBulletSimulation
from dropspin.comparisons.measuring.predictions import bounce_error, flight_error
from dropspin.scenarios import DropspinError, Scenario, Truth
from dropspin.scenarios.bodies import Box, Vertices

SMALLEST_INERTIA = 2.3e-16  # (kg m²)³; Bullet's solver of three equations takes a smaller determinant for 0
FASTEST_DECAY = 30.0  # 1/s; from 37 on 1 - exp(-rate) is 1 in double precision, and the body stops


class PyBullet(Engine):
    """Bullet's rigid body on a plane, or on a large box (boxes); or with its defaults (profile=default)."""

    name = "pybullet"
    order = 1.0
    reasons = REASONS
    choices: ClassVar = {
        "coordinates": ("maximal", "multibody"),
        "profile": PROFILES,
        "velocity_clamp": ("lifted", "kept"),
        "body": ("shape", "hull"),
        "floor": ("fitting", "plane", "box", "mesh"),
        "beside": ("none", "heavy"),
    }
    representations: ClassVar = ("body", "floor", "beside")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.is_default and {"coordinates", "velocity_clamp"} & self.options.keys():
            raise DropspinError(f"engine {self.label!r}: profile=default sets coordinates and velocity_clamp; leave these out.")
        if self.option("velocity_clamp") == "kept" and not self.is_multibody:
            raise DropspinError(f"engine {self.label!r}: only multibodies clamp speeds; add coordinates=multibody.")

    @property
    def is_default(self) -> bool:
        """Whether Bullet keeps its defaults."""
        return self.option("profile") == "default"

    @property
    def is_multibody(self) -> bool:
        """Whether the body is Bullet's btMultiBody, its default, rather than a btRigidBody."""
        return self.is_default or self.option("coordinates") == "multibody"

    @property
    def is_unclamped(self) -> bool:
        """Whether the clamp of a multibody's speeds is removed."""
        return self.is_multibody and not self.is_default and self.option("velocity_clamp") == "lifted"

    def discretisation(self, scene: Scenario) -> str | None:
        """Maximal coordinates solve the gyroscopic term implicitly, with one Newton step; multibodies do not, and have other contacts."""
        gyroscopic = EXPLICIT_GYROSCOPIC if self.is_multibody else IMPLICIT_GYROSCOPIC
        flight = gyroscopic if may_tumble(scene) else SEMI_IMPLICIT_EULER
        if scene.floor is None:
            return flight
        return None if self.is_multibody else f"{flight}, {LATE_IMPACTS}"

    def predicted_error(self, scene: Scenario, truth: Truth | None, metric: str, dt: float) -> float | None:
        """The error of semi-implicit Euler about a fixed axis, and of a flat bounce: detected late, or in a multibody after gravity."""
        if self.is_default or np.linalg.norm(scene.start.angular_velocity) * dt > LARGEST_TURN:
            return None
        flight = flight_error(scene, truth, metric, dt, exact_rotation=True)
        return bounce_error(scene, truth, metric, dt, gravity_first=self.is_multibody) if flight is None else flight

    def declines(self, scene: Scenario) -> str | None:
        """Why calibration cannot reproduce the scene."""
        inertia = scene.body.inertia_tensor
        if (askew := refusal_of_axes(scene, "passes inertia")) is not None:
            return askew
        floor = scene.floor
        if not self.is_multibody and may_tumble(scene) and np.prod(np.diag(inertia)) < SMALLEST_INERTIA:
            return f"Bullet omits the gyroscopic term if the product of the moments is below {SMALLEST_INERTIA:g}; scale the scene's units"
        if scene.damping is not None and not self.is_default and max(scene.damping.linear, scene.damping.angular) > FASTEST_DECAY:
            return f"the adapter sets no decay faster than {FASTEST_DECAY:g} per second; Bullet's coefficient, 1 - exp(-rate), loses digits"
        if scene.damping is not None and self.is_multibody and not self.is_default:
            return "Bullet's multibodies damp by another law, k v (1 + |v|)"
        is_hull = self.option("body") == "hull"
        unfit = refusal_of_hull(scene, "hull") if is_hull else None
        if unfit is not None or floor is None:
            return unfit
        if isinstance(scene.body, Vertices) and not is_hull and len(scene.body.hull) > MOST_BALLS:
            return f"the adapter builds compound shapes of at most {MOST_BALLS} parts; the convex hull has {len(scene.body.hull)} vertices"
        if (too_small := refusal_of_floor(scene, self._form.floor_in(scene))) is not None:
            return too_small
        if not isinstance(floor.friction, str) and floor.friction > STRONGEST_FRICTION:
            return f"Bullet caps friction at {STRONGEST_FRICTION:g}; the floor has {floor.friction:g}"
        return None

    def programs(self, scene: Scenario, dt: float) -> Mapping[str, str]:
        """The settings as Python, and the body's part of them as URDF."""
        if self.is_default or not can_be_pasted(scene):
            return {}
        moments = np.diag(scene.body.inertia_tensor)[[2, 0, 1]].tolist()
        sizes = [2.0 * scene.body.half_extents[axis] for axis in (2, 0, 1)] if isinstance(scene.body, Box) else []
        surface = {**contact_properties(scene, default=False), **damping_properties(scene, default=False)}
        surface |= {"maxJointVelocity": FASTEST} if self.is_unclamped else {}
        parameters = {name: value for name, value in world_parameters(scene, dt).items() if name != "fixedTimeStep"}
        values = {"engine": "PyBullet", "dt": dt, "maximal": not self.is_multibody, "surface": surface}
        return {
            "python": rendered("pybullet.py.jinja", scene, why=REASONS, parameters=parameters, floor_half_size=FLOOR_HALF_SIZE, **values),
            "urdf": rendered("pybullet.urdf.jinja", scene, moments=moments, sizes=sizes, **values),
        }

    @property
    def _form(self) -> Form:
        represented = {name: self.option(name) for name in self.representations}
        return Form(self.is_default, self.is_multibody, self.is_unclamped, **represented)

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return PyBulletSimulation(scene, dt, self._form)
