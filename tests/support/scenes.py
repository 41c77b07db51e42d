"""Scenes made for tests."""

import math

import numpy as np

from scenarios import load


def standing(half=(0.2, 0.5), lean=-0.2, speed=0.0, friction="infinite", heading=0.3, axes=(0, 1, 2), sideways=(0.0, 0.0), **more):
    """A box on an edge, ψ = |lean| from the vertical; a positive lean falls back on the face below it, a negative one over the edge.

    `half` across the edge: width and height of the face below at lean = atan(width/height). `axes` says which of the body's axes is width,
    height and edge, `heading` which way the edge looks, `speed` is ψ'.
    """
    from scipy.spatial.transform import Rotation

    a, h = half
    turned = math.atan2(a, h) - lean  # from lying flat, about the edge at +x
    edge = Rotation.from_euler("y", heading) * Rotation.from_euler("z", -turned)
    permutation = np.zeros((3, 3))
    for world, body in enumerate(axes):
        permutation[world, body] = 1.0
    permutation[2] *= np.linalg.det(permutation)
    half_extents = np.empty(3)
    half_extents[list(axes)] = a, h, 0.3
    to_centre = edge.apply([-a, h, 0.0])
    spin = math.copysign(speed, speed * lean) * edge.apply([0.0, 0.0, 1.0]) if speed else np.zeros(3)
    velocity = np.cross(spin, to_centre)
    if friction == "none":
        velocity[[0, 2]] = sideways
    return load(
        {
            "name": "standing",
            "duration": 3.0,
            "body": {"shape": "box", "half_extents": half_extents.tolist(), "mass": 2.0, "inertia": "vertices"},
            "start": {
                "position": (to_centre + np.array([0.7, 0.0, -0.4])).tolist(),
                "orientation": (edge * Rotation.from_matrix(permutation)).as_quat().tolist(),
                "velocity": velocity.tolist(),
                "angular_velocity": spin.tolist(),
            },
            "gravity": {"acceleration": [0.0, -9.8, 0.0]},
            "floor": {"restitution": 0.0, "friction": friction},
        }
        | more
    )
