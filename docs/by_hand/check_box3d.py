"""Findings about Box3D alone: `pip install robox3d scipy`, then `python docs/by_hand/check_box3d.py`.

Bodies have 1 kg, y is up, and a step is 1 ms with 4 substeps.
"""

import numpy as np
from robox3d._ffi import ffi, lib
from scipy.spatial.transform import Rotation

G, DT, SUBSTEPS = 9.8, 1e-3, 4
BALL = np.full(3, 0.004)  # kg m²; of a ball of 0.1 m


def motion(inertia, steps, position, turn=(0.0, 0.0, 0.0, 1.0), velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0), half=None, **settings):
    """Position, quaternion [x, y, z, w], velocity and spin after each step, shape (n + 1, 13); without `half` a ball of 0.1 m.

    `settings` are `gravity`, `e`, `friction` and `threshold` of restitution, and `recycle` and `fast` of the body.
    """
    given = {"gravity": 0.0, "e": 0.0, "friction": 0.0, "threshold": 0.0, "recycle": False, "fast": True} | settings
    world, moving, fixed, shape = lib.b3DefaultWorldDef(), lib.b3DefaultBodyDef(), lib.b3DefaultBodyDef(), lib.b3DefaultShapeDef()
    world.gravity, world.restitutionThreshold = (0.0, -given["gravity"], 0.0), given["threshold"]
    made = lib.b3CreateWorld(ffi.addressof(world))
    shape.baseMaterial.friction, shape.baseMaterial.restitution = given["friction"], given["e"]
    fixed.position = (0.0, -100.0, 0.0)
    ground = lib.b3MakeBoxHull(100.0, 100.0, 100.0)
    lib.b3CreateHullShape(lib.b3CreateBody(made, ffi.addressof(fixed)), ffi.addressof(shape), ffi.addressof(ground, "base"))
    moving.type, moving.position, moving.rotation = lib.b3_dynamicBody, tuple(position), {"v": tuple(turn[:3]), "s": turn[3]}
    moving.linearVelocity, moving.angularVelocity, moving.enableSleep = tuple(velocity), tuple(spin), False
    moving.allowFastRotation, moving.enableContactRecycling = given["fast"], given["recycle"]
    body = lib.b3CreateBody(made, ffi.addressof(moving))
    if half is None:
        lib.b3CreateSphereShape(body, ffi.addressof(shape), ffi.new("b3Sphere*", {"radius": 0.1}))
    else:
        hull = lib.b3MakeBoxHull(*half)
        lib.b3CreateHullShape(body, ffi.addressof(shape), ffi.addressof(hull, "base"))
    columns = dict(zip(("cx", "cy", "cz"), map(tuple, np.diag(inertia)), strict=True))
    lib.b3Body_SetMassData(body, {"mass": 1.0, "center": (0.0, 0.0, 0.0), "inertia": columns})
    rows = []
    for _ in range(steps + 1):
        x, q = lib.b3Body_GetPosition(body), lib.b3Body_GetRotation(body)
        v, w = lib.b3Body_GetLinearVelocity(body), lib.b3Body_GetAngularVelocity(body)
        rows.append([x.x, x.y, x.z, q.v.x, q.v.y, q.v.z, q.s, v.x, v.y, v.z, w.x, w.y, w.z])
        lib.b3World_Step(made, DT, SUBSTEPS)
    lib.b3DestroyWorld(made)
    return np.array(rows)


def box(x, y, z):
    """The moments of inertia of a box of these half extents."""
    return np.array([y * y + z * z, x * x + z * z, x * x + y * y]) / 3.0


def line(what, measured, expected):
    """Print a finding."""
    print(f"{what}: measured {measured}, exact {expected}", flush=True)


def rebound():
    """A ball lands at 0.9 m/s without gravity, and a box with two edges or flat."""
    for threshold in (0.0, 1.0):
        v = motion(BALL, 200, [0.0, 0.15, 0.0], velocity=[0.0, -0.9, 0.0], e=0.5, threshold=threshold)[-1, 8]
        line(f"Ball of restitution 0.5 at 0.9 m/s, threshold {threshold} m/s", f"{v / 0.9:.4f}", 0.5)
    half = (0.1, 0.15, 0.25)
    for name, turn in (("flat", [0.0, 0.0, 0.0, 1.0]), ("on an edge", Rotation.from_euler("z", 0.4).as_quat())):
        s = motion(box(*half), 300, [0.0, 0.4, 0.0], turn, [0.0, -2.0, 0.0], half=half, e=0.6)
        arms = Rotation.from_quat(turn).apply([[x, y, z] for x in (-0.1, 0.1) for y in (-0.15, 0.15) for z in (-0.25, 0.25)])
        arm = arms[arms[:, 1].argmin()]
        after = s[-1, 8] + np.cross(s[-1, 10:], [arm[0], arm[1], 0.0])[1]
        line(
            f"Box of restitution 0.6 that lands {name}: speed of its corners, and spin about x",
            f"{after:.3f} m/s, {s[-1, 10]:.3f} rad/s",
            "1.2 m/s, 0",
        )


def friction():
    """A ball lands with a slip of 6 m/s: the impulse of friction is µ times the normal one, (1 + e) u."""
    for e in (0.0, 0.6):
        s = motion(BALL, 150, [0.0, 0.3, 0.0], velocity=[6.0, -2.0, 0.0], e=e, friction=0.12)
        line(f"Ball of restitution {e}, µ 0.12: friction in the impact over µ u", f"{(6.0 - s[-1, 7]) / 0.24:.2f}", 1.0 + e)


def land():
    """A block with its mass in the corners rocks onto its other edge: a landing keeps 0.862 of the spin (Housner)."""
    half, angle = (0.2, 0.5, 0.2), -2.0 * np.arcsin(0.07602784115006116)
    turn = [0.0, 0.0, np.sin(angle / 2.0), np.cos(angle / 2.0)]
    start = [-0.12188011354468944, 0.5245428847313951, 0.0]
    w = motion(3.0 * box(*half), 450, start, turn, half=half, gravity=G, friction=1e6)[:, 12]
    top = w.argmax()
    line("Share of spin that a landing of a block keeps", f"{w[top + 2] / w[top]:.3f}", 0.862)


def rotate():
    """A tumbling brick, and the limit of the spin."""
    inertia, spin = np.array([0.00189422, 0.00621102, 0.00719467]), np.radians([25.0, -15.0, 40.0])
    s = motion(inertia, 30000, [0.0, 9.0, 0.0], spin=spin)
    energy = np.square(Rotation.from_quat(s[:, 3:7]).inv().apply(s[:, 10:])) @ inertia
    line("Energy after 30 s of tumbling", f"{energy[-1] / energy[0] - 1.0:.1e}", 0)
    for fast in (True, False):
        w = motion(BALL, 1, [0.0, 9.0, 0.0], spin=[0.0, 4000.0, 0.0], fast=fast)[-1, 11]
        line(f"4000 rad/s, allowFastRotation {fast}", f"{w:.0f} rad/s", 4000)


if __name__ == "__main__":
    for finding in (rebound, friction, land, rotate):
        finding()
