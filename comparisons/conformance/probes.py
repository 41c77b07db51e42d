"""Probes: scenes built to distinguish the faults of adapters. No two axes, frames, sizes or rates are equal in them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios import Scenario
from dropspin.scenarios.loading import from_mapping
from dropspin.scenarios.rotations import angle_between_orientations
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY

Array = NDArray[np.float64]

DT = 2.5e-4
"""The time step [s]; so short that the discretisation error of any engine is small beside the error of a fault."""
TILT = [0.1825741858350554, 0.3651483716701107, 0.5477225575051661, 0.7302967433402214]  # (1, 2, 3, 4)/√30
CUBE = {"shape": "box", "half_extents": [0.2, 0.2, 0.2], "mass": 2.7}
BALL = {"shape": "sphere", "radius": 0.1, "mass": 2.7}
BLOCK = {"shape": "box", "half_extents": [0.11, 0.2, 0.29], "mass": 2.7, "inertia": [0.05, 0.07, 0.1]}
FALL = {"acceleration": [0.0, -7.0, 0.0]}


@dataclass(frozen=True)
class Probe:
    """A scene, and the errors that an engine may have.

    Attributes:
        name: The name of its check.
        scene: The scene.
        allowed: The largest errors of position [m], attitude [rad], velocity [m/s], angular velocity [rad/s]; inf where not compared.
    """

    name: str
    scene: Scenario
    allowed: tuple[float, float, float, float]

    @property
    def times(self) -> Array:
        """The times of comparison [s]: half of the duration and the end."""
        return DT * self.rows

    @property
    def rows(self) -> Array:
        """The steps after which states are compared."""
        steps = self.scene.steps(DT)
        return np.array([steps // 2, steps])

    def off(self, found: Array, expected: Array) -> Array:
        """The largest difference of states, shape (2, 13), from others, shape (..., 2, 13), over the allowed one; inf if not finite."""
        worst = np.max(differences(found, expected) / np.array(self.allowed), axis=-1)
        return np.where(np.isfinite(worst), worst, np.inf)


def differences(found: Array, expected: Array) -> Array:
    """The largest differences of position [m], attitude [rad], velocity [m/s], angular velocity [rad/s], shape (..., 4)."""
    position, velocity, spin = (np.linalg.norm(found[..., part] - expected[..., part], axis=-1) for part in (POSITION, VELOCITY, SPIN))
    turned = angle_between_orientations(found[..., ORIENTATION], expected[..., ORIENTATION])
    return np.stack([position, turned, velocity, spin], axis=-1).max(axis=-2)


def _probe(name: str, allowed: tuple[float, float, float, float], duration: float, body: dict[str, Any], **tables: Any) -> Probe:
    return Probe(name, from_mapping({"name": name.replace(" ", "-"), "duration": duration, "body": body, **tables}), allowed)


def _floor(restitution: float, friction: str | float) -> dict[str, Any]:
    return {"restitution": restitution, "friction": friction}


PROBES = (
    _probe(
        "coasting", (1e-3, 1e-4, 1e-3, 1e-4), 0.5, BALL,
        start={"position": [1.0, 2.0, -3.0], "orientation": TILT, "velocity": [0.5, -1.25, 2.0]},
    ),
    _probe(
        "turning", (1e-6, 0.01, 1e-6, 0.01), 0.5, CUBE,
        start={"orientation": TILT, "angular_velocity": [1.0, -2.0, 3.0]},
    ),
    _probe(
        "tumbling", (1e-3, 0.02, 1e-3, 0.06), 0.5, BLOCK,
        start={"position": [1.0, 2.0, -3.0], "orientation": TILT, "velocity": [0.5, -1.25, 2.25], "angular_velocity": [2.0, -5.0, 4.0]},
    ),
    _probe(
        "tumbling askew", (1e-6, 0.02, 1e-6, 0.06), 0.5,
        {"shape": "vertices", "points": [[0.2, 0.0, 0.1], [-0.1, 0.3, 0.0], [0.0, -0.2, 0.25], [0.1, 0.1, -0.3]], "mass": 2.7},
        start={"orientation": TILT, "angular_velocity": [2.0, -5.0, 4.0]},
    ),
    _probe(
        "falling", (2e-3, 1e-4, 2e-3, 1e-4), 0.5, BALL,
        start={"position": [1.0, 2.0, -3.0], "velocity": [0.5, -1.25, 2.0]}, gravity={"acceleration": [1.5, -7.0, 3.0]},
    ),
    _probe(
        "falling straight", (2e-3, 1e-4, 2e-3, 1e-4), 0.5, BALL,
        start={"position": [1.0, 2.0, -3.0], "velocity": [0.5, -1.25, 2.0]}, gravity=FALL,
    ),
    _probe(
        "damped", (1e-3, 1e-2, 1e-3, 1e-2), 0.5, CUBE,
        start={"orientation": TILT, "velocity": [0.5, -1.25, 2.0], "angular_velocity": [1.0, -2.0, 3.0]},
        damping={"linear": 0.8, "angular": 0.3},
    ),
    _probe(
        "creeping", (1e-5, 1e-5, 2e-5, 2e-5), 4.0, CUBE,
        start={"velocity": [1e-3, 0.0, 2e-3], "angular_velocity": [0.0, 2e-3, 1e-3]},
    ),
    _probe(
        "fast", (float("inf"), float("inf"), 0.3, 0.3), 0.05, CUBE,
        start={"velocity": [300.0, 0.0, 0.0], "angular_velocity": [0.0, 300.0, 0.0]},
    ),
    _probe(
        "bouncing ball", (8e-4, 1e-4, 7e-3, 1e-4), 0.5, BALL,
        start={"position": [0.0, 0.4, 0.0]}, gravity=FALL, floor=_floor(0.6, "none"),
    ),
    _probe(
        "dull ball", (8e-4, 1e-4, 7e-3, 1e-4), 0.5, BALL,
        start={"position": [0.0, 0.4, 0.0]}, gravity=FALL, floor=_floor(0.3, "none"),
    ),
    _probe(
        "lively ball", (2e-3, 1e-4, 7e-3, 1e-4), 0.5, BALL,
        start={"position": [0.0, 0.4, 0.0]}, gravity=FALL, floor=_floor(1.0, "none"),
    ),
    _probe(
        "slow ball", (1e-4, 1e-4, 6e-3, 1e-4), 0.03, BALL,
        start={"position": [0.0, 0.1007, 0.0]}, gravity=FALL, floor=_floor(0.6, "none"),
    ),
    _probe(
        "bouncing box", (3e-3, 1e-2, 7e-3, 2e-2), 0.5, {"shape": "box", "half_extents": [0.16, 0.1, 0.23], "mass": 2.7},
        start={"position": [0.0, 0.4, 0.0]}, gravity=FALL, floor=_floor(0.6, "none"),
    ),
    _probe(
        "gripping floor", (4e-3, 0.05, 0.03, 0.4), 0.5, BALL,
        start={"position": [0.0, 0.4, 0.0], "velocity": [0.5, 0.0, 0.3], "angular_velocity": [80.0, 20.0, -100.0]},
        gravity=FALL, floor=_floor(0.6, "infinite"),
    ),
    _probe(
        "slippery floor", (4e-3, 0.02, 0.01, 0.1), 0.5, BALL,
        start={"position": [0.0, 0.4, 0.0], "velocity": [6.0, 0.0, 3.6], "angular_velocity": [4.0, 2.0, -6.0]},
        gravity=FALL, floor=_floor(0.6, 0.12),
    ),
    _probe(
        "sliding box", (3e-3, 0.01, 0.01, 0.03), 0.5, {"shape": "box", "half_extents": [0.2, 0.05, 0.3], "mass": 2.7},
        start={"position": [0.0, 0.05, 0.0], "velocity": [2.0, 0.0, 0.0]}, gravity=FALL, floor=_floor(0.0, 0.3),
    ),
    _probe(
        "corner", (3e-3, 0.03, 0.02, 0.1), 0.36, BLOCK,
        start={"position": [0.0, 0.65, 0.0], "orientation": TILT}, gravity=FALL, floor=_floor(0.6, "none"),
    ),
    _probe(
        "gripping corner", (3e-3, 0.03, 0.02, 0.1), 0.36, BLOCK,
        start={"position": [0.0, 0.65, 0.0], "orientation": TILT}, gravity=FALL, floor=_floor(0.6, "infinite"),
    ),
)  # fmt: skip
