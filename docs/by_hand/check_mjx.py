"""Findings about MJX, beside MuJoCo: `pip install mujoco-mjx jax scipy`, then `python docs/by_hand/check_mjx.py`.

Bodies have 1 kg, y is up, a step is 1 ms. It takes two minutes, most of them to compile.
"""

from itertools import pairwise

import jax
import mujoco
import numpy as np
from mujoco import mjx
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

INERTIA, SPIN = np.array([0.00189422, 0.00621102, 0.00719467]), np.radians([25.0, -15.0, 40.0])  # kg m², rad/s
WORLD = """<mujoco><option timestep="{dt}" gravity="0 {gravity} 0" integrator="{integrator}" cone="{cone}" jacobian="dense">
<flag island="disable" eulerdamp="disable" diagexact="{exact}"/></option>
<worldbody><geom name="floor" type="plane" size="0 0 1" zaxis="0 1 0" contype="0" conaffinity="0"/>
<body><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="{inertia}"/><geom name="body" {shape} contype="0" conaffinity="0"/></body>
</worldbody>{contact}</mujoco>"""
# Stiffness 0 and damping (1 + e)/dt turn the speed v into -e v in one step.
CONTACT = """<contact><pair geom1="floor" geom2="body" condim="{condim}" friction="{friction} {friction} 0 0 0" solref="0 {damping}"
solimp="0.9999 0.9999 0.001 0.5 2" solreffriction="0 -1000"/></contact>"""


def model(inertia=INERTIA, shape='type="sphere" size="1"', dt=1e-3, integrator="Euler", restitution=None, friction=0.0, exact="disable"):
    """A free body, over a floor if there is a restitution; `exact` is MuJoCo's flag for the exact inertia of a contact."""
    damping, condim = -(1.0 + (restitution or 0.0)) / dt, 3 if friction else 1
    contact = "" if restitution is None else CONTACT.format(condim=condim, friction=friction, damping=damping)
    gravity, cone = 0.0 if restitution is None else -9.8, "elliptic" if friction else "pyramidal"
    numbers = " ".join(str(float(one)) for one in inertia)
    return mujoco.MjModel.from_xml_string(
        WORLD.format(dt=dt, gravity=gravity, integrator=integrator, cone=cone, exact=exact, inertia=numbers, shape=shape, contact=contact)
    )


def in_mujoco(model, qpos, qvel, steps):
    """MuJoCo's coordinates after each step, shape (steps + 1, 13)."""
    data = mujoco.MjData(model)
    data.qpos, data.qvel = qpos, qvel
    rows = [np.concatenate([data.qpos, data.qvel])]
    for _ in range(steps):
        mujoco.mj_step(model, data)
        rows.append(np.concatenate([data.qpos, data.qvel]))
    return np.array(rows)


def in_mjx(model, qpos, qvel, steps, double=True):
    """The same of MJX."""
    jax.config.update("jax_enable_x64", double)
    put = mjx.put_model(model)
    data = mjx.make_data(put)
    data = data.replace(qpos=jax.numpy.asarray(qpos, data.qpos.dtype), qvel=jax.numpy.asarray(qvel, data.qvel.dtype))

    def step(data, _):
        data = mjx.step(put, data)
        return data, jax.numpy.concatenate([data.qpos, data.qvel])

    rows = jax.jit(lambda data: jax.lax.scan(step, data, length=steps)[1])(data)
    return np.concatenate([[[*qpos, *qvel]], np.asarray(rows, dtype=float)])


def difference(one, other, size, gravity=9.8):
    """The largest difference of two motions after each step: of angles, and relative to the body's size and to speeds."""
    speed = max(np.abs(one[:, 7:10]).max(), size * np.abs(one[:, 10:]).max(), (gravity * size) ** 0.5)
    turned = [Rotation.from_quat(rows[:, 3:7], scalar_first=True) for rows in (one, other)]
    parts = np.abs(one - other)[:, [0, 1, 2, *range(7, 13)]] / np.repeat([size, speed, speed / size], 3)
    return np.maximum((turned[0].inv() * turned[1]).magnitude(), parts.max(axis=1))


def line(what, measured, expected, stated):
    """Print a finding."""
    print(f"{what}: measured {measured}, exact {expected}; docs/engines.md: {stated}", flush=True)


REST = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
TUMBLE = (REST, [0.0, 0.0, 0.0, *SPIN])


def energy_error(rows):
    """The largest change of the energy of the tumbling brick, relative to its energy."""
    energy = rows[:, 10:] ** 2 @ INERTIA / 2.0
    change = energy / energy[0] - 1.0
    return f"{change[np.abs(change).argmax()]:.2e}"


def tumbling():
    """30 s of tumbling."""
    own, ported = in_mujoco(model(), *TUMBLE, 30000), in_mjx(model(), *TUMBLE, 30000)
    line("Tumbling, Euler, float64: energy error", energy_error(ported), 0, "2.0e-3")
    line("MuJoCo's", energy_error(own), 0, "the same")
    line("Their difference in float64", f"{difference(own, ported, 0.12, 0.0).max():.1e}", 0, "< 1e-13")
    line("The same in float32", f"{difference(own, in_mjx(model(), *TUMBLE, 30000, double=False), 0.12, 0.0).max():.1e}", 0, "< 1e-4")
    fast = model(integrator="implicitfast")
    line("Tumbling, implicitfast, float64: energy error", energy_error(in_mjx(fast, *TUMBLE, 30000)), 0, "2.0e-3")
    line("MuJoCo's", energy_error(in_mujoco(fast, *TUMBLE, 30000)), 0, "implicit: -2.0e-3")


def rk4():
    """The order of RK4's rotations, against Euler's equations solved by DOP853."""

    def rates(_, y):
        q, w = y[:4], y[4:]
        return [-0.5 * q[1:] @ w, *(0.5 * (q[0] * w + np.cross(q[1:], w))), *(np.cross(INERTIA * w, w) / INERTIA)]

    for name, simulate in (("MJX", in_mjx), ("MuJoCo", in_mujoco)):
        errors = []
        for dt in (0.1, 0.05, 0.025):
            steps = round(30.0 / dt)
            times = np.arange(steps + 1) * dt
            exact = solve_ivp(rates, (0.0, times[-1]), [1.0, 0.0, 0.0, 0.0, *SPIN], "DOP853", times, rtol=1e-13, atol=1e-14).y[:4].T
            rows = simulate(model(dt=dt, integrator="RK4"), *TUMBLE, steps)
            turned = [Rotation.from_quat(one, scalar_first=True) for one in (rows[:, 3:7], exact)]
            errors.append((turned[0].inv() * turned[1]).magnitude().max())
        ratios = [f"{a / b:.1f}" for a, b in pairwise(errors)]
        line(f"{name}, RK4: orientation errors at 0.1, 0.05, 0.025 s", [f"{one:.1e}" for one in errors], 0, "")
        line("Their ratios", ratios, "2 to the order", "order 2.0 of MJX, 4.0 of MuJoCo")


def rebound():
    """A ball that falls 1 m or less, with a restitution of 0.5. From four heights, because the error is of rounding."""
    for integrator, stated in (("Euler", "< 1e-6"), ("implicitfast", "up to 2e-3")):
        ball, errors = model(np.full(3, 0.004), 'type="sphere" size="0.1"', restitution=0.5, integrator=integrator), []
        for height in np.linspace(1.08, 1.1, 4):
            v = in_mjx(ball, [0.0, height, 0.0, 1.0, 0.0, 0.0, 0.0], np.zeros(6), 500, double=False)[:, 8]
            errors.append(-v[v.argmin() + 1] / v.min() - 0.5)
        line(f"Rebound, {integrator}, float32: error of restitution", f"{min(errors):.1e} to {max(errors):.1e}", 0, stated)


def corner():
    """A spinning box that strikes the floor with a corner."""
    turn = np.array([0.9, 0.2, 0.1, -0.3]) / 0.95**0.5
    spin = Rotation.from_quat(turn, scalar_first=True).inv().apply([0.8, -0.5, 0.6])  # MuJoCo's is about the body's axes
    start = ([0.0, 1.5, 0.0, *turn], [0.6, 0.0, -0.4, *spin])
    half = np.array([0.25, 0.35, 0.5])
    box = {"inertia": (half @ half - half**2) / 3.0, "shape": 'type="box" size="0.25 0.35 0.5"', "restitution": 0.5}
    size = np.linalg.norm(half)
    ported = in_mjx(model(**box), *start, 600)
    for flag, stated in (("enable", "3.2e-5"), ("disable", "5e-12")):
        found = difference(in_mujoco(model(**box, exact=flag), *start, 600), ported, size)
        first = np.flatnonzero(found > 1e-9)
        line(f"Corner, float64, diagexact {flag}d: difference", f"{found.max():.1e}", 0, stated)
        if len(first):
            line("Step after which it begins", first[0], "the impact", "419")
    found = difference(in_mujoco(model(**box, exact="enable"), *start, 600), in_mjx(model(**box), *start, 600, double=False), size)
    line("Corner, float32: difference", f"{found.max():.1e}", 0, "< 1e-3")


def slide():
    """A box that slides, with and without 4e-16 m less height."""
    half = np.array([0.3, 0.1, 0.2])
    box = {"inertia": (half @ half - half**2) / 3.0, "shape": 'type="box" size="0.3 0.1 0.2"', "restitution": 0.0, "friction": 0.3}
    rows = {}
    for lower in (0.0, 4e-16):
        start = ([0.0, 0.1 - lower, 0.0, 1.0, 0.0, 0.0, 0.0], [3.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        rows[lower] = in_mujoco(model(**box, exact="enable"), *start, 1500)
    start = ([0.0, 0.1, 0.0, 1.0, 0.0, 0.0, 0.0], [3.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    size = np.linalg.norm(half)
    line("Slide, MuJoCo from 4e-16 m lower: difference", f"{difference(rows[0.0], rows[4e-16], size).max():.1f}", 0, "0.4 to 0.6")
    ported = in_mjx(model(**box), *start, 1500)
    line("Slide, MJX in float64: difference", f"{difference(rows[0.0], ported, size).max():.1f}", 0, "as much")


if __name__ == "__main__":
    for finding in (rebound, corner, slide, rk4, tumbling):
        finding()
