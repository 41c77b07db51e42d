"""The data of a replay for the viewer of the page, rounded to what is visible so that the page is small."""

import base64
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dropspin.reports.plots.colours import human_label
from dropspin.reports.replay.motions import Motion, Replay, axis_and_angle
from dropspin.scenarios import Scenario
from dropspin.scenarios.rotations import about, unrotate
from dropspin.scenarios.state import Array

LEVELS = 2**16 - 1
POSITION_ERROR = 1e-3
"""Largest rounding error of a coordinate, relative to the size of the body: 0.2 pixels if the body fills a view of 448 pixels."""
ATTITUDE_ERROR = 5e-5
"""Largest rounding error of a component of the rotation vector [rad]: 0.01 pixels at the surface of a body that fills such a view."""
DIGITS = 5
"""Significant digits of impulses and of the points where they act."""


def as_data(replay: Replay) -> dict[str, Any]:
    """The data that the viewer needs, ready for JSON."""
    shape = replay.scene.body.outline
    return {
        "scene": replay.scene.name,
        "dt": replay.dt,
        "interval": replay.interval,
        "sight": replay.sight,
        "planes": _planes(replay.scene),
        "size": replay.scene.body.size,
        "spin": replay.spin,
        "body": {
            "vertices": shape.vertices.tolist(),
            "faces": shape.faces,
            "radius": shape.radius,
            "isFlat": shape.is_flat,
        },
        "motions": [_motion(motion, replay.interval, POSITION_ERROR * replay.scene.body.size) for motion in replay.motions],
    }


def _planes(scene: Scenario) -> list[dict[str, Any]]:
    """The floor and the walls: a point, two unit vectors along the plane, and how far it extends along them, null without an end."""
    if scene.floor is None:
        return []
    ends = scene.floor.half_extents
    planes: list[dict[str, Any]] = [{"point": [0, 0, 0], "along": [[1, 0, 0], [0, 0, 1]], "ends": ends}]
    for wall in scene.wall or ():
        along = unrotate(wall.frame, np.eye(3)[[0, 2]])
        planes.append({"point": wall.point, "along": along.round(9).tolist(), "ends": None})
    return planes


def _motion(motion: Motion, interval: float, tolerance: float) -> dict[str, Any]:
    frames, impacts = motion.frames, motion.impacts
    at_stride = np.abs(frames.t / interval - np.rint(frames.t / interval)) < 1e-6
    axes, angles = axis_and_angle(frames.orientation)
    rotations = [quantised(column, ATTITUDE_ERROR) for column in (axes * angles[:, None]).T]
    # The viewer counts turns from the rounded orientations: near half a turn, these may be on the other side of it.
    turns = replace(motion, frames=replace(frames, orientation=_orientations(np.array([shown for _, shown in rotations]).T))).turns
    return {
        "label": motion.label,
        "name": human_label(motion.label),
        "colour": motion.colour,
        "isExact": not motion.colour,
        "count": int(at_stride.sum()),
        "between": frames.t[~at_stride].round(9).tolist(),
        "position": [quantised(column, tolerance)[0] for column in frames.position.T],
        "rotation": [packed for packed, _ in rotations],
        "turns": turns.tolist() if turns.any() else [],
        "errors": [] if motion.errors is None else [_halved(column) for column in motion.errors.T],
        "impacts": [
            {"time": round(float(time), 9), "impulse": _shortened(impulse), "point": _shortened(point)}
            for time, impulse, point in zip(impacts.times, impacts.impulses, impacts.points, strict=True)
        ],
    }


def quantised(numbers: Array, tolerance: float) -> tuple[float | dict[str, Any], Array]:
    """A column of numbers for JSON, and the numbers that the viewer decodes from it, both of shape (n,).

    If all numbers are equal, a single number is stored. Other numbers are stored as 16-bit integers that span the range of the values if
    the rounding error, half a level, is within the tolerance, otherwise as 32-bit floats, which are needed for a body that flies far.
    """
    low, high = float(numbers.min()), float(numbers.max())
    if low == high:
        return low, np.full_like(numbers, low)
    step = (high - low) / LEVELS
    if step <= 2.0 * tolerance:
        levels = np.rint((numbers - low) / step).astype("<u2")
        return {"low": low, "step": step, "data": _base64(levels)}, low + step * levels
    largest = float(np.finfo(np.float32).max)
    floats = np.clip(numbers, -largest, largest).astype("<f4")
    return {"data": _base64(floats)}, floats.astype(np.float64)


def _orientations(rotations: Array) -> Array:
    """Quaternions, shape (n, 4), of rotation vectors [rad], shape (n, 3)."""
    angles = np.linalg.norm(rotations, axis=1)
    return about(rotations / np.maximum(angles, np.finfo(float).tiny)[:, None], angles)


def _halved(numbers: Array) -> str:
    """The upper halves of 32-bit floats, rounded: a relative error of 0.2 % for values of which two digits are shown."""
    bits = np.minimum(numbers, 1e38).astype("<f4").view("<u4") + np.uint32(2**15)
    return _base64((bits >> np.uint32(16)).astype("<u2"))


def _shortened(vector: Array) -> list[float]:
    return [float(f"{number:.{DIGITS}g}") for number in vector]


def _base64(numbers: NDArray[Any]) -> str:
    return base64.b64encode(numbers.tobytes()).decode()
