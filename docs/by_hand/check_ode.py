"""Findings about ODE alone: `pip install ode-python scipy`, `apt-get install libode8`, then `python docs/by_hand/check_ode.py`.

Bodies have 1 kg, y is up, and a step is 1 ms unless a line says otherwise.
"""

from ctypes import byref, sizeof, string_at
from math import hypot, inf

import numpy as np
import odepy as ode
from scipy.spatial.transform import Rotation

G = 9.8  # m/s²
COUNT = 8
ode.dInitODE2(0)


def motion(
    start, inertia, duration, dt=1e-3, half=None, gravity=G, e=0.0, friction=0.0, mode=ode.dContactApprox1, along=False, finite=True
):
    """Position, quaternion [x, y, z, w], velocity and spin after each step, shape (n + 1, 13); without `half` a ball of 0.1 m.

    `mode` is ODE's, with the floor's bounce and no correction of depth; `along` gives friction the direction of the slip.
    """
    world, joints, contacts = ode.dWorldCreate(), ode.dJointGroupCreate(0), (ode.dContact * COUNT)()
    ode.dWorldSetGravity(world, 0.0, -gravity, 0.0)
    ode.dWorldSetERP(world, 0.0)
    for contact in contacts:
        contact.fdir1[0] = 1.0
        contact.surface.mode = mode | ode.dContactBounce | (ode.dContactFDir1 if along else 0)
        contact.surface.mu, contact.surface.bounce = friction, e
    floor = ode.dCreatePlane(None, 0.0, 1.0, 0.0, 0.0)
    shape = ode.dCreateSphere(None, 0.1) if half is None else ode.dCreateBox(None, *2.0 * np.array(half))
    body, mass, slip = ode.dBodyCreate(world), ode.dMass(), ode.dVector3()
    mass.mass, mass.I[0], mass.I[5], mass.I[10] = 1.0, *inertia
    ode.dBodySetMass(body, byref(mass))
    ode.dGeomSetBody(shape, body)
    ode.dBodySetPosition(body, *start[:3])
    ode.dBodySetQuaternion(body, ode.dQuaternion(start[6], *start[3:6]))
    ode.dBodySetLinearVel(body, *start[7:10])
    ode.dBodySetAngularVel(body, *start[10:])
    ode.dBodySetFiniteRotationMode(body, int(finite))
    rows = [np.array(start, dtype=float)]
    for _ in range(round(duration / dt)):
        count = ode.dCollide(shape, floor, COUNT, byref(contacts[0].geom), sizeof(ode.dContact)) if gravity or half else 0
        for contact in contacts[:count]:
            ode.dBodyGetPointVel(body, *contact.geom.pos[:3], slip)
            if along and (speed := hypot(slip[0], slip[2])):
                contact.fdir1[0], contact.fdir1[2] = slip[0] / speed, slip[2] / speed
            ode.dJointAttach(ode.dJointCreateContact(world, joints, byref(contact)), body, 0)
        ode.dWorldStep(world, dt)
        ode.dJointGroupEmpty(joints)
        q = ode.dBodyGetQuaternion(body)[:4]
        velocities = [*ode.dBodyGetLinearVel(body)[:3], *ode.dBodyGetAngularVel(body)[:3]]
        rows.append(np.array([*ode.dBodyGetPosition(body)[:3], *q[1:], q[0], *velocities]))
    return np.array(rows)


def state(position, quaternion=(0.0, 0.0, 0.0, 1.0), velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0)):
    """A start, shape (13,)."""
    return np.concatenate([position, quaternion, velocity, spin])


def box(x, y, z):
    """The moments of inertia of a box of these half extents."""
    return np.array([y * y + z * z, x * x + z * z, x * x + y * y]) / 3.0


def line(what, measured, expected):
    """Print a finding."""
    print(f"{what}: measured {measured}, exact {expected}", flush=True)


def rebound():
    """A ball falls 1 m; its speed before the impact is that before the step in which gravity acts too."""
    v = motion(state([0.0, 1.1, 0.0]), np.full(3, 0.004), 0.6, e=0.5)[:, 8]
    hit = v.argmin()
    line("Ball of restitution 0.5", f"{-v[hit + 1] / v[hit]:.7f}", 0.5)


def slide():
    """A box of 1 kg slides at 3 m/s: with µ as a force, each of four contacts slows it by µ/M; with the normal force, all by µ g."""
    for name, mode in (("a force in N, as by default", 0), ("a part of the normal force", ode.dContactApprox1)):
        s = motion(state([0.0, 0.1, 0.0], velocity=[3.0, 0.0, 0.0]), box(0.3, 0.1, 0.2), 0.5, half=(0.3, 0.1, 0.2), friction=0.3, mode=mode)
        line(f"Deceleration of a sliding box, µ 0.3 is {name}", f"{(3.0 - s[-1, 7]) / 0.5:.3f} m/s²", f"{0.3 * G:.3f} m/s²")


def turn():
    """A box turns on a floor of 0.3: friction at its corners, f M g ρ, slows it uniformly, however it lies."""
    half = (0.3, 0.1, 0.2)
    slowing = 0.3 * G * np.hypot(0.3, 0.2) / box(*half)[1]
    for along in (False, True):
        shares = []
        for angle in np.radians(np.arange(0.0, 90.0, 5.0)):
            start = state([0.0, 0.1, 0.0], [0.0, np.sin(angle / 2.0), 0.0, np.cos(angle / 2.0)], spin=[0.0, 2.0, 0.0])
            s = motion(start, box(*half), 0.01, half=half, friction=0.3, along=along)
            shares.append((2.0 - s[-1, 11]) / 0.01 / slowing)
        name = "the slip" if along else "the world's axes"
        line(f"Deceleration of a turning box over Coulomb's, friction along {name}", f"{min(shares):.3f} to {max(shares):.3f}", 1)


def land():
    """A block of width 0.4 and height 1 rocks onto its other edge: a landing keeps 1 - 2 a²/(2 R²) of the spin (Housner)."""
    half, angle = (0.2, 0.5, 0.2), -2.0 * np.arcsin(0.07602784115006116)
    start = state([-0.12188011354468944, 0.5245428847313951, 0.0], [0.0, 0.0, np.sin(angle / 2.0), np.cos(angle / 2.0)])
    for name, friction, mode in (("infinite", inf, 0), ("1e6, of the normal force", 1e6, ode.dContactApprox1)):
        w = motion(start, 3.0 * box(*half), 0.45, half=half, friction=friction, mode=mode)[:, 12]
        top = w.argmax()
        line(
            f"Share of spin that a landing of a block with its mass in the corners keeps, µ is {name}", f"{w[top + 1] / w[top]:.3f}", 0.862
        )


def strike():
    """A box strikes a floor of 0.1 and restitution 0.5 with one corner: friction opposes the slip, and is µ times the normal impulse."""
    half, turned = (0.1, 0.15, 0.25), Rotation.from_euler("xyz", [0.5, 0.3, 0.4])
    start = state([0.0, 0.5, 0.0], turned.as_quat(), [1.0, -3.0, 0.5], [2.0, 3.0, -1.0])
    s = motion(start, box(*half), 0.3, half=half, gravity=0.0, e=0.5, friction=0.1, along=True)
    jump = np.diff(s[:, 7:10], axis=0)
    impulse = jump[np.abs(jump[:, 1]).argmax()]
    line("Friction over the normal impulse in a corner's impact, µ 0.1", f"{np.hypot(*impulse[[0, 2]]) / impulse[1]:.3f}", 0.1)


def rotate():
    """A free body: the angle of a step, and the energy of a brick that tumbles for 30 s."""
    for finite in (True, False):
        s = motion(state([0.0, 9.0, 0.0], spin=[0.0, 50.0, 0.0]), np.full(3, 0.004), 1e-3, gravity=0.0, finite=finite)
        name = "finite" if finite else "infinitesimal, as by default"
        line(f"Angle of a step at 50 rad/s, rotation {name}", f"{2.0 * np.arcsin(s[-1, 4]):.6f}", "0.05; 2 atan(0.025) is 0.049990")
    inertia, spin = np.array([0.00189422, 0.00621102, 0.00719467]), np.radians([25.0, -15.0, 40.0])
    s = motion(state([0.0, 9.0, 0.0], spin=spin), inertia, 30.0, gravity=0.0)
    energy = np.square(Rotation.from_quat(s[:, 3:7]).inv().apply(s[:, 10:])) @ inertia
    line("Energy after 30 s of tumbling", f"{energy[-1] / energy[0] - 1.0:.2e}", "0; docs/engines.md: -2.0e-3")


if __name__ == "__main__":
    print(string_at(ode.dGetConfiguration()).decode())
    for finding in (rebound, slide, turn, land, strike, rotate):
        finding()
