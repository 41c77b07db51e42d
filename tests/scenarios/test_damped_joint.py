"""The fall and the spin that damping and armature give, compared with 40 digits by Taylor series, with MuJoCo and with PyBullet."""

import numpy as np
import pytest
from mpmath import mp, mpf
from support.taylor import Solution

from dropspin.scenarios.mechanics import angular_momentum_of, kinetic_energy_of
from dropspin.scenarios.rotations import angle_between_orientations, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY
from dropspin.scenarios.truths.damped_joint import (
    bullet_damping,
    fall,
    free_motion,
    joint_damping,
    spin_about_axis,
    terminal_speed,
    time_constant,
)
from dropspin.scenarios.truths.free_rotor import free_rotor

MOMENTS = np.array([0.01, 0.02, 0.025])
SPIN_3D = np.array([3.0, 4.0, 5.0])
TIMES = [1e-3, 0.3, 2.0]
COEFFICIENTS = [(0, 0), (1e-14, 0), (0, 1e-14), (1e-6, 1e-9), (0.3, 0), (0, 0.2), (0.4, 0.3), (5, 1e-5), (1e-5, 5), (9, 9)]


@pytest.mark.parametrize(("linear", "quadratic"), COEFFICIENTS)
@pytest.mark.parametrize("armature", [0.0, 0.7])
def test_fall_matches_forty_digits(linear, quadratic, armature):
    """To 1e-15 of the value (measured 6e-16), by Taylor series of (m + a) v' = m g - c₁ v - c₂ v²; a formula with 1/c₂ loses all."""
    with mp.workdps(60):
        total = mpf(1.3) + mpf(armature)
        pull, c1, c2 = mpf(1.3) * mpf(9.81) / total, mpf(linear) / total, mpf(quadratic) / total
    exact = Solution(lambda y: [y[1], y[2] * pull - y[1] * c1 - y[1] * y[1] * c2, 0 * y[2]], (0, 0, 1), "0.1")
    for t in TIMES:
        found = fall(t, 9.81, 1.3, armature, linear, quadratic)
        np.testing.assert_allclose([float(value) for value in found], [float(value) for value in exact(t)[:2]], rtol=1e-15)


def test_fall_is_accurate_far_beyond_the_terminal_speed():
    """m/c₂ log cosh(βt), which overflows as written at βt = 710: here βt = 990."""
    fallen, speed = fall(np.array([1000.0]), 9.81, 1.0, quadratic=0.1)
    beta = np.sqrt(0.1 * 9.81)
    np.testing.assert_allclose(fallen, 10.0 * (beta * 1000.0 - np.log(2.0)), rtol=1e-15)
    assert speed == pytest.approx(terminal_speed(9.81, 1.0, quadratic=0.1), rel=1e-15)


@pytest.mark.parametrize("coefficients", [(0.3, 0, 0), (0, 0.2, 0), (0, 0, 0.1), (0.3, 0.2, 0.1), (1e-9, 0, 1e-12)])
def test_damping_balances_the_weight_at_the_terminal_speed(coefficients):
    speed = terminal_speed(9.81, 2.0, *coefficients)
    assert sum(c * speed**n for n, c in enumerate(coefficients, 1)) == pytest.approx(2.0 * 9.81, rel=1e-13)


def test_terminal_speed_is_infinite_without_damping():
    assert terminal_speed(9.81, 2.0) == time_constant(3.0, 2.0) == np.inf


@pytest.mark.parametrize(("linear", "quadratic"), COEFFICIENTS)
@pytest.mark.parametrize("spin", [3.0, -3.0])
def test_spin_about_an_axis_matches_forty_digits(linear, quadratic, spin):
    with mp.workdps(60):
        c1, c2, total = mpf(linear), mpf(quadratic) * (-1) ** (spin < 0), mpf(0.5) + mpf(0.25)
    exact = Solution(lambda w: [w[0] * (-c1 / total) - w[0] * w[0] * (c2 / total)], [spin], "0.02")
    for t in TIMES:
        expected = float(exact(t)[0])
        assert spin_about_axis(t, spin, 0.5, 0.25, linear, quadratic) == pytest.approx(expected, rel=1e-14, abs=1e-30)
    if linear or quadratic:
        settled = spin_about_axis(time_constant(spin, 0.5, 0.25, linear, quadratic), spin, 0.5, 0.25, linear, quadratic)
        assert settled == pytest.approx(spin / np.e, rel=1e-14)


def start(velocity=(0.5, 0.0, 1.0), spin=SPIN_3D, position=(0.0, 0.0, 0.0)):
    return np.concatenate([position, [0.0, 0.0, 0.0, 1.0], velocity, spin])


@pytest.mark.parametrize(("armature", "linear", "cubic"), [(0.03, 0.0, 0.0), (0.0, 0.02, 0.0), (0.03, 0.02, 0.001)])
def test_spin_with_armature_and_damping_matches_forty_digits(armature, linear, cubic):
    """(I + a) ω' = -ω × I ω - c₁ ω - c₃ ω³ by Taylor series: attitude and spin to 1e-11 (measured 3e-12)."""
    with mp.workdps(60):
        I1, I2, I3 = map(mpf, MOMENTS)
        shares = [1 / (mpf(moment) + mpf(armature)) for moment in MOMENTS]
        gaps = [I2 - I3, I3 - I1, I1 - I2]

    def rates(y):
        w, (x, yy, z, s) = y[:3], y[3:]
        products = (w[1] * w[2], w[2] * w[0], w[0] * w[1])
        spins = [(p * gap - linear * v - cubic * (v * v * v)) * share for p, gap, v, share in zip(products, gaps, w, shares, strict=True)]
        turns = (s * w[0] + yy * w[2] - z * w[1], s * w[1] + z * w[0] - x * w[2], s * w[2] + x * w[1] - yy * w[0])
        return [*spins, *(0.5 * turn for turn in turns), -0.5 * (x * w[0] + yy * w[1] + z * w[2])]

    exact = Solution(rates, [*SPIN_3D, 0, 0, 0, 1], "0.05")
    damping = joint_damping(linear, cubic=cubic)
    states = free_motion(np.array([0.0, *TIMES]), start(), 2.0, np.diag(MOMENTS), np.zeros(3), damping, armature=armature)
    for state, t in zip(states[1:], TIMES, strict=True):
        expected = np.array([float(value) for value in exact(t)])
        np.testing.assert_allclose(unrotate(state[ORIENTATION], state[SPIN]), expected[:3], rtol=0, atol=1e-11)
        assert angle_between_orientations(state[ORIENTATION], expected[3:]) <= 1e-11


def energy_and_momentum(states, moments):
    attitude, velocity, spin = (tuple(states[:, part].T) for part in (ORIENTATION, VELOCITY, SPIN))
    inertia = tuple(map(tuple, np.diag(moments)))
    momentum = np.linalg.norm(angular_momentum_of(inertia, attitude, spin), axis=0)
    return kinetic_energy_of(0.0, inertia, attitude, velocity, spin), momentum


@pytest.mark.parametrize(("armature", "spin", "conserved"), [(0.0, SPIN_3D, True), (0.03, (0, 5, 0), True), (0.03, SPIN_3D, False)])
def test_armature_spins_the_body_as_if_its_moments_were_larger(armature, spin, conserved):
    """To 1e-11 the free rotor of the moments I + a, whose energy and angular momentum are constant.

    Those of the moments I are constant about a principal axis alone: about (3, 4, 5), the energy is between .989 and 1.014 of its start.
    """
    times = np.linspace(0.0, 3.0, 50)
    states = free_motion(times, start(spin=spin), 2.0, np.diag(MOMENTS), np.zeros(3), joint_damping(0.0), armature=armature)
    attitude, spins = free_rotor(np.diag(MOMENTS + armature), start()[ORIENTATION], np.array(spin, dtype=float))(times)
    assert angle_between_orientations(states[:, ORIENTATION], attitude).max() <= 1e-11
    np.testing.assert_allclose(states[:, SPIN], spins, rtol=0, atol=1e-11)
    for quantity in energy_and_momentum(states, MOMENTS):
        change = np.abs(quantity / quantity[0] - 1.0).max()
        assert change <= 1e-11 if conserved else change >= 0.009


def mujoco_motion(joint, velocity, spin, centre):
    """The state of the centre of mass after 1 s of steps of .5 ms with RK4, whose error is 1e-11."""
    import mujoco

    moments, offset = (" ".join(map(str, values)) for values in (MOMENTS, centre))
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="5e-4" integrator="RK4"/><worldbody><body><joint type="free" {joint}/>'
        f'<inertial pos="{offset}" mass="2" diaginertia="{moments}"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    data.qvel[:] = *velocity, *spin
    mujoco.mj_step(model, data, 2000)
    mujoco.mj_kinematics(model, data)
    return data.xipos[1].copy(), np.roll(data.qpos[3:], -1), data.qvel[3:].copy()


JOINTS = {
    'damping="0.01"': (0.0, (0.01, 0.0, 0.0)),
    'armature="0.02"': (0.02, (0.0, 0.0, 0.0)),
    'armature="0.02" damping="0.01 0.02 0.003"': (0.02, (0.01, 0.02, 0.003)),
}


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.0), (0.1, 0.05, -0.03)])
def test_free_joint_of_mujoco_has_this_motion(joint, centre):
    """With the centre of mass away from the joint's origin, damping and armature turn the falling body."""
    armature, coefficients = JOINTS[joint]
    offset, velocity = np.array(centre), np.array([0.5, 0.0, 1.0])
    begin = start(velocity + np.cross(SPIN_3D, offset), position=offset)
    gravity, damping = np.array([0.0, 0.0, -9.81]), joint_damping(*coefficients)
    state = free_motion(np.array([0.0, 1.0]), begin, 2.0, np.diag(MOMENTS), gravity, damping, armature=armature, centre=offset)[-1]
    position, attitude, spin = mujoco_motion(joint, velocity, SPIN_3D, centre)
    np.testing.assert_allclose(state[POSITION], position, rtol=0, atol=1e-9)
    assert angle_between_orientations(state[ORIENTATION], attitude) <= 1e-9
    np.testing.assert_allclose(unrotate(state[ORIENTATION], state[SPIN]), spin, rtol=0, atol=1e-9)


@pytest.mark.parametrize("joint", ['damping="0.01"', 'damping="0.01 0.02"', 'armature="0.5"', 'armature="0.5" damping="0.3 0.2"'])
def test_free_joint_of_mujoco_falls_and_spins_by_the_closed_forms(joint):
    armature = 0.5 if "armature" in joint else 0.0
    linear, quadratic = {"0.01": (0.01, 0), "0.01 0.02": (0.01, 0.02), "0.3 0.2": (0.3, 0.2)}.get(joint.split('"')[-2], (0, 0))
    position, _, spin = mujoco_motion(joint, np.zeros(3), (0.0, 7.0, 0.0), np.zeros(3))
    assert -position[2] == pytest.approx(fall(1.0, 9.81, 2.0, armature, linear, quadratic)[0], rel=1e-9)
    assert spin[1] == pytest.approx(spin_about_axis(1.0, 7.0, MOMENTS[1], armature, linear, quadratic), rel=1e-8, abs=1e-12)


def test_stiff_damping_is_integrated():
    """A time constant of 1 µs, of a pea of 1e-8 kg m² with damping .01, over 1 s."""
    states = free_motion(np.array([0.0, 1.0]), start(), 1e-3, 1e-8 * np.eye(3), np.array([0.0, -9.81, 0.0]), joint_damping(0.01))
    fallen, speed = fall(1.0, 9.81, 1e-3, linear=0.01)
    rise = 0.1 * -np.expm1(-10.0)  # of the velocity along z
    assert states[-1, 8] == pytest.approx(-speed, rel=1e-10)
    np.testing.assert_allclose(states[-1, POSITION], [0.5 * rise, -fallen, rise], rtol=1e-10)
    assert np.abs(states[-1, SPIN]).max() <= 1e-12


BLOCK = """<robot name="block"><link name="block"><inertial><mass value="2"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.025"/></inertial></link></robot>"""


def bullet_motion(path, dt):
    """Position, velocity, attitude and spin after 1 s with PyBullet's default damping."""
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setTimeStep(dt, physicsClientId=client)
        pybullet.setGravity(0.0, 0.0, -9.81, physicsClientId=client)
        body = pybullet.loadURDF(str(path), flags=pybullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client)
        pybullet.resetBaseVelocity(body, (0.5, 0.0, 1.0), SPIN_3D, physicsClientId=client)
        for _ in range(round(1.0 / dt)):
            pybullet.stepSimulation(physicsClientId=client)
        found = pybullet.getBasePositionAndOrientation(body, physicsClientId=client), pybullet.getBaseVelocity(body, physicsClientId=client)
        return np.concatenate([*found[0], *found[1]])
    finally:
        pybullet.disconnect(client)


def test_multibody_of_pybullet_has_this_damping(tmp_path):
    """Extrapolated from steps of .5 and 1 ms to 0: to 2e-5 m, rad, m/s and rad/s (measured 8e-6)."""
    path = tmp_path / "block.urdf"
    path.write_text(BLOCK)
    extrapolated = 2.0 * bullet_motion(path, 5e-4) - bullet_motion(path, 1e-3)
    inertia = np.diag(MOMENTS)
    state = free_motion(np.array([0.0, 1.0]), start(), 2.0, inertia, np.array([0.0, 0.0, -9.81]), bullet_damping(2.0, inertia))[-1]
    assert angle_between_orientations(extrapolated[ORIENTATION], state[ORIENTATION]) <= 2e-5
    for part in (POSITION, VELOCITY, SPIN):
        np.testing.assert_allclose(extrapolated[part], state[part], rtol=0, atol=2e-5)


def test_default_damping_of_pybullet_has_these_values():
    """Terminal speed 15.168 m/s; of 10 rad/s, half the energy is lost in 1 s."""
    fallen, speed = fall(1.0, 9.81, 1.0, linear=0.04, quadratic=0.04)
    found = [terminal_speed(9.81, 1.0, 0.04, 0.04), speed, fallen, spin_about_axis(1.0, 10.0, 1.0, linear=0.04, quadratic=0.04)]
    np.testing.assert_allclose(found, [15.168439615992398, 8.54806575505472, 4.558187518993211, 6.901699363194228], rtol=1e-11)
