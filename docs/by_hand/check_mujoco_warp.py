"""Findings about MuJoCo Warp, beside MuJoCo: `pip install mujoco-warp scipy`, then `python docs/by_hand/check_mujoco_warp.py`.

Bodies have 1 kg, y is up, a step is 1 ms. Warp compiles for minutes the first time, on a processor.
"""

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp
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


SLIPPERY = """<mujoco><option timestep="1e-3" gravity="0 -9.8 0" cone="{cone}"/><default><geom friction="0 0.005 0.0001"/></default>
<worldbody><geom type="plane" size="0 0 1" zaxis="0 1 0"/><body><freejoint/><geom type="sphere" size="0.1" mass="1"/></body></worldbody>
</mujoco>"""


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


def in_warp(model, qpos, qvel, steps):
    """The same of MuJoCo Warp."""
    put, data = mjw.put_model(model), mjw.make_data(model)
    mjw.step(put, data)  # compiles
    with wp.ScopedCapture() as capture:  # a graph of the step's kernels; without one, a step takes 15 ms
        mjw.step(put, data)
    mjw.reset_data(put, data)
    data.qpos.assign(np.array([qpos], np.float32))
    data.qvel.assign(np.array([qvel], np.float32))
    rows = [np.array([*qpos, *qvel])]
    for _ in range(steps):
        wp.capture_launch(capture.graph)
        rows.append(np.concatenate([data.qpos.numpy()[0], data.qvel.numpy()[0]]))
    return np.array(rows, dtype=float)


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
    found = difference(in_mujoco(model(), *TUMBLE, 30000), in_warp(model(), *TUMBLE, 30000), 0.12, 0.0)
    line("Tumbling, Euler: difference from MuJoCo", f"{found.max():.1e}", 0, "< 1e-4")
    fast = model(integrator="implicitfast")
    line("Tumbling, implicitfast: energy error", energy_error(in_warp(fast, *TUMBLE, 30000)), 0, "-2.0e-3")
    line("MuJoCo's", energy_error(in_mujoco(fast, *TUMBLE, 30000)), 0, "implicit too")


def rebound():
    """A ball that falls 1 m, with a restitution of 0.5."""
    ball = model(np.full(3, 0.004), 'type="sphere" size="0.1"', restitution=0.5)
    v = in_warp(ball, [0.0, 1.1, 0.0, 1.0, 0.0, 0.0, 0.0], np.zeros(6), 600)[:, 8]
    hit = v.argmin()
    line("Rebound: error of restitution", f"{-v[hit + 1] / v[hit] - 0.5:.1e}", 0, "< 1e-6")


def corner():
    """A spinning box that strikes the floor with a corner."""
    turn = np.array([0.9, 0.2, 0.1, -0.3]) / 0.95**0.5
    spin = Rotation.from_quat(turn, scalar_first=True).inv().apply([0.8, -0.5, 0.6])  # MuJoCo's is about the body's axes
    start = ([0.0, 1.5, 0.0, *turn], [0.6, 0.0, -0.4, *spin])
    half = np.array([0.25, 0.35, 0.5])
    box = {"inertia": (half @ half - half**2) / 3.0, "shape": 'type="box" size="0.25 0.35 0.5"', "restitution": 0.5}
    ported = in_warp(model(**box), *start, 600)
    found = difference(in_mujoco(model(**box, exact="enable"), *start, 600), ported, np.linalg.norm(half))
    line("Corner: difference from MuJoCo", f"{found.max():.1e}", 0, "3.3e-5")


def slippery():
    """A ball that lands on a floor without friction, with MuJoCo's own contacts of three dimensions."""
    start = ([0.0, 0.2, 0.0, 1.0, 0.0, 0.0, 0.0], np.zeros(6))
    for cone, stated in (("pyramidal", "nan"), ("elliptic", "0.100")):
        ball = mujoco.MjModel.from_xml_string(SLIPPERY.format(cone=cone))
        line(f"Without friction, {cone}: height", f"{in_warp(ball, *start, 400)[-1, 1]:.3f}", 0.1, stated)
        line("MuJoCo's", f"{in_mujoco(ball, *start, 400)[-1, 1]:.3f}", 0.1, "0.100")


if __name__ == "__main__":
    for finding in (rebound, corner, slippery, tumbling):
        finding()
