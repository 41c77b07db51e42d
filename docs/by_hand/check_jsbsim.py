"""Findings about JSBSim in JSBSim alone: `pip install jsbsim scipy`, then `python docs/by_hand/check_jsbsim.py`.

A body of 1 kg in space, with an external force as its weight and external moments as damping; feet, slugs and pounds are taken as metres,
kilograms and newtons. Closed forms, or Euler's equations solved by SciPy's DOP853, are the exact solution.
"""

import warnings
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import jsbsim
import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

INERTIA, SPIN = np.array([0.00189422, 0.00621102, 0.00719467]), np.radians([25.0, -15.0, 40.0])  # kg m², rad/s
GRAVITY = 9.8  # m/s²
POUNDS = 32.174049  # JSBSim's weight of a slug
DEFAULT = (1, 1, 3, 4)  # rates and positions of rotation, then of translation: Euler, Euler, Adams-Bashforth of second and third order
BUSS_2, TRAPEZOIDAL, ADAMS_BASHFORTH_5, EULER_LAST = (3, 7, 3, 3), (2, 2, 2, 2), (9, 9, 9, 9), (1, 1, 3, 1)
METHODS = [f"simulation/integrator/{of}/{motion}" for motion in ("rotational", "translational") for of in ("rate", "position")]
RATES = [f"velocities/{rate}i-rad_sec" for rate in "pqr"]
PLACE, VELOCITY = ([f"{what}-{axis}-{unit}" for axis in "xyz"] for what, unit in (("position/eci", "ft"), ("velocities/eci", "fps")))
PLANET = """<planet name="none"> <equatorial_radius>1</equatorial_radius> <polar_radius>1</polar_radius>
<rotation_rate>0</rotation_rate> <GM>1e-300</GM> <J2>0</J2> </planet>"""
BODY = """<fdm_config name="body" version="2.0"> <metrics/> <ground_reactions/> <aerodynamics/>
<mass_balance> <emptywt>{weight!r}</emptywt> <ixx>{inertia[0]!r}</ixx> <iyy>{inertia[1]!r}</iyy> <izz>{inertia[2]!r}</izz> </mass_balance>
<external_reactions> <force name="weight" frame="INERTIAL"> <location/> <direction><y>-1</y></direction> </force> {damping}
</external_reactions> </fdm_config>"""
MOMENT = """<moment name="about-{axis}" frame="BODY"> <direction><{axis}>1</{axis}></direction>
<function><product><value>{rate!r}</value><property>{of}</property></product></function> </moment>"""
START = """<initialize name="start" version="2.0"> <position frame="ECI"><x>0.3</x><y>0.4</y><z>0.5</z></position>
<velocity frame="ECI"><x>{velocity[0]!r}</x><y>{velocity[1]!r}</y><z>{velocity[2]!r}</z></velocity>
<orientation frame="ECI"><x>0</x><y>0</y><z>0</z></orientation>
<attitude_rate frame="BODY"><x>{spin[0]!r}</x><y>{spin[1]!r}</y><z>{spin[2]!r}</z></attitude_rate> </initialize>"""


def motion(methods, duration, dt, spin=SPIN, inertia=INERTIA, velocity=(0.0, 0.0, 0.0), gravity=0.0, damping=0.0):
    """Displacements, velocities, rotation matrices and body rates at each step; damping is a torque of -damping times L."""
    drag = "".join(
        MOMENT.format(axis=axis, rate=-damping * moment, of=of) for axis, moment, of in zip("xyz", inertia.tolist(), RATES, strict=True)
    )
    with TemporaryDirectory() as folder:
        for name, text in {
            "planet": PLANET,
            "body": BODY.format(weight=POUNDS, inertia=inertia.tolist(), damping=drag if damping else ""),
            "start": START.format(velocity=list(velocity), spin=np.array(spin, dtype=float).tolist()),
        }.items():
            (Path(folder) / f"{name}.xml").write_text(text)
        executive = jsbsim.FGFDMExec(folder)
        executive.load_planet(f"{folder}/planet.xml", False)
        executive.load_model_with_paths("body", folder, folder, folder, False)
        executive.get_ic().load(f"{folder}/start.xml", False)
    executive.set_dt(dt)
    executive["simulation/gravity-model"], executive["external_reactions/weight/magnitude"] = 0, gravity
    for name, number in zip(METHODS, methods, strict=True):
        executive[name] = number
    executive.run_ic()
    rows = [_state(executive)]
    for _ in range(round(duration / dt)):
        executive.run()
        rows.append(_state(executive))
    place, v, turned, w = (np.array(column) for column in zip(*rows, strict=True))
    return place - place[0], v, turned, w


def _state(executive):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PendingDeprecationWarning)  # of numpy.matrix
        turned = np.asarray(executive.get_propagate().get_Tec2b()).T
    return *([executive[name] for name in names] for names in (PLACE, VELOCITY)), turned, [executive[name] for name in RATES]


def orientation_error(methods, duration, dt, spin=SPIN, damping=0.0):
    """The largest angle between JSBSim's orientation of the tumbling brick and the exact one [rad]."""
    found = motion(methods, duration, dt, spin, damping=damping)[2]
    times = dt * np.arange(len(found))

    def euler(_, y):
        q, w = y[:4], y[4:]
        return [*(0.5 * (q[3] * w + np.cross(q[:3], w))), -0.5 * q[:3] @ w, *(np.cross(INERTIA * w, w) / INERTIA - damping * w)]

    exact = solve_ivp(euler, (0.0, times[-1]), [0.0, 0.0, 0.0, 1.0, *spin], "DOP853", times, rtol=1e-13, atol=1e-14).y[:4].T
    return (Rotation.from_matrix(found) * Rotation.from_quat(exact).inv()).magnitude().max()


def energy_error(dt):
    """The relative energy error of the tumbling brick after 30 s, by the default methods."""
    w = motion(DEFAULT, 30.0, dt)[3]
    energies = (INERTIA * w**2).sum(axis=1)
    return energies[-1] / energies[0] - 1.0


def constant_spin_error(methods, dt, rate=5.0):
    """The largest angle between a spin of 5 rad/s about a principal axis and the exact one, in 10 s [rad]."""
    found = motion(methods, 10.0, dt, [0.0, rate, 0.0])[2]
    exact = Rotation.from_rotvec(np.outer(rate * dt * np.arange(len(found)), [0.0, 1.0, 0.0]))
    return (Rotation.from_matrix(found) * exact.inv()).magnitude().max()


def position_errors(methods, dt):
    """Errors of the position in a fall of 1 s [m], shape (steps + 1, 3)."""
    found = motion(methods, 1.0, dt, [0.0, 5.0, 0.0], velocity=(1.0, 2.0, 0.0), gravity=GRAVITY)[0]
    t = dt * np.arange(len(found))
    return found - np.stack([t, 2.0 * t - 0.5 * GRAVITY * t**2, 0.0 * t], axis=1)


def position_error(methods, dt):
    """The largest error of the position in a fall of 1 s [m]."""
    return np.linalg.norm(position_errors(methods, dt), axis=1).max()


def line(what, measured, expected, stated):
    """Print a finding."""
    print(f"{what}: measured {measured}, exact {expected}; docs/engines.md: {stated}", flush=True)


def ratios(errors):
    """Ratios of successive errors."""
    return ", ".join(f"{a / b:.2f}" for a, b in pairwise(errors))


if __name__ == "__main__":
    jsbsim.FGJSBBase().debug_lvl = 0
    jsbsim.set_logger(jsbsim.DefaultLogger(jsbsim.LogLevel.ERROR))
    halved = "ratios of errors as the step is halved"
    for name, methods, order in (("default", DEFAULT, 1), ("buss-2", BUSS_2, 2), ("adams-bashforth-5", ADAMS_BASHFORTH_5, 2)):
        errors = [orientation_error(methods, 30.0, dt) for dt in (0.02, 0.01, 0.005)]
        line(f"{name}, tumbling, orientation: {halved}", ratios(errors), f"2^order = {2**order}", f"order {order}")
    errors = [orientation_error(ADAMS_BASHFORTH_5, 10.0, dt, [2.0, -1.0, 3.0], 0.5) for dt in (4e-3, 2e-3, 1e-3)]
    line(f"adams-bashforth-5, tumbling with damping, orientation: {halved}", ratios(errors), "2^order = 4", "order 2")
    line("default, tumbling, 1 ms: energy error", f"{energy_error(1e-3):.2e}", 0, "2.0e-3")
    line("default, constant spin, 1 ms: orientation error [rad]", f"{constant_spin_error(DEFAULT, 1e-3):.2e}", 0, "1.0e-4")
    line("buss-2, constant spin, 1 ms: orientation error [rad]", f"{constant_spin_error(BUSS_2, 1e-3):.1e}", 0, "< 1e-12")
    line("trapezoidal, fall, 1 ms: position error [m]", f"{position_error(TRAPEZOIDAL, 1e-3):.2e}", 0, "9.8e-3")
    line("default, but Euler for the position, fall, 1 ms: position error [m]", f"{position_error(EULER_LAST, 1e-3):.2e}", 0, "4.9e-3")
    line(
        "One step of Euler's method behind: g dt t/2 [m]",
        f"{GRAVITY * 1e-3 / 2:.2e}",
        "4.9e-3",
        "the line above",
    )
    errors = [position_error(ADAMS_BASHFORTH_5, dt) for dt in (4e-3, 2e-3, 1e-3)]
    line(f"adams-bashforth-5, fall, position: {halved}", ratios(errors), "2^order = 4", "order 2")
    heights = position_errors(DEFAULT, 4e-3)[:, 1] / (GRAVITY * 4e-3**2)
    steps = ", ".join(f"{heights[step]:.4f}" for step in (1, 2, 3, -1))
    line("default, fall, 4 ms: error of the height after 1, 2, 3 and 250 steps [g dt²]", steps, 0, "1/12 from the second step on")
