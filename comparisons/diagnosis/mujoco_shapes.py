"""The geometries of a compiled model of MuJoCo as shapes."""

from typing import Any

import mujoco
import numpy as np

from dropspin.comparisons.diagnosis.parts import mesh_shape, solid
from dropspin.comparisons.engines.mujoco_model import UPWARD
from dropspin.scenarios.bodies import Shape
from dropspin.scenarios.state import Array

MODELLED = [getattr(mujoco.mjtGeom, f"mjGEOM_{kind}") for kind in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX", "MESH")]
"""The kinds of geometries of bodies."""
STRAIGHT = np.array([0.0, 0.0, 0.0, 1.0])


def kind_of(model: Any, number: int) -> str:
    """The word for the kind of a geometry."""
    return mujoco.mjtGeom(int(model.geom_type[number])).name.removeprefix("mjGEOM_").lower().replace("hfield", "height field")


def shape_of(model: Any, number: int) -> tuple[Shape, Array, Array]:
    """A geometry as a solid of 1 kg, with its centre [m] and its orientation in the frame of the geometry."""
    size, name = model.geom_size[number].tolist(), kind_of(model, number)
    if name == "mesh":
        shape = mesh_shape(*mesh_of(model, number))
        return shape, shape.centre, STRAIGHT
    if name in ("capsule", "cylinder"):  # along y here
        return solid(name, radius=size[0], half_length=size[1]), np.zeros(3), np.roll(UPWARD, -1)
    return solid(name, **({"radius": size[0]} if name == "sphere" else {"half_extents": size})), np.zeros(3), STRAIGHT


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
