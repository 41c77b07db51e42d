"""The geometries of a compiled model of MuJoCo as shapes."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from dropspin.comparisons.diagnosis.geometries import mesh_shape, solid
from dropspin.comparisons.engines.mujoco_model import UPWARD
from dropspin.scenarios.bodies import Shape
from dropspin.scenarios.state import Array

MODELLED = ("sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")
"""The kinds of geometries of bodies."""
ALONG = 1e-3
"""Cosine up to which a direction is along a plane, and not into it."""
STRAIGHT = np.array([0.0, 0.0, 0.0, 1.0])


def kind_of(model: Any, number: int) -> str:
    """The word for the kind of a geometry."""
    return mujoco.mjtGeom(int(model.geom_type[number])).name.removeprefix("mjGEOM_").lower().replace("hfield", "height field")


def listed(model: Any, names: Sequence[str], geoms: Sequence[int], most: int) -> str:
    """The words for geometries, by kind and name, up to a number of them."""
    words = [f"the {kind_of(model, geom)} {names[geom]}" for geom in geoms[:most]]
    return ", ".join(words) + " and others" * (len(geoms) > most)


def shape_of(model: Any, number: int) -> tuple[Shape, Array]:
    """A geometry as a solid of 1 kg, with its orientation in the frame of the geometry."""
    size, name = model.geom_size[number].tolist(), kind_of(model, number)
    if name == "mesh":
        return mesh_shape(*mesh_of(model, number)), STRAIGHT
    if name in ("capsule", "cylinder"):  # along y here
        return solid(name, radius=size[0], half_length=size[1]), np.roll(UPWARD, -1)
    return solid(name, **({"radius": size[0]} if name == "sphere" else {"half_extents": size})), STRAIGHT


def mesh_of(model: Any, geom: int) -> tuple[Array, Any]:
    """The vertices and the triangles of a mesh in the frame of its geometry."""
    mesh = model.geom_dataid[geom]
    first, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    points = model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(float)
    return points, model.mesh_face[face : face + model.mesh_facenum[mesh]].astype(np.int64)


def quaternion(matrix: Array) -> Array:
    """The rotation of a matrix, shape (9,)."""
    found = np.empty(4)
    mujoco.mju_mat2Quat(found, matrix)
    return np.roll(found, -1)


def distance_to(model: Any, data: Any, number: int, point: Array, direction: Array) -> float:
    """The distance from a point to a plane, or to the box around a geometry, in a direction [m]; infinite if it is not there."""
    turn = data.geom_xmat[number].reshape(3, 3)
    start, along = (point - data.geom_xpos[number]) @ turn, direction @ turn
    if model.geom_type[number] == mujoco.mjtGeom.mjGEOM_PLANE:
        return float(-start[2] / along[2]) if along[2] < -ALONG and start[2] >= 0.0 else np.inf
    centre, half = model.geom_aabb[number, :3], model.geom_aabb[number, 3:]
    with np.errstate(divide="ignore", invalid="ignore"):
        faces = (centre + np.array([[-1.0], [1.0]]) * half - start) / along
    first, last = np.nanmax(faces.min(axis=0)), np.nanmin(faces.max(axis=0))
    return float(first) if 0.0 <= first <= last else np.inf
