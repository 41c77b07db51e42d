"""Findings about Genesis in Genesis alone: `pip install genesis-world torch scipy`, then `python docs/by_hand/check_genesis.py`.

A body of 1 kg, y is up; double precision, except for the last finding. Euler's equations solved by SciPy's DOP853 are the exact solution of
the tumbling body.
"""

import logging

import genesis
import numpy as np
from scipy.integrate import solve_ivp

INERTIA, SPIN = np.array([0.00189422, 0.00621102, 0.00719467]), np.radians([25.0, -15.0, 40.0])  # kg m², rad/s
G = 9.8  # m/s²
MODEL = """<mujoco><worldbody><body name="body"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="{0} {1} {2}"/>
<geom type="sphere" size="0.1"/></body></worldbody></mujoco>"""


def motion(duration, dt, start=(0.0, 0.0, 0.0), velocity=(0.0,) * 6, inertia=INERTIA, gravity=0.0, integrator=None, floor=None):
    """Positions and velocities (linear, then angular in the body frame) after each step; `floor` is a coefficient and a time constant."""
    contacts = {"friction_cone": genesis.friction_cone.elliptic, "contact_resolution": genesis.contact_resolution.signorini}
    scene = genesis.Scene(
        sim_options=genesis.options.SimOptions(dt=dt, gravity=(0.0, -gravity, 0.0)),
        rigid_options=genesis.options.RigidOptions(
            integrator=genesis.integrator.approximate_implicitfast if integrator is None else integrator,
            enable_collision=floor is not None,
            disable_constraint=floor is None,
            **({} if floor is None else contacts),
        ),
        show_viewer=False,
    )
    body = scene.add_entity(genesis.morphs.MJCF(file=MODEL.format(*inertia), align=False))
    ground = None if floor is None else scene.add_entity(genesis.morphs.Plane(normal=(0.0, 1.0, 0.0)))
    scene.build(n_envs=1)
    if floor is not None:
        for geom in (*body.geoms, *ground.geoms):
            geom.set_friction(floor[0])
            geom.set_sol_params(np.array([floor[1], 1e6, 0.9999, 0.9999, 0.001, 0.5, 2.0]))
    body.set_qpos(np.array([[*start, 1.0, 0.0, 0.0, 0.0]]))
    body.set_dofs_velocity(np.array([velocity]))
    rows = []
    for _ in range(round(duration / dt)):
        scene.step()
        rows.append(np.concatenate([body.get_qpos().numpy()[0, :3], body.get_dofs_velocity().numpy()[0]]))
    scene.destroy()
    return np.array(rows)


def exact_spin():
    """The angular velocity of the tumbling body in its frame after 1 s; the moments of inertia may all be larger or smaller by a factor."""

    def rate(_, w):
        return np.cross(INERTIA * w, w) / INERTIA

    return solve_ivp(rate, (0.0, 1.0), SPIN, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]


def tumbling():
    """The order of the error of the body's angular velocity after 1 s."""
    exact = exact_spin()
    for name in ("approximate_implicitfast", "Euler"):
        scheme = getattr(genesis.integrator, name)
        ends = [motion(1.0, dt, velocity=(0.0, 0.0, 0.0, *SPIN), integrator=scheme)[-1, 6:] for dt in (0.02, 0.01, 0.005)]
        errors = [np.linalg.norm(end - exact) for end in ends]
        energy = 0.5 * np.sum(INERTIA * ends[-1] ** 2) / (0.5 * np.sum(INERTIA * SPIN**2)) - 1.0
        print(f"{name}: errors of the angular velocity {np.array(errors)}, order {np.log2(errors[1] / errors[2]):.1f}, energy {energy:.1e}")


def falling():
    """The position error after 1 s of fall at 1 ms: half a step of g t."""
    end = motion(1.0, 1e-3, gravity=G)[-1]
    print(f"a fall of 1 s at 1 ms: position error {end[1] + 0.5 * G:.2e} m")


def sliding():
    """The deceleration of a ball of large inertia on a floor without friction."""
    rows = motion(1.0, 1e-3, (0.0, 0.1, 0.0), (1.0, *(0.0,) * 5), np.full(3, 1e3), G, floor=(0.0, 2e-3))
    print(f"a coefficient of 0: a body that slides at 1 m/s loses {1.0 - rows[-1, 3]:.4f} m/s in 1 s; 0.01 g is {0.01 * G:.4f}")


def bouncing():
    """The speed after an impact with time constants of less than two steps."""
    for constant in (2e-3, 1e-3, 2e-3 / 1.5):  # of a restitution of 0, 1 and 0.5, if it were used
        rows = motion(0.5, 1e-3, (0.0, 0.6, 0.0), gravity=G, inertia=np.full(3, 0.004), floor=(1.0, constant))
        print(f"a time constant of {constant:.2e} s at 1 ms: largest upward speed after an impact {rows[:, 4].max():.1e} m/s")


def tumbling_small(precision):
    """How much the angular velocity changes in 1 s of tumbling, for gyroscopic torques of 1e-3 and 1e-8 N m."""
    exact = np.linalg.norm(exact_spin() - SPIN)
    for scale in (1.0, 1e-5):
        rows = motion(1.0, 1e-3, velocity=(0.0, 0.0, 0.0, *SPIN), inertia=scale * INERTIA)
        change = np.linalg.norm(rows[-1, 6:] - SPIN)
        print(f"{precision} bits, inertia times {scale:g}: the angular velocity changes by {change:.4f} rad/s, exact {exact:.4f}")


if __name__ == "__main__":
    genesis.init(backend=genesis.cpu, precision="64", logging_level=logging.CRITICAL)
    tumbling()
    falling()
    sliding()
    bouncing()
    tumbling_small(64)
    genesis.destroy()
    genesis.init(backend=genesis.cpu, precision="32", logging_level=logging.CRITICAL)
    tumbling_small(32)
