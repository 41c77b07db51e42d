"""The header of a recording, a TOML file: units, axes, conventions, the body and the floor."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from dropspin.scenarios.bodies import Body
from dropspin.scenarios.field_types import Number, Positive, Table, Vector
from dropspin.scenarios.recording import Noise
from dropspin.scenarios.state import Array
from dropspin.scenarios.surfaces import Floor
from dropspin.scenarios.text import Text
from dropspin.scenarios.validation import validated

LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254, "foot": 0.3048}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
HALF = np.sqrt(0.5)
UPRIGHT = {
    "x": (0.0, 0.0, HALF, HALF),
    "-x": (0.0, 0.0, -HALF, HALF),
    "y": (0.0, 0.0, 0.0, 1.0),
    "-y": (1.0, 0.0, 0.0, 0.0),
    "z": (-HALF, 0.0, 0.0, HALF),
    "-z": (HALF, 0.0, 0.0, HALF),
}
"""The rotation, a quaternion, that takes the upward axis of a recording to y."""


class Header(Table):
    """The header of a recording.

    Attributes:
        data: The file with the columns, relative to the header's folder.
        topic: The topic to read from an MCAP file that has several.
        body: The body, as in a scene.
        floor: The floor, as in a scene, or None.
        rate: Frames per second [1/s]; required if there is no column `t`.
        up: The upward axis of the recording.
        quaternion: The meaning of the columns qx, qy, qz, qw in the order of the four: `wxyz` if the first of them is the scalar part.
        rotation: The frames between which the quaternions convert vectors, `body-to-world` or `world-to-body`.
        spin_frame: The frame of the columns wx, wy, wz.
        length_unit: The unit of x, y, z.
        time_unit: The unit of t, and of the velocities.
        length_scale: The ratio of recorded lengths to true lengths.
        tracked_point: The point whose position is recorded, in the frame in which the shape is given [m].
        floor_height: The height of the floor in the recording's frame, true length [m].
        gravity: The true acceleration of gravity [m/s²].
        noise: The noise of the measurements; None if it is not known.
    """

    data: Annotated[Text, Field(min_length=1)]
    topic: Text | None = None
    source: Text = ""
    body: Body
    floor: Floor | None = None
    rate: Positive | None = None
    up: Literal["x", "-x", "y", "-y", "z", "-z"] = "y"
    quaternion: Literal["xyzw", "wxyz"] = "xyzw"
    rotation: Literal["body-to-world", "world-to-body"] = "body-to-world"
    spin_frame: Literal["world", "body"] = "world"
    length_unit: Literal["m", "cm", "mm", "inch", "foot"] = "m"
    time_unit: Literal["s", "ms", "us", "ns"] = "s"
    length_scale: Positive = 1.0
    tracked_point: Vector = (0.0, 0.0, 0.0)
    floor_height: Number = 0.0
    gravity: Positive = 9.81
    noise: Noise | None = None

    @property
    def tracked_from_centre(self) -> Array:
        """The tracked point from the centre of mass, in the body frame [m], shape (3,)."""
        return np.asarray(self.tracked_point, dtype=np.float64) - self.body.centre

    @property
    def acceleration(self) -> Array:
        """That of a free fall [m/s²], shape (3,)."""
        return np.array([0.0, -self.gravity, 0.0])

    def corrected(self, keys: Mapping[str, Any]) -> "Header":
        """The header with other values of keys; those of the body begin with `body.`."""
        content = self.model_dump()
        for key, value in keys.items():
            (content["body"] if key.startswith("body.") else content)[key.removeprefix("body.")] = value
        return validated(Header, "corrected header", content)
