"""MuJoCo models of a scene: a free body and one contact pair with each of the scene's floor and walls; or MuJoCo's defaults.

MuJoCo has no coefficient of restitution. A contact is a damped spring with the reference acceleration a_ref = -b v - k r, and its force
only pushes. Two settings give a restitution e:

The damper, over one step: k = 0 and b = (1 + e) / dt turn the normal velocity v into -e v in one step of a one-stage integrator. The
impedance d < 1 leaves an error of (1 - d) g dt. In addition, k = kappa / dt² removes the share kappa of the depth in each step, and adds
up to kappa to e.

The spring, over N steps, with any integrator: its damping leaves the restitution e when its force ends. The force ends where
k r + b v = 0, before the depth r is 0: e = exp(-z c), with the angle c(z) of `_contact_angle` below. (If it ended at r = 0, e would be
exp(-π z / √(1 - z²)); the z of that formula for e = .5 gives .55.) Source: the damped oscillator x'' + 2 z w x' + w² x = 0 from x = 0,
until x'' = 0.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import chain, product
from typing import Any

import mujoco
import numpy as np

from dropspin.comparisons.engines.mapping import bodies_in, box_of, friction_of, principal_frame
from dropspin.comparisons.engines.mujoco_settings import CONTACT
from dropspin.comparisons.engines.settings import calibrated_values
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Box, Capsule, Ellipsoid, Mesh, OnAxis, Sphere, Vertices
from dropspin.scenarios.bodies.inertia import is_diagonal
from dropspin.scenarios.rotations import conjugate, multiply
from dropspin.scenarios.state import Array
from dropspin.scenarios.surfaces import Surface

MOST_DAMPED = 1e3
INTEGRATORS = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
}
FORM = {"body": "geom", "floor": "plane", "beside": "none"}
"""How a scene is written as a model.

The body is a `geom`; a `mesh`, a box as the convex hull of its corners; or a `child`, with mass and shape on a fixed child of the free
body. A body of vertices is always a mesh. The floor is a `plane`; or a `box` or a `mesh`, the convex hull of its corners, whose top is the
floor. A floor that ends is a box in place of a plane. Walls are planes.
"""
UPWARD = [np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0]  # [w, x, y, z]: rotates the plane's normal from z to y


def contact(surface: Surface, dt: float, kappa: float = 0.0, spring_steps: float = 0.0) -> dict[str, Any]:
    """The settings of a contact pair that give the restitution and friction of a floor or a wall.

    Args:
        surface: The floor or the wall.
        dt: Time step [s].
        kappa: The share of the depth that the damper removes in a step.
        spring_steps: N, the steps that a collision takes with the spring; 0 for the damper, with which it takes one.
    """
    coefficient = friction_of(surface, gripping=1e6)
    if spring_steps:
        z = damping_ratio(surface.restitution)
        w = _contact_angle(z) / (spring_steps * dt)
        solref = [-(w**2), -2.0 * z * w]
    else:
        solref = [0.0 - kappa / dt**2, -(1.0 + surface.restitution) / dt]  # 0.0, not -0.0, without a spring
    return {
        "condim": 3 if coefficient else 1,
        "friction": [coefficient, coefficient, 0.0, 0.0, 0.0],
        "solref": solref,
        "solimp": calibrated_values(CONTACT)["solimp"],
        "solreffriction": [0.0, -1.0 / dt],
    }


def damping_ratio(restitution: float) -> float:
    """The damping ratio z of a spring that only pushes and gives a restitution 0 < e <= 1."""
    from scipy.optimize import brentq

    if restitution == 1.0:
        return 0.0
    return float(brentq(lambda z: z * _contact_angle(z) + math.log(restitution), 0.0, MOST_DAMPED, xtol=1e-15, rtol=1e-15))


def _contact_angle(z: float) -> float:
    """The duration of a spring's push times its undamped angular frequency [rad]."""
    if z < 1.0:
        s = math.sqrt(1.0 - z * z)
        return math.atan2(2.0 * z * s, 2.0 * z * z - 1.0) / s
    if z == 1.0:
        return 2.0
    s = math.sqrt(z * z - 1.0)
    return math.log((z + s) / (z - s)) / s


def default_specification(scene: Scenario, dt: float, integrator: str, form: Mapping[str, str]) -> Any:
    """The specification of a user who sets friction on both surfaces and nothing else: MuJoCo has no restitution to set."""
    spec, bodies = _free_bodies(scene, dt, integrator, form)
    if scene.surfaces:
        # With the default's pyramidal cones a coefficient of 1e6 would leave no friction and no contact; torsion and rolling keep theirs.
        # A contact has the larger coefficient of the two geoms, so that the body has the smallest.
        coefficients = [friction_of(surface, gripping=10.0) for surface in scene.surfaces]
        for body in bodies:
            body.add_geom(**_shape(scene, form), friction=[min(coefficients), 0.005, 0.0001])
        for plane, coefficient in zip(_planes(scene, form), coefficients, strict=True):
            spec.worldbody.add_geom(**plane, friction=[coefficient, 0.005, 0.0001])
    return spec


def calibrated_specification(
    scene: Scenario, dt: float, integrator: str, form: Mapping[str, str], pairs: Sequence[Mapping[str, Any]], flags: Mapping[str, str]
) -> Any:
    """The specification of a calibrated simulation.

    Args:
        scene: The scene.
        dt: Time step [s].
        integrator: A key of `INTEGRATORS`.
        form: How the scene is written, as `FORM`.
        pairs: Settings of the contact pair of each of the scene's surfaces; without any, MuJoCo detects neither contacts nor constraints.
        flags: Solver settings that the installed version has, by their names in MJCF.
    """
    spec, bodies = _free_bodies(scene, dt, integrator, form)
    option, disable = spec.option, mujoco.mjtDisableBit
    if not pairs:
        option.disableflags |= disable.mjDSBL_CONTACT | disable.mjDSBL_CONSTRAINT
        return spec
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    if "island" in flags:
        option.disableflags |= disable.mjDSBL_ISLAND
    if "diagexact" in flags:
        option.enableflags = mujoco.mjtEnableBit.mjENBL_DIAGEXACT
    passive = {"contype": 0, "conaffinity": 0}  # the pairs are the only contacts
    for number, plane in enumerate(_planes(scene, form)):
        spec.worldbody.add_geom(name=f"plane {number}", **plane, **passive)
    for number, body in enumerate(bodies):
        body.add_geom(name=f"shape {number}", **_shape(scene, form), **passive)
        for plane_number, pair in enumerate(pairs):
            spec.add_pair(geomname1=f"plane {plane_number}", geomname2=f"shape {number}", **pair)
    return spec


def _free_bodies(scene: Scenario, dt: float, integrator: str, form: Mapping[str, str]) -> tuple[Any, list[Any]]:
    """The specification that all profiles share: step, gravity, integrator, meshes and free bodies; and the bodies that have the masses.

    The automatic reset is off: it would put a simulation that broke down back to its start without notice.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = dt
    spec.option.gravity = scene.acceleration
    spec.option.integrator = INTEGRATORS[integrator]
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
    if scene.floor is not None and _is_mesh(scene, form):
        spec.add_mesh(name="hull", uservert=scene.body.hull.ravel().tolist())
    if scene.floor is not None and form["floor"] == "mesh":
        spec.add_mesh(name="floor", uservert=list(chain(*product(*((-half, half) for half in box_of(scene.floor))))))
    bodies = []
    for one in bodies_in(scene, form["beside"]):
        body = spec.worldbody.add_body()
        body.add_freejoint()
        damped = damped_axes(one)
        if damped is not None:
            body = body.add_body(quat=np.roll(conjugate(damped), 1))
        elif form["body"] == "child":
            body = body.add_body()
        moments, axes = principal_frame(one.body.inertia_tensor)
        if not is_diagonal(one.body.inertia_tensor):
            # A flat body's largest moment is the sum of the others; MuJoCo rejects one that exceeds it by rounding.
            moments[2] = min(moments[2], np.nextafter(moments[0] + moments[1], 0.0))
        body.explicitinertial = True
        body.mass = one.body.mass
        body.ipos = [0.0, 0.0, 0.0]
        body.inertia = moments
        body.iquat = np.roll(axes, 1)
        bodies.append(body)
    return spec, bodies


def damped_axes(scene: Scenario) -> Array | None:
    """The principal axes of a body with damping, a quaternion; None where these are its own axes, or there is no damping.

    MuJoCo damps along the axes of the free body, which then has these, and a child with the mass and the shape at the body's own axes.
    """
    if scene.damping is None or is_diagonal(scene.body.inertia_tensor):
        return None
    return principal_frame(scene.body.inertia_tensor)[1]


def _is_mesh(scene: Scenario, form: Mapping[str, str]) -> bool:
    return form["body"] == "mesh" or isinstance(scene.body, Vertices | Mesh)


def _shape(scene: Scenario, form: Mapping[str, str]) -> dict[str, Any]:
    """The geom of the body."""
    if _is_mesh(scene, form):
        return {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": "hull"}
    body, kinds = scene.body, mujoco.mjtGeom
    at = {"pos": -body.centre} if body.centre.any() else {}
    if isinstance(body, Sphere):
        return {"type": kinds.mjGEOM_SPHERE, "size": [body.radius, 0.0, 0.0], **at}
    if isinstance(body, OnAxis):  # along z
        kind = kinds.mjGEOM_CAPSULE if isinstance(body, Capsule) else kinds.mjGEOM_CYLINDER
        return {"type": kind, "size": [body.radius, body.half_length, 0.0], "quat": UPWARD, **at}
    assert isinstance(body, Box | Ellipsoid)
    return {"type": kinds.mjGEOM_BOX if isinstance(body, Box) else kinds.mjGEOM_ELLIPSOID, "size": body.half_extents, **at}


def _planes(scene: Scenario, form: Mapping[str, str]) -> list[dict[str, Any]]:
    """The geoms of the floor and of the walls."""
    assert scene.floor is not None
    plane = {"type": mujoco.mjtGeom.mjGEOM_PLANE, "size": [0.0, 0.0, 1.0]}
    half = box_of(scene.floor)
    floor = plane | {"quat": UPWARD}
    if form["floor"] == "mesh":
        floor = {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": "floor", "pos": [0.0, -half[1], 0.0]}
    elif form["floor"] == "box" or scene.floor.ends:
        floor = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": half, "pos": [0.0, -half[1], 0.0]}
    to_y = np.roll(UPWARD, -1)
    walls = [plane | {"pos": wall.point, "quat": np.roll(multiply(conjugate(wall.frame), to_y), 1)} for wall in scene.wall or ()]
    return [floor, *walls]
