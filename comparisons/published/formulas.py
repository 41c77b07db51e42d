"""Sources compared with exact solutions: rates that tools print, and formulas that sources give."""

import csv
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from dropspin.comparisons.published.results import EXACT, Result, Status, compared
from dropspin.comparisons.published.sources import DATA, Source
from dropspin.scenarios import Scenario, Truth, load
from dropspin.scenarios.mechanics import kinetic_energy
from dropspin.scenarios.rotations import about, conjugate, rotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, Array
from dropspin.scenarios.trajectory import Trajectory
from dropspin.scenarios.truths import exact_solution

RATES = ("roll", "pitch", "yaw")
DECIMALS = 12
"""Decimals to which formulas are compared, and of exact rates [deg/s]: measured rounding errors of both are below 3e-14."""
EPSILON = float(np.finfo(np.float64).eps)


def body_rates(states: Array) -> Array:
    """Angular velocities in the body frame [rad/s], shape (n, 3), of states, shape (n, 13)."""
    return rotate(conjugate(states[:, ORIENTATION]), states[:, SPIN])


def nesc_brick(source: Source) -> Iterator[Result]:
    """The rates of each tool beside the exact ones: its largest error, and for tools that agree with each other, their common decimals."""
    exact = exact_solution(source.scene("brick"))
    decimals = source.parameters["decimals"]
    with (DATA / source.parameters["rates"]).open(encoding="utf-8", newline="") as file:
        table = [(tool, list(rows)) for tool, rows in groupby(csv.DictReader(file), lambda row: row["tool"])]
    for tool, rows in table:
        times = np.array([float(row["time"]) for row in rows])
        printed = np.array([[float(row[rate]) for rate in RATES] for row in rows])
        rates = np.degrees(body_rates(exact.states(times)))
        name = f"sim {tool}"
        if tool in source.parameters["agree"]:
            equal = int(sum(f"{a:.{decimals}f}" == f"{b:.{decimals}f}" for a, b in zip(printed.flat, rates.flat, strict=True)))
            yield _count(source, name, f"{printed.size} rates, {decimals} decimals", printed.size, equal)
        worst, rate = np.unravel_index(np.argmax(np.abs(printed - rates)), printed.shape)
        quantity = f"{RATES[rate]}, {times[worst]:.0f} s [deg/s]"
        yield _error(source, name, quantity, rows[worst][RATES[rate]], float(rates[worst, rate]))


def _beside_exact(source: Source, tool: str, quantity: str, published: str, exact: float, significant: int = 0) -> Result:
    """A published value that is claimed to be exact beside the exact one."""
    return compared(Result(source.name, tool, quantity, published, "", EXACT, "not run"), exact, significant)


def _error(source: Source, tool: str, quantity: str, published: str, exact: float, decimals: int = DECIMALS) -> Result:
    """The error of a published value that is not claimed to be exact."""
    here, error = f"{exact:.{decimals}f}", float(published) - exact
    return Result(source.name, tool, quantity, published, here, EXACT, "error of the source", difference=error)


def _count(source: Source, tool: str, quantity: str, published: int, here: int) -> Result:
    """How many of some values have equal digits."""
    status: Status = "reproduced" if here == published else "differs"
    return Result(source.name, tool, quantity, f"{published} equal", f"{here} equal", EXACT, status, difference=float(here - published))


def kane_free_body(source: Source) -> Iterator[Result]:
    """Kane's solution of the axisymmetric body, and the simple rotations with which Drake tests it."""
    scene = source.scene("cylinder")
    truth = exact_solution(scene)
    *times, last = source.parameters["times"]
    for time in times:
        results = _kane_results(source, scene, truth, time)
        equal = sum(result.here == result.published for result in results)
        yield _count(source, "formula", f"{len(results)} values, {time:g} s", len(results), equal)
    yield from _kane_results(source, scene, truth, last)
    simple = source.parameters["simple"]
    for axis in simple["axes"]:
        yield _simple_rotation(source, scene, axis, simple["rate"], simple["time"])


def kane(scene: Scenario, t: float) -> dict[str, float]:
    """Orientation, angular velocity in the body frame [rad/s] and position [m] at a time [s], of a body that starts unturned.

    Source: T. R. Kane, P. W. Likins & D. A. Levinson, Spacecraft Dynamics (1983), sections 1.13 and 3.1, as in Drake's `free_body.cc`.
    """
    wx, wy, wz = scene.start.angular_velocity
    transverse, _, axial = map(float, np.diag(scene.body.inertia_tensor))
    s = (transverse - axial) / transverse * wz
    axial_rate = wz * axial / transverse
    p = math.sqrt(wx**2 + wy**2 + axial_rate**2)
    sp, cp, ss, cs = math.sin(p * t / 2), math.cos(p * t / 2), math.sin(s * t / 2), math.cos(s * t / 2)
    position = np.array(scene.start.position) + np.array(scene.start.velocity) * t + 0.5 * scene.acceleration * t**2
    return {
        "qx": sp / p * (wx * cs + wy * ss),
        "qy": sp / p * (wy * cs - wx * ss),
        "qz": axial_rate / p * sp * cs + cp * ss,
        "qw": cp * cs - axial_rate / p * sp * ss,
        "ωx": wx * math.cos(s * t) + wy * math.sin(s * t),
        "ωy": wy * math.cos(s * t) - wx * math.sin(s * t),
        "ωz": wz,
        **{axis: float(value) for axis, value in zip("xyz", position, strict=True)},
    }


def _kane_results(source: Source, scene: Scenario, truth: Truth, t: float) -> list[Result]:
    """Kane's values beside the exact ones; of the two quaternions of the orientation, the one nearer to the published one."""
    published, state = kane(scene, t), truth.states(np.array([t]))
    quaternion = state[0, ORIENTATION]
    sign = math.copysign(1.0, float(quaternion @ list(published.values())[:4]))
    here = [*(sign * quaternion), *body_rates(state)[0], *state[0, POSITION]]
    digits = {f"{name} at {t:g} s": f"{value:.{DECIMALS}f}" for name, value in published.items()}
    values = zip(digits.items(), here, strict=True)
    return [_beside_exact(source, "formula", quantity, value, float(exact)) for (quantity, value), exact in values]


def _simple_rotation(source: Source, scene: Scenario, axis: Sequence[float], rate: float, time: float) -> Result:
    """The largest error of the quaternion after a rotation about one axis, beside the bound of Drake's test."""
    direction = np.array(axis) / np.linalg.norm(axis)
    start = scene.start.model_copy(update={"angular_velocity": tuple((rate * direction).tolist())})
    quaternion = exact_solution(scene.model_copy(update={"start": start})).states(np.array([time]))[0, ORIENTATION]
    expected = about(direction, np.array([rate * time]))[0]
    error = float(min(np.abs(quaternion - expected).max(), np.abs(quaternion + expected).max()))
    bound = f"≤ {source.parameters['simple']['bound_in_epsilon'] * EPSILON:.2g}"
    quantity = f"quaternion, axis {' '.join(f'{component:g}' for component in axis)}"
    return replace(_beside_exact(source, "simple rotation", quantity, bound, error), here=f"{error:.2g}")


def housner_block(source: Source) -> Iterator[Result]:
    """Housner's ratio of kinetic energies and period beside the exact solution of the block."""
    for slope in source.parameters["slopes"]:
        alpha = math.atan(slope)
        scene = rocking_scene(alpha, 0.5)
        impact = exact_solution(scene).events[0]
        before, after = (Trajectory.from_states(np.zeros(1), state[None]) for state in (impact.before, impact.after))
        ratio = float((kinetic_energy(scene, after) / kinetic_energy(scene, before))[0])
        yield _beside_exact(source, "restitution", f"r, tan α = {slope:g}", f"{housner_ratio(alpha):.{DECIMALS}f}", ratio)
    for alpha, share, digits in source.parameters["periods"]:
        published = housner_period(share)
        exact = 4.0 * exact_solution(rocking_scene(alpha, share)).events[0].time
        result = _beside_exact(source, "period", f"T [s], α = {alpha:g}, θ₀ = {share:g} α", f"{published:.{digits}g}", exact, digits)
        is_slender = alpha == source.parameters["slender"]
        yield result if is_slender else replace(result, status="error of the source", difference=published - exact)


RADIUS, GRAVITY = 1.0, 9.81
"""Half diagonal [m] of the block, and gravity [m/s²]; the ratio depends on neither, the period on both as √(R/g)."""


def housner_ratio(alpha: float) -> float:
    """Kinetic energy after the impact over that before it: [1 - (3/2) sin² α]²."""
    return (1.0 - 1.5 * math.sin(alpha) ** 2) ** 2


def housner_period(share: float) -> float:
    """The period [s] of a slender block whose amplitude is a share of α: (4/p) arcosh 1/(1 - θ₀/α), p² = 3g/4R."""
    return 4.0 / math.sqrt(0.75 * GRAVITY / RADIUS) * math.acosh(1.0 / (1.0 - share))


def rocking_scene(alpha: float, share: float) -> Scenario:
    """A solid block with tan α = width/height, which starts at rest, tilted about an edge by a share of α."""
    half_width, half_height = RADIUS * math.sin(alpha), RADIUS * math.cos(alpha)
    tilt = about(np.array([0.0, 0.0, 1.0]), np.array([-share * alpha]))[0]
    centre = rotate(tilt, np.array([-half_width, half_height, 0.0]))
    return load(
        {
            "name": "block",
            "duration": 4.0,
            "body": {"shape": "box", "half_extents": [half_width, half_height, half_width], "mass": 1.0},
            "start": {"position": centre, "orientation": tilt},
            "gravity": {"acceleration": [0.0, -GRAVITY, 0.0]},
            "floor": {"restitution": 0.0, "friction": "infinite"},
        }
    )


def bouncing_ball(source: Source) -> Iterator[Result]:
    """The heights that the source prints beside the exact bounces, and the time from which the ball lies still."""
    scene = source.scene("bounces")
    truth = exact_solution(scene)
    for time, text in source.parameters["heights"].items():
        exact = float(truth.states(np.array([float(time)]))[0, POSITION][1]) - scene.body.resting_height
        yield _error(source, "FMU", f"height at {time} s [m]", text, exact)
    yield _error(source, "FMU", "at rest from [s]", source.parameters["rests_from"], truth.events[-1].time, decimals=6)


FORMULAS: Mapping[str, Callable[[Source], Iterator[Result]]] = {
    formula.__name__: formula for formula in (nesc_brick, kane_free_body, housner_block, bouncing_ball)
}
