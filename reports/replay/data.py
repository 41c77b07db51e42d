"""The data of a replay for the viewer in a page."""

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reports.replay.bodies import outline
from reports.replay.motions import TRUTH, Motion, Replay

Array = NDArray[np.float64]

MOST = 2**31 - 1
COARSE = 1e3
"""Numbers larger than this are given whole: a share of 5e-10 of them might be seen."""


def as_data(replay: Replay) -> dict[str, Any]:
    """What the viewer's program needs of a scene, as JSON; numbers are exact to 5e-7."""
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
        "isTruth": motion.label == TRUTH and not motion.colour,
        "position": _packed(motion.frames.position),
        "orientation": _packed(motion.frames.orientation),
        "turns": motion.turns.tolist() if motion.turns.any() else [],
        "struck": motion.struck.tolist(),
        "impulses": _packed(motion.impulses),
        "points": _packed(motion.points),
    }


def _packed(numbers: Array) -> list[Any]:
    """Numbers, column by column, little-endian, in base 64: as integers of a scale, or whole; a column of one number as this number."""
    return [float(column[0]) if np.ptp(column) == 0.0 else _column(column) for column in numbers.T] if len(numbers) else []


def _column(numbers: Array) -> dict[str, Any]:
    largest = float(np.abs(numbers).max())
    if largest > COARSE:
        return {"data": base64.b64encode(numbers.astype("<f8").tobytes()).decode()}
    scale = max(largest, np.finfo(float).tiny * MOST) / MOST
    return {"scale": scale, "data": base64.b64encode(np.rint(numbers / scale).astype("<i4").tobytes()).decode()}
