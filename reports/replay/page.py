"""A replay as a page of its own, and as the data of a viewer in any page."""

import base64
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from reports.replay.bodies import outline
from reports.replay.motions import TRUTH, Motion, Replay

Array = NDArray[np.float64]

MOST = 2**31 - 1


def as_data(replay: Replay) -> dict[str, Any]:
    """What the viewer's program needs of a scene, as JSON: arrays are 32-bit integers times a scale, exact to 3e-10 of their largest."""
    shape = outline(replay.scene.body)
    return {
        "scene": replay.scene.name,
        "duration": replay.scene.duration,
        "interval": replay.interval,
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
        "struck": motion.struck.tolist(),
        "impulses": _packed(motion.impulses),
        "points": _packed(motion.points),
    }


def _packed(numbers: Array) -> list[Any]:
    """Numbers, column by column: as integers of a scale, little-endian, in base 64; a column of one number as this number."""
    return [float(column[0]) if np.ptp(column) == 0.0 else _column(column) for column in numbers.T] if len(numbers) else []


def _column(numbers: Array) -> dict[str, Any]:
    scale = max(float(np.abs(numbers).max()), np.finfo(float).tiny * MOST) / MOST
    return {"scale": scale, "data": base64.b64encode(np.rint(numbers / scale).astype("<i4").tobytes()).decode()}


def replay_page(replays: list[Replay], plots: dict[str, str]) -> str:
    """A page of viewers and nothing else but the plots over time that they move along.

    Args:
        replays: The scenes.
        plots: By scene: its SVG element.
    """
    from reports.html import page

    return page("replay.html", replays=[(replay, as_data(replay), Markup(plots[replay.scene.name])) for replay in replays])
