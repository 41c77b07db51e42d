"""Findings about brax in brax alone: `pip install brax scipy`, then `python docs/by_hand/check_brax.py`.

Double precision; y is up, a step is 1 ms. It takes some minutes, most of them to compile.
"""

import warnings
from functools import cache

import jax
import numpy as np
from brax.generalized import pipeline as generalized_pipeline
from brax.io import mjcf
from brax.positional import pipeline as positional_pipeline
from brax.spring import pipeline as spring_pipeline
from jax import numpy as jnp
from scipy.spatial.transform import Rotation

PIPELINES = {"spring": spring_pipeline, "positional": positional_pipeline, "generalized": generalized_pipeline}
DT, G = 1e-3, 9.8  # s, m/s²
BALL, CUBE = 'type="sphere" size="0.1"', 'type="box" size="0.1 0.1 0.1"'
MODEL = """<mujoco><option timestep="{dt}" gravity="0 {gravity} 0"/><worldbody>
<geom type="plane" size="0 0 1" zaxis="0 1 0" friction="{friction} 0 0"/>
<body><freejoint/><inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia}"/><geom {shape} friction="{friction} 0 0"/></body>
</worldbody></mujoco>"""


@cache
def stepping(name):
    """The compiled function that takes a step of a pipeline."""
    return jax.jit(lambda system, state: PIPELINES[name].step(system, state, jnp.zeros(0)))


def motion(name, duration, start, velocity, shape=BALL, mass=1.0, inertia=(0.004,) * 3, gravity=-G, friction=0.0, **settings):
    """Positions, velocities and angular velocities after each step, shape (steps, 9)."""
    numbers = " ".join(map(str, inertia))
    text = MODEL.format(dt=DT, gravity=gravity, friction=friction, mass=mass, inertia=numbers, shape=shape)
    system = mjcf.loads(text)
    values = {key: jnp.full(jnp.shape(getattr(system, key)), float(value)) for key, value in settings.items()}
    system = system.replace(mj_model=None, **values)
    state = jax.jit(PIPELINES[name].init)(system, jnp.array(start, float), jnp.array(velocity, float))
    system, state = (jax.tree.map(lambda row: jnp.asarray(np.asarray(row)), part) for part in (system, state))  # else it compiles twice
    rows = []
    for _ in range(round(duration / DT)):
        state = stepping(name)(system, state)
        rows.append(np.concatenate([state.x.pos[0], state.xd.vel[0], state.xd.ang[0]]))
    return np.array(rows)


def upright(height):
    """A position at a height, with the orientation w first."""
    return [0.0, height, 0.0, 1.0, 0.0, 0.0, 0.0]


def tumbling(name):
    """The change of the angular velocity in 0.5 s without torques, of unequal moments of inertia."""
    rows = motion(name, 0.5, upright(10.0), [0.0, 0.0, 0.0, 1.0, 2.0, 3.0], inertia=(1.0, 2.0, 2.9))
    print(f"{name}: the angular velocity of a tumbling body changes from 1, 2, 3 rad/s to {rows[-1, 6:]} rad/s")


def spinning():
    """The energy of a rotation about a principal axis in the pipeline positional."""
    rows = motion("positional", 0.5, upright(10.0), [0.0, 0.0, 0.0, 5.0, 0.0, 0.0])
    print(
        f"positional: share of the energy of a rotation {(rows[-1, 6] / 5.0) ** 2:.6f}; 1/(1 + ω² t dt/4) = {1 / (1 + 25 * 0.5e-3 / 4):.6f}"
    )


def damped(name):
    """The decay of a velocity with a rate of 1/s in 0.5 s."""
    rows = motion(name, 0.5, upright(10.0), [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], vel_damping=-1.0)
    print(f"{name}: damped velocity {rows[-1, 3]:.6f} m/s; exp(-0.5) = {np.exp(-0.5):.6f}, exp(-1) = {np.exp(-1.0):.6f}")


def bouncing(name, shape=BALL, **settings):
    """The coefficient of restitution of a body that lands at rest of its rotation."""
    inertia = (0.004,) * 3 if shape == BALL else (0.02 / 3,) * 3
    speeds = motion(name, 0.45, upright(0.7), [0.0] * 6, shape, inertia=inertia, elasticity=0.5, **settings)[:, 4]
    print(f"{name}, {shape}, {settings}: restitution {speeds.max() / -speeds.min():.4f} instead of 0.5")


def sliding(mass):
    """The deceleration by friction in the pipeline positional, of a ball that hardly turns."""
    rows = motion("positional", 0.2, upright(0.1), [3.0, *[0.0] * 5], mass=mass, inertia=(1e4,) * 3, friction=0.3)
    print(f"positional: {mass} kg decelerate with {(3.0 - rows[-1, 3]) / 0.2 / G:.3f} g instead of 0.3 g")


def landing():
    """The speed after the impact of a corner, without friction and gravity, in the pipeline spring."""
    half, moments, turned = np.array([0.11, 0.2, 0.29]), np.array([0.05, 0.07, 0.1]), Rotation.from_euler("xyz", [1.2, 0.5, 0.4])
    corners = turned.apply(half * np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]))
    arm, up = corners[np.argmin(corners[:, 1])], np.array([0.0, 1.0, 0.0])
    axes = turned.as_matrix()
    inverse, lever = axes @ np.diag(1.0 / moments) @ axes.T, np.cross(arm, up)
    speeds = [1.5 / (1.0 + share) - 1.0 for share in (lever @ inverse @ lever, inverse[0, 0] * lever @ lever)]
    start = [0.0, 0.0005 - arm[1], 0.0, *np.roll(turned.as_quat(), 1)]
    shape = f'type="box" size="{half[0]} {half[1]} {half[2]}"'
    found = motion("spring", 2e-3, start, [0.0, -1.0, 0.0, 0.0, 0.0, 0.0], shape, 1.0, moments, 0.0, elasticity=0.5, baumgarte_erp=0.0)
    print(f"spring: speed after a corner impact {found[-1, 4]:.5f} m/s; exact {speeds[0]:.5f}, with one element of 1/I {speeds[1]:.5f}")


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    warnings.simplefilter("ignore")  # brax says that its pipelines are no longer maintained
    tumbling("spring")
    damped("spring")
    for share in (0.1, 0.0):
        bouncing("spring", baumgarte_erp=share)
    landing()
    bouncing("spring", CUBE, baumgarte_erp=0.0)
    tumbling("generalized")
    bouncing("generalized")
    tumbling("positional")
    spinning()
    damped("positional")
    bouncing("positional")
    sliding(1.0)
    sliding(2.0)
