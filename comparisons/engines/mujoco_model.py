"""MuJoCo models of a scene: a free body and, where the scene has a floor, one contact pair with it; or MuJoCo's defaults."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain, product
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.engines.base import FLOOR_HALF_SIZE
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Box, Sphere, Vertices
from dropspin.scenarios.bodies.inertia import is_diagonal, principal_axes
from dropspin.scenarios.variations import heavy_neighbour

Array = NDArray[np.float64]

DEFAULT_INFINITE_FRICTION = 10.0
"""In the default profile; with the default's pyramidal cones a coefficient of 1e6 would leave no friction and no contact."""
INTEGRATORS = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
}
FLOOR_QUATERNION = [np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0]  # [w, x, y, z]: rotates the plane's normal from z to y


@dataclass(frozen=True)
class Form:
    """How a scene is written as a model.

    Attributes:
        integrator: A key of `INTEGRATORS`.
        body: `geom`; `mesh`, a box as the convex hull of its corners; or `child`, with mass and shape on a fixed child of the free
            body. A body of vertices is always a mesh.
        floor: `plane`; or `box` or `mesh`, the convex hull of its corners, whose top is the floor.
        beside: `none`, or `heavy`, a second body far away.
    """

    integrator: str
    body: str = "geom"
    floor: str = "plane"
    beside: str = "none"


def default_specification(scene: Scenario, dt: float, form: Form) -> Any:
    """The specification of a user who sets friction on both surfaces and nothing else: MuJoCo has no restitution to set."""
    spec, bodies = _free_bodies(scene, dt, form)
    if scene.floor is not None:
        known = {"none": 0.0, "infinite": DEFAULT_INFINITE_FRICTION}
        friction = known[scene.floor.friction] if isinstance(scene.floor.friction, str) else scene.floor.friction
        surface = {"friction": [friction, 0.005, 0.0001]}  # sliding; torsion and rolling keep their defaults
        for body in bodies:
            _add_shape(body, scene, form, **surface)
        spec.worldbody.add_geom(**_floor(form), **surface)
    return spec


def calibrated_specification(scene: Scenario, dt: float, form: Form, pair: Mapping[str, Any], flags: Mapping[str, str]) -> Any:
    """The specification of a calibrated simulation.

    Args:
        scene: The scene.
        dt: Time step [s].
        form: How the scene is written.
        pair: Settings of the contact pair; without any, MuJoCo detects neither contacts nor constraints.
        flags: Solver settings that the installed version has, by their names in MJCF.
    """
    spec, bodies = _free_bodies(scene, dt, form)
    option, disable = spec.option, mujoco.mjtDisableBit
    if not pair:
        option.disableflags |= disable.mjDSBL_CONTACT | disable.mjDSBL_CONSTRAINT
        return spec
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    if "island" in flags:
        option.disableflags |= disable.mjDSBL_ISLAND
    if "diagexact" in flags:
        option.enableflags = mujoco.mjtEnableBit.mjENBL_DIAGEXACT
    passive = {"contype": 0, "conaffinity": 0}  # the pairs are the only contacts
    spec.worldbody.add_geom(name="floor", **_floor(form), **passive)
    for number, body in enumerate(bodies):
        _add_shape(body, scene, form, name=f"shape {number}", **passive)
        spec.add_pair(geomname1="floor", geomname2=f"shape {number}", **pair)
    return spec


def _free_bodies(scene: Scenario, dt: float, form: Form) -> tuple[Any, list[Any]]:
    """The specification that all profiles share: step, gravity, integrator, meshes and free bodies; and the bodies that have the masses.

    The automatic reset is off: it would put a simulation that broke down back to its start without notice.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = dt
    spec.option.gravity = scene.acceleration
    spec.option.integrator = INTEGRATORS[form.integrator]
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
    if scene.floor is not None and _is_mesh(scene, form):
        spec.add_mesh(name="hull", uservert=scene.body.hull.ravel().tolist())
    if scene.floor is not None and form.floor == "mesh":
        spec.add_mesh(name="floor", uservert=list(chain(*product((-FLOOR_HALF_SIZE, FLOOR_HALF_SIZE), repeat=3))))
    bodies = []
    for one in [scene] if form.beside == "none" else [scene, heavy_neighbour(scene)]:
        body = spec.worldbody.add_body()
        body.add_freejoint()
        if form.body == "child":
            body = body.add_body()
        body.explicitinertial = True
        body.mass = one.body.mass
        body.ipos = [0.0, 0.0, 0.0]
        body.inertia, body.iquat = _principal(one.body.inertia_tensor)
        bodies.append(body)
    return spec, bodies


def _principal(inertia: Array) -> tuple[Array, Array]:
    """Principal moments and the quaternion [w, x, y, z] of their axes; the identity where the tensor is diagonal."""
    if is_diagonal(inertia):
        return np.diag(inertia), np.array([1.0, 0.0, 0.0, 0.0])
    from scipy.spatial.transform import Rotation

    moments, axes = principal_axes(inertia)
    # A flat body's largest moment is the sum of the others; MuJoCo rejects one that exceeds it by rounding.
    moments[2] = min(moments[2], np.nextafter(moments[0] + moments[1], 0.0))
    return moments, Rotation.from_matrix(axes).as_quat(scalar_first=True)


def _floor(form: Form) -> dict[str, Any]:
    """The geom of the floor."""
    if form.floor == "box":
        return {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": [FLOOR_HALF_SIZE] * 3, "pos": [0.0, -FLOOR_HALF_SIZE, 0.0]}
    if form.floor == "mesh":
        return {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": "floor", "pos": [0.0, -FLOOR_HALF_SIZE, 0.0]}
    return {"type": mujoco.mjtGeom.mjGEOM_PLANE, "size": [0.0, 0.0, 1.0], "quat": FLOOR_QUATERNION}


def _is_mesh(scene: Scenario, form: Form) -> bool:
    return form.body == "mesh" or isinstance(scene.body, Vertices)


def _add_shape(body: Any, scene: Scenario, form: Form, **properties: Any) -> None:
    if _is_mesh(scene, form):
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="hull", **properties)
    elif isinstance(scene.body, Sphere):
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[scene.body.radius, 0.0, 0.0], **properties)
    elif isinstance(scene.body, Box):
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=scene.body.half_extents, **properties)
