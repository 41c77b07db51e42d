"""The output of `dropspin show part.stl`: the properties of a mesh as a rigid body."""

from pathlib import Path

import numpy as np
from pydantic import ValidationError

from dropspin.reports.document import Rows
from dropspin.scenarios.bodies import Mesh
from dropspin.scenarios.bodies.hull import convex_hull
from dropspin.scenarios.bodies.mesh import is_closed
from dropspin.scenarios.bodies.mesh_files import read_mesh
from dropspin.scenarios.errors import DropspinError
from dropspin.scenarios.text import counted
from dropspin.scenarios.validation import first_problem

IN_MILLIMETRES = 5.0  # m, from which on a body is probably not given in metres
CONVEX = 1e-6  # largest part of the volume of a hull that is outside of a convex body, by the rounding of a file in single precision


def mesh_rows(file: str) -> Rows:
    """The size, the mass properties, the hull and the defects of a mesh, as a solid, or as a surface if it is not closed.

    Raises:
        DropspinError: The file is not a mesh, or no body can have this mesh.
    """
    points, faces = read_mesh(Path(file), file)
    closed = is_closed(points, faces)
    inertia = "solid" if closed else "surface"
    try:
        body = Mesh.model_validate({"shape": "mesh", "points": points, "faces": faces, "mass": 1.0, "inertia": inertia})
    except ValidationError as error:
        raise DropspinError(f"{file}: {first_problem(Mesh, error)}") from None
    extents, hull = np.ptp(points, axis=0), convex_hull(points)
    facts = {
        "mesh": file,
        "vertices": counted(len(points), "vertex", "vertices"),
        "faces": counted(len(faces), "triangle"),
        "extents": f"{extents.tolist()} m",
        "closed": "yes" if closed else "no: give inertia = 'surface' or 'vertices', or numbers",
        f"centre ({inertia})": f"{body.centre.tolist()} m",
        f"inertia ({inertia})": f"{body.inertia_tensor.tolist()} m², times the mass",
    }
    if closed:
        facts["volume"] = f"{abs(body.content):g} m³" + (", inside out" if body.content < 0.0 else "")
    if hull is None:
        facts["hull"] = "flat"
    else:
        facts["hull"] = f"{counted(len(hull.vertices), 'corner')}, {hull.volume:g} m³"
        if closed and abs(body.content) < (1.0 - CONVEX) * hull.volume:
            facts["convex"] = "no: the convex hull touches the floor instead"
    if extents.max() > IN_MILLIMETRES:
        facts["remark"] = f"{extents.max():g} m is large: if the file is in millimetres, give scale = 0.001"
    return [{"what": key, "is": value} for key, value in facts.items()]
