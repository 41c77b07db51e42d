"""Findings about Newton's solvers in Newton alone: `pip install 'newton[sim]' scipy`, then `python docs/by_hand/check_newton.py`.

Bodies have 1 kg, y is up, a step is 1 ms unless a line says otherwise. Warp compiles for minutes the first time, on a processor.
"""

import newton
import numpy as np
import warp as wp

G = 9.8  # m/s²
BALL = np.full(3, 0.4 * 0.1**2)  # kg m²


def motion(solver, start, dt, duration, inertia, add_shape=None, gravity=G, restitution=0.0, mu=0.0, torsional=0.0):
    """Position, quaternion [x, y, z, w], velocity and spin after each step, shape (n + 1, 13)."""
    builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(0.0, -gravity, 0.0))
    body = builder.add_body(mass=1.0, inertia=wp.mat33(*np.diag(inertia).ravel()), lock_inertia=True)
    surface = newton.ModelBuilder.ShapeConfig(density=0.0, restitution=restitution, mu=mu, mu_torsional=torsional, mu_rolling=0.0)
    if add_shape:
        add_shape(builder, body, surface)
        builder.add_ground_plane(cfg=surface)
    model = builder.finalize()
    stepper, now, then, control = solver(model), model.state(), model.state(), model.control()
    now.body_q.assign(np.array([start[:7]], np.float32))
    now.body_qd.assign(np.array([start[7:]], np.float32))
    newton.eval_ik(model, now, now.joint_q, now.joint_qd)
    pipeline = newton.CollisionPipeline(model) if add_shape else None
    contacts = pipeline.contacts() if pipeline else None

    def step():
        now.clear_forces()
        if pipeline:
            pipeline.collide(now, contacts)
        stepper.step(now, then, control, contacts, dt)
        now.assign(then)

    first = model.state()
    first.assign(now)
    step()  # compiles
    with wp.ScopedCapture() as capture:  # a graph of the step's kernels, which is faster to launch
        step()
    now.assign(first)
    states = [np.array(start)]
    for _ in range(round(duration / dt)):
        wp.capture_launch(capture.graph)
        states.append(np.concatenate([now.body_q.numpy()[0], now.body_qd.numpy()[0]]))
    return np.array(states, dtype=float)


def xpbd(restitution=False):
    """The solver XPBD without damping, which removes the whole depth of a contact in a step."""
    return lambda model: newton.solvers.SolverXPBD(model, angular_damping=0.0, rigid_contact_relaxation=1.0, enable_restitution=restitution)


def featherstone(model):
    """The Featherstone solver without damping."""
    return newton.solvers.SolverFeatherstone(model, angular_damping=0.0)


def semi_implicit(model):
    """The semi-implicit solver without damping."""
    return newton.solvers.SolverSemiImplicit(model, angular_damping=0.0)


def state(position=(0.0, 0.0, 0.0), quaternion=(0.0, 0.0, 0.0, 1.0), velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0)):
    """A start, shape (13,)."""
    return np.concatenate([position, quaternion, velocity, spin])


def ball(builder, body, surface):
    """A ball of 0.1 m."""
    builder.add_shape_sphere(body, radius=0.1, cfg=surface)


def large_ball(builder, body, surface):
    """A ball of 0.2 m."""
    builder.add_shape_sphere(body, radius=0.2, cfg=surface)


def box(x, y, z):
    """A box of these half extents."""
    return lambda builder, body, surface: builder.add_shape_box(body, hx=x, hy=y, hz=z, cfg=surface)


def line(what, measured, expected, stated):
    """Print a finding."""
    print(f"{what}: measured {measured}, exact {expected}; docs/engines.md: {stated}", flush=True)


def largest_distance(rows, exact):
    """The largest distance of the centre of mass from its exact position [m]."""
    return np.linalg.norm(rows[:, :3] - exact, axis=1).max()


def spin():
    """A box spins freely at 5 rad/s about a principal axis: the angle is 5 t."""
    inertia = np.array([0.2**2 + 0.3**2, 0.1**2 + 0.3**2, 0.1**2 + 0.2**2]) / 3.0
    for name, solver, dt, stated in (
        ("XPBD", xpbd(), 0.01, "5.2e-3"),
        ("XPBD", xpbd(), 0.00025, "0.22"),
        ("Featherstone", featherstone, 0.00025, "energy < 1e-7"),
    ):
        s = motion(solver, state(spin=[5.0, 0.0, 0.0]), dt, 10.0, inertia, gravity=0.0)
        error = 2.0 * np.arctan2(s[:, 3], s[:, 6]) - 5.0 * dt * np.arange(len(s))
        error = np.abs((error + np.pi) % (2.0 * np.pi) - np.pi).max()
        line(f"Spin, {name}, dt {dt} s: error of the angle [rad]", f"{error:.2g}", 0, stated)
        line("Gain of ω in a step over ω", f"{(s[-1, 10] / 5.0 - 1.0) / (len(s) - 1):.1e}", 0, "2e-7 with XPBD")


def rebound():
    """A ball falls 1 m. XPBD adds gravity before the impact: e (1 + g dt/u). The others have no restitution."""
    u, start = (2.0 * G) ** 0.5, state([0.0, 1.1, 0.0])
    v = motion(xpbd(True), start, 1e-3, 0.6, BALL, ball, restitution=0.5)[:, 8]
    measured = f"{-v[v.argmin() + 1] / v.min() - 0.5:.2e}"
    line("Rebound, XPBD: error of restitution", measured, f"0, or e g dt/u = {0.5 * G * 1e-3 / u:.2e} with gravity first", "1.1e-3")
    for name, solver in (("semi-implicit", semi_implicit), ("Featherstone", featherstone), ("MuJoCo", newton.solvers.SolverMuJoCo)):
        for e in (0.5, 0.9):
            v = motion(solver, start, 1e-3, 0.8, BALL, ball, restitution=e, mu=0.1)[:, 8]  # at mu=0 MuJoCo's becomes NaN
            line(f"Rebound, {name}, restitution {e}", f"{v[v.argmin() :].max() / u:.2f}", e, "the same for both")


def flat_box():
    """A box lands flat: it never turns. From eight heights, because the angle is of rounding."""
    inertia = np.array([0.15**2 + 0.25**2, 0.1**2 + 0.25**2, 0.1**2 + 0.15**2]) / 3.0
    angles = []
    for height in 1.15 - 0.5e-3 * np.arange(8):
        s = motion(xpbd(True), state([0.0, height, 0.0]), 1e-3, 1.5, inertia, box(0.1, 0.15, 0.25), restitution=0.5)
        angles.append(2.0 * np.arcsin(np.linalg.norm(s[:, 3:6], axis=1).max()))
    line("Flat box: largest angle [rad]", f"{min(angles):.1e} to {max(angles):.1e}", 0, "9.4e-3, a mean")


def slide():
    """A box slides at 3 m/s over a floor of 0.3: its distance from Coulomb's solution halves with the step."""
    inertia = np.array([0.1**2 + 0.2**2, 0.3**2 + 0.2**2, 0.3**2 + 0.1**2]) / 3.0
    errors = []
    for dt in (2e-3, 1e-3):
        s = motion(xpbd(), state([0.0, 0.1, 0.0], velocity=[3.0, 0.0, 0.0]), dt, 1.5, inertia, box(0.3, 0.1, 0.2), mu=0.3)
        t = np.minimum(np.arange(len(s)) * dt, 3.0 / (0.3 * G))
        errors.append(largest_distance(s, np.stack([3.0 * t - 0.15 * G * t**2, 0.1 + 0.0 * t, 0.0 * t], axis=1)))
    line("Slide: errors at 2 and 1 ms [m]", f"{errors[0]:.2e} {errors[1]:.2e}", 0, "")
    line("Their ratio", f"{errors[0] / errors[1]:.2f}", "2 to the order", "order 0.98")


def roll():
    """A ball slides at 3 m/s, then rolls at 5/7 of that (Coriolis)."""
    v = np.array([2.4, 0.0, 1.8])
    for on, stated in ((False, "4.8e-4"), (True, "0.38")):
        s = motion(xpbd(on), state([0.0, 0.1, 0.0], velocity=v), 1e-3, 1.5, BALL, ball, mu=0.2)
        t = np.arange(len(s))[:, None] * 1e-3
        sliding = np.minimum(t, 2.0 / 7.0 * 3.0 / (0.2 * G))
        a = -0.2 * G * v / 3.0
        exact = [0.0, 0.1, 0.0] + v * sliding + 0.5 * a * sliding**2 + (v + a * sliding) * (t - sliding)
        line(f"Roll, enable_restitution={on}: error of position [m]", f"{largest_distance(s, exact):.2g}", 0, stated)
        line("Speed at the end [m/s]", f"{np.linalg.norm(s[-1, 7:10]):.3f}", f"{15 / 7:.3f}", "")


def rock():
    """A block of four masses rocks from edge to edge: a landing keeps 1 - 2 a²/(2 R²) of the angular speed (Housner).

    The share that is kept is the root of the ratio of the rises of the centre of mass after and before the landing.
    """
    tilts, kept = np.linspace(0.15, 0.16, 8), 1.0 - 0.2**2 / (0.2**2 + 0.5**2)
    for on, stated in ((False, "right as dt → 0"), (True, "0.56 to 0.86")):
        for dt in (2e-3, 1e-3, 5e-4):
            found = []
            for tilt in tilts:
                c, s = np.cos(tilt), np.sin(tilt)
                start = state([0.5 * s - 0.2 * c, 0.2 * s + 0.5 * c, 0.0], [0.0, 0.0, -np.sin(tilt / 2), np.cos(tilt / 2)])
                y = motion(xpbd(on), start, dt, 0.8, np.array([0.29, 0.08, 0.29]), box(0.2, 0.5, 0.2), mu=1e4)[:, 1]
                found.append((y[round(0.45 / dt) :].max() - 0.5) / (start[1] - 0.5))
            share = np.sqrt(found)
            measured = f"{share.min():.3f} to {share.max():.3f}, mean {share.mean():.4f}"
            line(f"Rock, enable_restitution={on}, dt {dt} s: share of ω kept", measured, f"{kept:.4f}", stated)


def grip():
    """A hollow ball with backspin strikes a floor that grips: it rebounds with e, and stops to slip."""
    for dt, stated in ((1e-3, "0.56"), (2.5e-4, ""), (1e-4, "0.8 as dt → 0")):
        start = state([0.0, 0.5, 0.0], velocity=[2.0, -1.0, 0.0], spin=[0.0, 0.0, 40.0])
        s = motion(xpbd(True), start, dt, 0.3, np.full(3, 2 / 3 * 0.2**2), large_ball, gravity=1.62, restitution=0.8, mu=1e4)
        hit = s[:, 8].argmin()
        line(f"Grip, dt {dt} s: restitution", f"{-s[hit + 3, 8] / s[hit, 8]:.3f}", 0.8, stated)
        line("Course [m/s] and spin [rad/s] after it", f"{s[hit + 3, 7]:.3f} {s[hit + 3, 12]:.2f}", "-2 and 10", "")


def rough_rebound():
    """A ball strikes a floor of 0.1 obliquely and slips: friction takes µ (1 + e) u of its course. From eight heights."""
    lost = []
    for height in 0.6 - 0.4e-3 * np.arange(8):
        s = motion(xpbd(True), state([0.0, height, 0.0], velocity=[3.0, 0.0, 0.0]), 1e-3, 0.4, BALL, ball, restitution=0.5, mu=0.1)
        lost.append(3.0 - s[s[:, 8].argmin() + 3, 7])
    exact = f"{0.15 * (2.0 * G * 0.5) ** 0.5:.2f}"
    line("Rough rebound: lost course [m/s]", f"{min(lost):.2f} to {max(lost):.2f}", exact, "0.02 to 0.30")


def defaults():
    """Solvers without arguments: a ball with restitution 0.5 falls 1 m, a free body spins, and a ball falls on a frictionless floor."""
    solvers, fall = newton.solvers, state([0.0, 1.1, 0.0])
    y = motion(solvers.SolverXPBD, fall, 1e-3, 1.0, BALL, ball, restitution=0.5)[:, 1]
    line("Default XPBD: height of the rebound over the fall", f"{y[y.argmin() :].max() - 0.1:.2f}", 0.25, "0.25 too low")
    inertia = np.array([0.1**2 + 0.2**2, 0.3**2 + 0.2**2, 0.3**2 + 0.1**2]) / 3.0
    for torsional in (0.005, 0.0):
        s = motion(
            solvers.SolverXPBD, state([0.0, 0.1, 0.0], spin=[0.0, 4.0, 0.0]), 1e-3, 2.0, inertia, box(0.3, 0.1, 0.2), torsional=torsional
        )
        line(f"Default XPBD, mu 0, mu_torsional {torsional}: spin after 2 s [rad/s]", f"{s[-1, 11]:.3f}", 4, "loses spin")
    for solver, stated in ((solvers.SolverSemiImplicit, "0.78 lost"), (solvers.SolverFeatherstone, "ignores it")):
        s = motion(solver, state(spin=[5.0, 0.0, 0.0]), 1e-3, 30.0, inertia, gravity=0.0)
        line(f"Default {solver.__name__}: share of the spin lost in 30 s", f"{1.0 - s[-1, 10] / 5.0:.2f}", 0, stated)
    for cone in ("pyramidal", "elliptic"):
        s = motion(lambda model, cone=cone: solvers.SolverMuJoCo(model, cone=cone), fall, 1e-3, 0.6, BALL, ball)
        line(f"MuJoCo solver, {cone}, mu 0: states are finite", np.isfinite(s).all(), True, "NaN if pyramidal")


if __name__ == "__main__":
    for finding in (spin, rebound, flat_box, slide, roll, rock, grip, rough_rebound, defaults):
        finding()
