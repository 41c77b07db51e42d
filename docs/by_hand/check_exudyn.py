"""Findings about Exudyn in Exudyn alone: `pip install exudyn scipy`, then `python docs/by_hand/check_exudyn.py`.

A brick of 1 kg tumbles freely; Euler's equations solved by SciPy's DOP853 are the exact solution.
"""

from itertools import pairwise

import exudyn as exu
import numpy as np
from exudyn import utilities
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

INERTIA, SPIN = np.array([0.00189422, 0.00621102, 0.00719467]), np.radians([25.0, -15.0, 40.0])  # kg m², rad/s


def solved(system, sensor, duration, dt, solver="GeneralizedAlpha", relative=1e-8, absolute=1e-10, gamma=0.5):
    """The times and the values of a sensor after each step; the tolerances are Exudyn's own by default, as is Newmark's gamma."""
    settings = exu.SimulationSettings()
    time, solution = settings.timeIntegration, settings.solution
    time.numberOfSteps, time.endTime = round(duration / dt), duration
    time.newton.relativeTolerance, time.newton.absoluteTolerance = relative, absolute
    time.generalizedAlpha.newmarkGamma = gamma
    solution.file.write, solution.sensors.writePeriod = False, dt
    system.SolveDynamic(settings, solverType=getattr(exu.DynamicSolverType, solver))
    rows = system.GetSensorStoredData(sensor)
    return rows[:, 0], rows[:, 1:]


def sensor_of(system, node, output):
    """A sensor of a node that stores what it reads."""
    kind = getattr(exu.OutputVariableType, output)
    return system.AddSensor(utilities.SensorNode(nodeNumber=node, outputVariableType=kind, storeInternal=True, writeToFile=False))


def orientation_error(solver, dt, duration=30.0, spin=SPIN, damping=0.0, gamma=0.5):
    """The largest angle between Exudyn's orientation and the exact one [rad]; damping is a torque of -damping times L."""
    times, found = tumbled(solver, dt, duration, spin, damping, relative=1e-13, absolute=0.0, gamma=gamma)

    def euler(_, y):
        q, w = y[:4], y[4:]
        return [*(0.5 * (q[3] * w + np.cross(q[:3], w))), -0.5 * q[:3] @ w, *(np.cross(INERTIA * w, w) / INERTIA - damping * w)]

    exact = solve_ivp(euler, (0.0, times[-1]), [0.0, 0.0, 0.0, 1.0, *spin], "DOP853", times, rtol=1e-13, atol=1e-14).y[:4].T
    return (Rotation.from_matrix(found.reshape(-1, 3, 3)) * Rotation.from_quat(exact).inv()).magnitude().max()


def units_error(**tolerances):
    """The largest angle between the motions of the brick in metres and in millimetres, in 30 s at 1 ms [rad]."""
    motions = [tumbled("GeneralizedAlpha", 1e-3, 30.0, SPIN, unit=unit, **tolerances)[1].reshape(-1, 3, 3) for unit in (1.0, 1e3)]
    return (Rotation.from_matrix(motions[0]) * Rotation.from_matrix(motions[1]).inv()).magnitude().max()


def tumbled(solver, dt, duration, spin, damping=0.0, unit=1.0, **settings):
    """The times and the rotation matrices of the tumbling brick; the unit of length is 1 m divided by `unit`."""
    inertia = INERTIA * unit**2
    container = exu.SystemContainer()
    system = container.AddSystem()
    node = system.AddNode(utilities.NodeRigidBodyRotVecLG(referenceCoordinates=[0.0] * 6, initialVelocities=[0.0, 0.0, 0.0, *spin]))
    body = system.AddObject(utilities.ObjectRigidBody(mass=1.0, inertia=[*inertia, 0.0, 0.0, 0.0], nodeNumber=node))
    if damping:
        ends = [system.AddMarker(utilities.MarkerBodyRigid(bodyNumber=one)) for one in (body, system.AddObject(utilities.ObjectGround()))]
        rates = np.diag([0.0, 0.0, 0.0, *(damping * inertia)])
        system.AddObject(utilities.ObjectConnectorRigidBodySpringDamper(markerNumbers=ends, stiffness=np.zeros((6, 6)), damping=rates))
    sensor = sensor_of(system, node, "RotationMatrix")
    system.Assemble()
    return solved(system, sensor, duration, dt, solver, **settings)


def rebound(stiffness, gravity):
    """The restitution of a ball that strikes a spring at 4.4 m/s with `restitutionCoefficient` 0.5, in steps of 0.01 ms."""
    container = exu.SystemContainer()
    system = container.AddSystem()
    node = system.AddNode(
        utilities.NodeRigidBodyRotVecLG(
            referenceCoordinates=[0.0, 0.11, 0.0, 0.0, 0.0, 0.0], initialVelocities=[0.0, -4.4, 0.0, 0.0, 0.0, 0.0]
        )
    )
    body = system.AddObject(utilities.ObjectRigidBody(mass=1.0, inertia=[0.004, 0.004, 0.004, 0.0, 0.0, 0.0], nodeNumber=node))
    weight = system.AddMarker(utilities.MarkerBodyMass(bodyNumber=body))
    system.AddLoad(utilities.LoadMassProportional(markerNumber=weight, loadVector=[0.0, -gravity, 0.0]))
    ground = system.AddObject(utilities.ObjectGround(referencePosition=[0.0, -0.1, 0.0]))
    balls = [system.AddMarker(utilities.MarkerBodyRigid(bodyNumber=one)) for one in (ground, body)]
    memory = system.AddNode(utilities.NodeGenericData(initialCoordinates=[0.01, 0.0, 0.0, 0.0], numberOfDataCoordinates=4))
    contact = {"spheresRadii": [0.1, 0.1], "contactStiffness": stiffness, "restitutionCoefficient": 0.5, "impactModel": 2}
    system.AddObject(utilities.ObjectContactSphereSphere(markerNumbers=balls, nodeNumber=memory, **contact))
    sensor = sensor_of(system, node, "Velocity")
    system.Assemble()
    v = solved(system, sensor, 0.1, 1e-5)[1][:, 1]
    return -v.max() / v.min()


def line(what, measured, expected, stated):
    """Print a finding."""
    print(f"{what}: measured {measured}, exact {expected}; docs/engines.md: {stated}", flush=True)


if __name__ == "__main__":
    line("generalized-alpha at 1 ms: orientation error [rad]", f"{orientation_error('GeneralizedAlpha', 1e-3):.2e}", 0, "1.7e-7")
    damped = {"duration": 10.0, "spin": [2.0, -1.0, 3.0], "damping": 0.5}
    for name, solver, steps, order, motion in (
        ("generalized-alpha", "GeneralizedAlpha", (0.1, 0.05, 0.025), 2, {}),
        (
            "generalized-alpha, damped",
            "GeneralizedAlpha",
            (4e-3, 2e-3, 1e-3),
            2,
            {"duration": 10.0, "spin": [2.0, -1.0, 3.0], "damping": 0.5},
        ),
        ("trapezoidal, gamma 0.6", "TrapezoidalIndex2", (0.01, 0.005, 0.0025), 1, {"gamma": 0.6}),
        ("rk44", "RK44", (0.1, 0.05, 0.025), 4, {}),
        ("rk67", "RK67", (0.4, 0.2, 0.1), 6, {}),
    ):
        errors = [orientation_error(solver, dt, **motion) for dt in steps]
        ratios = ", ".join(f"{a / b:.1f}" for a, b in pairwise(errors))
        line(f"{name}: ratios of orientation errors as the step is halved", ratios, f"2^order = {2**order}", f"order {order}")
    for name, tolerances, stated in (
        ("Exudyn's", {}, "1.4e-7, as dropspin takes each step by itself"),
        ("1e-13 and 0", {"relative": 1e-13, "absolute": 0.0}, "calibrated"),
    ):
        line(f"In millimetres, tolerances {name}: difference [rad]", f"{units_error(**tolerances):.1e}", 0, stated)
    for stiffness, stated in ((1e4, 0.481), (1e6, 0.498)):
        line(f"Contact of {stiffness:.0e} N/m: restitution", f"{rebound(stiffness, 9.8):.3f}", 0.5, stated)
        line("Without gravity", f"{rebound(stiffness, 0.0):.3f}", 0.5, "0.500")
