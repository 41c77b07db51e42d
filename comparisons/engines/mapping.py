"""What adapters share: names of discretisations, refusals of what only some engines have, and quantities of scenes as engines take them."""

from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from dropspin.comparisons.engines.base import Array, AsBuilt
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies.inertia import is_diagonal, principal_axes
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.surfaces import Floor, Surface
from dropspin.scenarios.variations import heavy_neighbour

PROFILES = ("calibrated", "default")
"""Settings that reproduce the scene as closely as the engine can; and the engine's defaults, with only the obvious settings made."""
BESIDE = ("none", "heavy")
"""What is beside the body: nothing, or a second body far away."""
FLOOR_HALF_SIZE = 1e3
"""Of a floor that is a box or a mesh [m]: thick enough that nothing tunnels, and engines in double precision lose no digits with it."""
SQUARE = [[x, 0.0, z] for x, z in product((-FLOOR_HALF_SIZE, FLOOR_HALF_SIZE), repeat=2)]
TRIANGLES = [[0, 1, 2], [2, 1, 3]]
"""The floor as a mesh: the corners of a square, and two triangles of them with upward normals."""
LATE_IMPACTS = "impacts detected late"
SEMI_IMPLICIT_EULER = "semi-implicit Euler"
EXPLICIT_GYROSCOPIC = "semi-implicit Euler with the gyroscopic term explicit"
IMPLICIT_GYROSCOPIC = "semi-implicit Euler with the gyroscopic term implicit"
MIDPOINT_GYROSCOPIC = "semi-implicit Euler with rotations by the implicit midpoint rule"


def _has_equal_moments(scene: Scenario) -> bool:
    moments = np.linalg.eigvalsh(scene.body.inertia_tensor)
    return bool(np.ptp(moments) <= 1e-12 * moments[-1])


def may_tumble(scene: Scenario) -> bool:
    """Whether a body of unequal moments of inertia spins at the start, or may after an impact; only then do gyroscopic terms matter."""
    return not _has_equal_moments(scene) and (any(scene.start.angular_velocity) or scene.floor is not None)


def refusal_of_hull(scene: Scenario, name: str) -> str | None:
    """Why a scene's body is not represented by its corners, which an engine calls `name`; None if it can be."""
    if scene.floor is None:
        return f"there is no shape without a floor, and no {name}"
    return f"a {name} would only approximate a {scene.body.shape}" if scene.body.semi_axes.any() else None


def refusal_of_damped_axes(scene: Scenario) -> str | None:
    """Why the products of inertia of a scene's body are in the way of its damping; None if there are none, or no damping."""
    if scene.damping is None or is_diagonal(scene.body.inertia_tensor):
        return None
    return "the adapter damps along the body's own axes only; these are not principal axes"


def refusal_of_unequal_damping(scene: Scenario) -> str | None:
    """Why a scene is declined by an adapter that sets one coefficient of angular damping; None for equal moments of inertia."""
    if scene.damping is None or scene.damping.angular == 0.0 or _has_equal_moments(scene):
        return None
    return "the adapter damps rotation about all axes with one coefficient; angular damping needs a body of equal moments of inertia"


def refusal_of_rest_speed(scene: Scenario, engine: str, instead: str = "") -> str | None:
    """Why an engine without a setting for it declines a rest speed; None for a floor that has none.

    Args:
        scene: The scene.
        engine: The engine's name.
        instead: What the engine always does.
    """
    if not any(surface.rest_speed for surface in scene.surfaces):
        return None
    return f"{engine} has no setting for the speed below which restitution is 0 (floor.rest_speed){instead and f'; {instead}'}"


def refusal_of_floor(scene: Scenario, kind: str) -> str | None:
    """Why a floor is too small for a scene; None for a plane, and if the body stays within `FLOOR_HALF_SIZE` of the origin.

    Args:
        scene: The scene.
        kind: What represents the floor, such as `plane` or `box`.
    """
    if scene.floor is not None and scene.floor.half_extents is not None:
        return None
    travel = np.linalg.norm(scene.start.position) + np.linalg.norm(scene.start.velocity) * scene.duration + scene.body.size
    if scene.floor is None or (kind == "plane" and not scene.floor.ends) or travel <= FLOOR_HALF_SIZE:
        return None
    return f"the floor is a {kind} of {2 * FLOOR_HALF_SIZE:g} m, and the body may leave it"


def box_of(floor: Floor) -> list[float]:
    """Half extents along x, y and z [m] of the box that a floor is, or that stands for one without an end; its top is the floor."""
    x, z = floor.half_extents or (FLOOR_HALF_SIZE, FLOOR_HALF_SIZE)
    return [x, FLOOR_HALF_SIZE if floor.thickness is None else 0.5 * floor.thickness, z]


def refusal_of_neighbour(scene: Scenario, beside: str) -> str | None:
    """Why a second body is not put beside that of a scene; None if it can be."""
    return "the second body may be behind a wall, or beyond the end of the floor" if beside != "none" and scene.has_edges_or_walls else None


def friction_of(surface: Surface, gripping: float) -> float:
    """The coefficient of friction of a floor or a wall; `gripping` stands for one on which contacts do not slip."""
    return gripping if surface.friction == "infinite" else surface.coefficient


def decay_rates(scene: Scenario) -> dict[str, float]:
    """The decay rates of the `linear` and the `angular` velocity [1/s], 0 without damping."""
    return scene.damping.rates if scene.damping else {"linear": 0.0, "angular": 0.0}


def bodies_in(scene: Scenario, beside: str) -> list[Scenario]:
    """The scene, and the one of the heavy body far away if it is beside."""
    return [scene] if beside == "none" else [scene, heavy_neighbour(scene)]


def principal_frame(inertia: Array) -> tuple[Array, Array]:
    """Principal moments and the quaternion [x, y, z, w] of their axes, the identity for a diagonal tensor."""
    moments, axes = principal_axes(inertia)
    if is_diagonal(inertia):
        return moments, np.array([0.0, 0.0, 0.0, 1.0])
    from scipy.spatial.transform import Rotation

    return moments, Rotation.from_matrix(axes).as_quat()


def built(mass: float, moments: ArrayLike, axes: ArrayLike, gravity: ArrayLike) -> AsBuilt:
    """What an engine built, of its mass, principal moments, the quaternion [x, y, z, w] of their axes, and gravity."""
    quaternion = np.array(axes, dtype=float)
    frame = rotate(quaternion / np.linalg.norm(quaternion), np.eye(3))
    return AsBuilt(float(mass), frame.T @ np.diag(np.array(moments, dtype=float)) @ frame, np.array(gravity, dtype=float))
