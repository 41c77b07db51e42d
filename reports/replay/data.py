"""The data of a replay for the viewer in the page."""

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reports.plots.colours import EXACT
from reports.replay.bodies import outline
from reports.replay.motions import Motion, Replay

Array = NDArray[np.float64]

LARGEST_INTEGER = 2**31 - 1
LARGEST_SCALED = 1e3
"""Columns with larger numbers are stored as float64: a relative rounding error of 5e-10 of them might be visible."""


def as_data(replay: Replay) -> dict[str, Any]:
    """The data that the viewer needs, ready for JSON; numbers have an absolute error below 5e-7."""
    shape = outline(replay.scene.body)
    return {
        "scene": replay.scene.name,
        "interval": replay.interval,
        "sight": replay.sight,
        "hasFloor": replay.scene.floor is not None,
        "size": replay.scene.body.size,
        "body": {
            "vertices": shape.vertices.tolist(),
            "faces": shape.faces,
            "radius": shape.radius,
            "isFlat": shape.is_flat,
        },
        "motions": [_motion(motion) for motion in replay.motions],
    }


def _motion(motion: Motion) -> dict[str, Any]:
    return {
        "label": motion.label,
        "colour": motion.colour,
        "count": len(motion.frames),
        "isExact": motion.label == EXACT and not motion.colour,
        "position": _packed(motion.frames.position),
        "orientation": _packed(motion.frames.orientation),
        "turns": motion.turns.tolist() if motion.turns.any() else [],
        "struck": motion.struck.tolist(),
        "impulses": _packed(motion.impulses),
        "points": _packed(motion.points),
    }


def _packed(numbers: Array) -> list[Any]:
    """Columns of numbers, shape (n, k): a constant column as its number, any other in base 64, as scaled int32 or as float64."""
    return [float(column[0]) if np.ptp(column) == 0.0 else _column(column) for column in numbers.T] if len(numbers) else []


def _column(numbers: Array) -> dict[str, Any]:
    largest = float(np.abs(numbers).max())
    if largest > LARGEST_SCALED:
        return {"data": base64.b64encode(numbers.astype("<f8").tobytes()).decode()}
    scale = max(largest, np.finfo(float).tiny * LARGEST_INTEGER) / LARGEST_INTEGER
    return {"scale": scale, "data": base64.b64encode(np.rint(numbers / scale).astype("<i4").tobytes()).decode()}
