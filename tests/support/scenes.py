"""Scenes made for tests."""

import math

import numpy as np

from dropspin.scenarios import load
from dropspin.scenarios.rotations import about, multiply, rotate

UP, AXIS = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
G = 9.8


def with_few_members(name):
    """A scene of the catalogue; an ensemble has 20 members, because a hundred take a quarter of the time of a run of the core catalogue."""
    scene = load(name)
    few = {"ensemble": scene.ensemble and scene.ensemble.model_copy(update={"size": 20})}
    return scene.model_copy(update=few)


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


def regular(n, radius=0.2):
    """The corners of a regular polygon, counterclockwise from the lowest."""
    return [[radius * math.sin(2 * math.pi * k / n), -radius * math.cos(2 * math.pi * k / n)] for k in range(n)]


def prism(corners, speed=0.0, slope=0.0, lean=0.0, masses=None, heading=0.0, half=0.1, **more):
    """A prism on the edge of its first corner, rotated forward by `lean`. Forward is +x turned by the heading, downhill if slope > 0."""
    masses = [1.0] * len(corners) if masses is None else masses
    corners = np.array(corners) - np.average(corners, axis=0, weights=masses)
    points = [[*corner, z] for corner in corners.tolist() for z in (-half, half)]
    turn = multiply(about(UP, np.array(heading)), about(AXIS, np.array(-lean)))
    to_centre = rotate(turn, np.array([*-corners[0], 0.0]))
    spin = rotate(about(UP, np.array(heading)), -speed * AXIS)
    gravity = rotate(about(UP, np.array(heading)), G * np.array([math.sin(slope), -math.cos(slope), 0.0]))
    return load(
        {
            "name": "prism",
            "duration": 2.0,
            "body": {"shape": "vertices", "points": points, "masses": [0.5 * m for m in masses for _ in range(2)]},
            "start": {
                "position": (to_centre + np.array([0.7, 0.0, -0.4])).tolist(),
                "orientation": turn.tolist(),
                "velocity": np.cross(spin, to_centre).tolist(),
                "angular_velocity": spin.tolist(),
            },
            "gravity": {"acceleration": gravity.tolist()},
            "floor": {"restitution": 0.0, "friction": "infinite"},
        }
        | more
    )


def on_one_point(body, orientation, spin=(0.0, 0.0, 0.0), friction="infinite", duration=1.0, gravity=(0.0, -G, 0.0), slip=(0.0, 0.0, 0.0)):
    """A body that touches the floor at its lowest point, which moves with the velocity `slip`."""
    tables = {"duration": duration, "body": body, "gravity": {"acceleration": list(gravity)}}
    arm = load(tables).body.lowest(np.array(orientation), 1e-12).mean(axis=0)
    start = {
        "position": [0.3, -arm[1], -0.2],
        "orientation": list(orientation),
        "velocity": (np.array(slip) - np.cross(spin, arm)).tolist(),
        "angular_velocity": list(spin),
    }
    return load(tables | {"start": start, "floor": {"restitution": 0.0, "friction": friction}})


def rolling_disc(angle, precession=None, half_length=0.02, centre=0.0, nutation=0.0, radius=0.1, **more):
    """A cylinder on its rim in steady rolling, with its axis at an angle to the vertical; without a precession, its centre is at rest.

    From the torque about the centre of mass, which is `centre` above the middle of the axis.

    Returns:
        The scene, the precession and the spin about the axis [rad/s].
    """
    mass, d, sine, cosine = 2.0, half_length + centre, math.sin(angle), math.cos(angle)
    along, across = 0.5 * mass * radius**2, mass * (0.25 * radius**2 + half_length**2 / 3.0)
    height, lever = radius * sine + d * cosine, radius * cosine - d * sine
    if precession is None:
        precession = math.sqrt(mass * G * lever / (sine * (across * cosine - along * d * sine / radius)))
        spin = precession * d * sine / radius
    else:
        torque = precession**2 * sine * (across * cosine + mass * height * d) - mass * G * lever
        spin = torque / (precession * (along * sine + mass * height * radius))
    axis, downhill = np.array([sine, cosine, 0.0]), np.array([cosine, -sine, 0.0])
    omega = spin * axis - precession * sine * downhill + nutation * np.cross(axis, downhill)
    body = {"shape": "cylinder", "radius": radius, "half_length": half_length, "mass": mass, "inertia": [across, along, across]}
    body |= {"center_of_mass": [0.0, centre, 0.0]}
    return on_one_point(body, about(-AXIS, np.array(angle)), omega.tolist(), **more), precession, spin
