"""Reading of meshes from OBJ and STL files: positions and triangles alone; no other file is opened."""

import io
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios.errors import DropspinError
from dropspin.scenarios.files import read_file
from dropspin.scenarios.state import Array

Faces = NDArray[np.int64]

LARGEST_FILE = 200_000_000  # bytes
MOST_VERTICES = 200_000
IGNORED = {"vt", "vn", "vp", "o", "g", "s", "usemtl", "mtllib", "l", "p", "lod", "bevel", "c_interp", "d_interp"}
"""Statements of an OBJ file that do not change its surface: texture, normals, names, groups, materials, lines and points."""


def read_mesh(path: Path, name: str) -> tuple[Array, Faces]:
    """The vertices and the triangles of a mesh.

    The vertices of an OBJ file are those of the file, in its order; those of an STL file, which repeats them in each triangle, are merged
    where they are equal bit for bit, in the order of their first use.

    Args:
        path: The file.
        name: The path as the user gave it, for messages.

    Returns:
        Vertices, shape (n, 3), and indices of the corners of triangles, shape (m, 3).

    Raises:
        DropspinError: The file is neither, or it is damaged, or it has no triangles, or too many vertices.
    """
    kinds = {".obj": _obj, ".stl": _stl}
    if path.suffix.lower() not in kinds:
        raise DropspinError(f"{name}: a mesh is a file .obj or .stl.")
    raw = read_file(path, name, "mesh", LARGEST_FILE)
    try:
        points, faces = kinds[path.suffix.lower()](raw)
    except (ValueError, IndexError) as error:
        raise DropspinError(f"{name}: not a mesh in the format of its ending: {error}.") from None
    if not len(faces):
        raise DropspinError(f"{name}: has no faces.")
    if len(points) > MOST_VERTICES:
        raise DropspinError(f"{name}: has {len(points):,} vertices; at most {MOST_VERTICES:,} are allowed.")
    if not np.isfinite(points).all():
        raise DropspinError(f"{name}: has a vertex that is not finite.")
    if faces.min() < 0 or faces.max() >= len(points):
        raise DropspinError(f"{name}: has a face with a vertex that does not exist; there are {len(points):,}.")
    return points, faces


def _obj(raw: bytes) -> tuple[Array, Faces]:
    points: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for number, line in enumerate(raw.decode("utf-8-sig", "replace").replace("\\\n", " ").splitlines(), 1):
        word, *values = line.partition("#")[0].split() or [""]
        if word == "v":
            if len(values) < 3:
                raise ValueError(f"line {number} has a vertex of {len(values)} numbers")
            points.append([float(value) for value in values[:3]])
        elif word == "f":
            corners = [int(value.partition("/")[0]) for value in values]
            if len(corners) < 3 or 0 in corners:
                raise ValueError(f"line {number} is no face")
            first, *rest = (corner - 1 if corner > 0 else len(points) + corner for corner in corners)
            faces += [(first, *pair) for pair in pairwise(rest)]  # a fan
        elif word and word not in IGNORED:
            raise ValueError(f"line {number}: the statement {word[:20]!r} is not read")
    return np.array(points, dtype=float).reshape(-1, 3), np.array(faces, dtype=np.int64).reshape(-1, 3)


def _stl(raw: bytes) -> tuple[Array, Faces]:
    from trimesh.exchange.stl import HeaderError, load_stl_ascii, load_stl_binary

    try:
        content = load_stl_binary(io.BytesIO(raw))  # by its length: the header of a binary file may begin with "solid"
    except HeaderError:
        if not re.match(rb"\s*solid", raw):
            raise ValueError("a binary file of another length than its header says, or no STL") from None
        content = load_stl_ascii(io.BytesIO(raw))
    solids = content["geometry"].values() if "geometry" in content else [content]
    corners = np.concatenate([np.empty((0, 3)), *(np.asarray(solid["vertices"], dtype=float) for solid in solids)])
    points, first, which = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    return points[order], np.argsort(order)[which].reshape(-1, 3)
