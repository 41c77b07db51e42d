"""Findings about PhysX 5 in SAPIEN alone: `pip install sapien scipy`, then `python docs/by_hand/check_sapien.py`.

Bodies have 1 kg, y is up, quaternions are [w, x, y, z], and a step is 1 ms unless a line says otherwise.
"""

import numpy as np
import sapien
from sapien import physx
from scipy.spatial.transform import Rotation

BALL = np.full(3, 0.4 * 0.1**2)  # kg m²; of a ball of 0.1 m
G, UP = 9.8, [0.5**0.5, 0.0, 0.0, 0.5**0.5]  # m/s²; the quaternion that turns a plane's normal from x to y


def motion(start, inertia, duration, dt=1e-3, add_shape=None, gravity=G, e=0.0, friction=0.0, tgs=False, length=1e-3, offset=None):
    """Position, quaternion, velocity and spin after each step, shape (n + 1, 13).

    PhysX looks for contacts within `offset`, by default a step's fall: with SAPIEN's 1 cm a ball rebounds up to 1 mm above the floor.
    `length` is PhysX's tolerance length.
    """
    engine = physx.PhysxEngine(length, 0.2)  # its tolerances hold for all that is made while it exists
    config = physx.PhysxSceneConfig()
    config.gravity, config.bounce_threshold, config.enable_tgs = [0.0, -gravity, 0.0], 1e-9, tgs
    physx.set_scene_config(config)
    system, body = physx.PhysxCpuSystem(), physx.PhysxRigidDynamicComponent()
    scene, moving, fixed = sapien.Scene([system]), sapien.Entity(), sapien.Entity()
    system.timestep = dt
    if add_shape:
        material, ground = physx.PhysxMaterial(friction, friction, e), physx.PhysxRigidStaticComponent()
        shape, plane = add_shape(material), physx.PhysxCollisionShapePlane(material)
        plane.local_pose = sapien.Pose(q=UP)
        shape.contact_offset = plane.contact_offset = offset or gravity * dt**2 + 1e-7
        body.attach(shape)
        ground.attach(plane)
        fixed.add_component(ground)
        scene.add_entity(fixed)
    body.mass, body.inertia, body.cmass_local_pose = 1.0, inertia, sapien.Pose()
    body.sleep_threshold, body.max_angular_velocity = 0.0, 1e16
    body.linear_damping = body.angular_damping = 0.0
    body.solver_position_iterations = 4 if tgs else 100
    moving.add_component(body)
    moving.pose = sapien.Pose(start[:3], start[3:7])
    scene.add_entity(moving)
    body.linear_velocity, body.angular_velocity = start[7:10], start[10:]
    states = [np.array(start)]
    for _ in range(round(duration / dt)):
        system.step()
        states.append(np.concatenate([moving.pose.p, moving.pose.q, body.linear_velocity, body.angular_velocity], dtype=float))
    assert engine
    return np.array(states)


def state(position=(0.0, 0.0, 0.0), quaternion=(1.0, 0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0)):
    """A start, shape (13,)."""
    return np.concatenate([position, quaternion, velocity, spin])


def ball(material):
    """A ball of 0.1 m."""
    return physx.PhysxCollisionShapeSphere(0.1, material)


def box(x, y, z):
    """A box of these half extents, and its moments of inertia."""
    return lambda material: physx.PhysxCollisionShapeBox([x, y, z], material), np.array([y * y + z * z, x * x + z * z, x * x + y * y]) / 3


def spin_in_body(rows):
    """Angular velocities about the body's own axes [rad/s]."""
    return Rotation.from_quat(rows[:, 3:7], scalar_first=True).inv().apply(rows[:, 10:])


def largest_distance(rows, exact):
    """The largest distance of the centre of mass from its exact position [m]."""
    return np.linalg.norm(rows[:, :3] - exact, axis=1).max()


def line(what, measured, expected, stated):
    """Print a finding."""
    print(f"{what}: measured {measured}, exact {expected}; docs/engines.md: {stated}", flush=True)


def rebound():
    """A ball falls 1 m. PhysX adds gravity before the impact: e (1 + g dt/u)."""
    v = motion(state([0.0, 1.1, 0.0]), BALL, 1.0, add_shape=ball, e=0.5)[:, 8]
    hit, u = v.argmin(), (2.0 * G) ** 0.5
    measured = f"{-v[hit + 1] / v[hit] - 0.5:.2e}"
    line("Rebound: error of restitution", measured, f"0, or e g dt/u = {0.5 * G * 1e-3 / u:.2e} with gravity first", "1.1e-3")


def bounces():
    """An elastic ball falls 2 cm. A bounce to u + g dt adds M g u dt to the energy, which is M g² dt/2 per second."""
    y = motion(state([0.0, 0.12, 0.0]), BALL, 12.8, add_shape=ball, e=1.0)[:, 1]
    gained = G**2 * 1e-3 / 2.0 * 12.8 / (G * 0.02)
    line(
        "Elastic bounces: gain over the height",
        f"{(y.max() - 0.1) / 0.02 - 1.0:.2f}",
        f"0, or {gained:.2f} with gravity first",
        "3.2, of energy",
    )


def tumble():
    """A brick tumbles for 30 s; beside it, in double precision, an explicit step of the gyroscopic term that keeps |L|."""
    inertia, start = np.array([0.00189422, 0.00621102, 0.00719467]), np.radians([25.0, -15.0, 40.0])
    for dt, stated in ((1e-2, "2.7e-3"), (1e-3, "7.8e-4")):
        spin = spin_in_body(motion(state(spin=start), inertia, 30.0, dt, gravity=0.0))
        expected = [start]
        for _ in spin[1:]:
            momentum = expected[-1] * inertia
            turned = momentum - dt * np.cross(expected[-1], momentum)
            expected.append(turned * np.linalg.norm(momentum) / np.linalg.norm(turned) / inertia)
        energies = [np.square(one) @ inertia for one in (spin, np.array(expected))]
        found, explicit = (np.abs(energy / energy[0] - 1.0).max() for energy in energies)
        line(f"Tumbling, dt {dt} s: energy error", f"{found:.2e}", f"0, or {explicit:.2e} of the explicit step in double precision", stated)
        lengths = np.linalg.norm(spin * inertia, axis=1)
        line("Change of |L|", f"{np.abs(lengths / lengths[0] - 1.0).max():.1e}", 0, {1e-2: "", 1e-3: "2.5e-4"}[dt])


def drop_box():
    """A box strikes a floor that grips, with two lengths and two offsets."""
    add_box, inertia = box(0.1, 0.15, 0.25)
    turn = np.array([0.9, 0.2, 0.1, -0.3]) / 0.95**0.5
    lowest = np.abs(Rotation.from_quat(turn, scalar_first=True).as_matrix()[1]) @ [0.1, 0.15, 0.25]
    for length, offset, stated in ((0.1, None, "up to 0.08"), (0.1, 0.01, "none"), (1e-3, None, "4.0e-5, a mean")):
        start = state([0.0, 1.0, 0.0], turn, spin=[1.0, 0.5, -1.0])
        s = motion(start, inertia, 2.0, add_shape=add_box, e=0.4, friction=1e6, length=length, offset=offset)
        kinetic = 0.5 * (np.square(s[:, 7:10]).sum(1) + np.square(spin_in_body(s)) @ inertia)
        energy = kinetic + G * s[:, 1] - 0.5e-3 * G * s[:, 8]  # the velocity is half a step older than the position
        gain = (energy - np.minimum.accumulate(energy)).max() / (G * (1.0 - lowest))
        line(f"Box, length {length} m, offset {offset or 'of a step'}: gain of energy over M g H", f"{gain:.1e}", 0, stated)


def slide():
    """A box slides at 3 m/s over a floor of 0.3: its distance from Coulomb's solution halves with the step."""
    add_box, inertia = box(0.3, 0.1, 0.2)
    errors = []
    for dt in (2e-3, 1e-3):
        s = motion(state([0.0, 0.1, 0.0], velocity=[3.0, 0.0, 0.0]), inertia, 1.5, dt, add_box, friction=0.3, tgs=True)
        t = np.minimum(np.arange(len(s)) * dt, 3.0 / (0.3 * G))
        errors.append(largest_distance(s, np.stack([3.0 * t - 0.15 * G * t**2, 0.1 + 0.0 * t, 0.0 * t], axis=1)))
    line("Slide: errors at 2 and 1 ms [m]", f"{errors[0]:.2e} {errors[1]:.2e}", 0, "")
    line("Their ratio", f"{errors[0] / errors[1]:.2f}", "2 to the order", "order 1.0")


def turn():
    """A box turns on a floor of 0.3: friction at its corners, f M g ρ, slows it uniformly, however it lies."""
    add_box, inertia = box(0.3, 0.1, 0.2)
    slowing = 0.3 * G * np.hypot(0.3, 0.2) / inertia[1]
    for dt in (1e-3, 5e-4):
        s = motion(state([0.0, 0.1, 0.0], spin=[0.0, 10.0, 0.0]), inertia, 0.6, dt, add_box, friction=0.3, tgs=True)
        exact = np.maximum(10.0 - slowing * dt * np.arange(len(s)), 0.0)
        line(f"Turn, dt {dt} s: error of angular momentum", f"{np.abs(s[:, 11] - exact).max() / 10.0:.3f}", 0, "0.027 as dt → 0")
    shares = []
    for angle in np.radians(np.arange(0.0, 90.0, 5.0)):
        start = state([0.0, 0.1, 0.0], [np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0], spin=[0.0, 2.0, 0.0])
        s = motion(start, inertia, 0.01, add_shape=add_box, friction=0.3, tgs=True)
        shares.append((2.0 - s[-1, 11]) / 0.01 / slowing)
    line("Deceleration over Coulomb's, by the angle of the box", f"{min(shares):.2f} to {max(shares):.2f}", 1, "0.92 to 1.00")


def roll():
    """A ball with spin about its path slides along a parabola and rolls on (Coriolis)."""
    v, spin = np.array([2.0, 0.0, 0.0]), np.array([30.0, 10.0, 0.0])
    slip = v + np.cross(spin, [0.0, -0.1, 0.0])
    for name, tgs, stated in (("TGS", True, "6.5e-4"), ("PGS", False, "0.060")):
        s = motion(state([0.0, 0.1, 0.0], velocity=v, spin=spin), BALL, 1.5, add_shape=ball, friction=0.2, tgs=tgs)
        t = np.arange(len(s))[:, None] * 1e-3
        sliding = np.minimum(t, 2.0 / 7.0 * np.linalg.norm(slip) / (0.2 * G))
        a = -0.2 * G * slip / np.linalg.norm(slip)
        exact = [0.0, 0.1, 0.0] + v * sliding + 0.5 * a * sliding**2 + (v + a * sliding) * (t - sliding)
        line(f"Ball with side spin, {name}: error of position [m]", f"{largest_distance(s, exact):.2e}", 0, stated)


if __name__ == "__main__":
    for finding in (rebound, bounces, tumble, drop_box, slide, turn, roll):
        finding()
