"""Failure modes of an engine's motion, and their criteria. A motion has the most severe mode whose criterion it meets.

Accuracy is measured over the scene's duration; all other criteria use the whole motion, which may be longer.
"""

import math
from collections.abc import Iterator
from functools import partial
from typing import Literal, NamedTuple, get_args

import numpy as np

from dropspin.comparisons.measuring.comparison import Comparison, Unresolved
from dropspin.comparisons.measuring.metrics import metrics_for
from dropspin.scenarios import Scenario, Trajectory, Truth
from dropspin.scenarios.mechanics import apex, depth_of, lowest_height, offset_of
from dropspin.scenarios.model import TOUCHING
from dropspin.scenarios.rotations import length
from dropspin.scenarios.state import Array
from dropspin.scenarios.surfaces import Floor

FailureMode = Literal["declined", "sound", "inaccurate", "gains_energy", "sinks", "tunnels", "clamped", "diverged", "crashed", "timed_out"]
FAILURE_MODES: tuple[FailureMode, ...] = get_args(FailureMode)
"""The failure modes, from mild to severe; `declined` means that the engine or its adapter cannot run the scene, and is not a failure."""

ERRORS_OF_FEW_ROWS = ("orientation_error", "angular_momentum_error", "energy_error", "bounce_height_error", "restitution_error")
ERRORS = (*ERRORS_OF_FEW_ROWS, "landing_error")
"""The metrics that must be within the tolerance: ratios, and angles in radians. The error of a landing needs a record of every step."""
GAIN, GAIN_BY_LAW = 0.01, 10.0  # of the scene's energy; the latter where Newton's restitution may itself add some
POSITION_OFF = 0.5  # of the distance that the exact solution covers, or of the body's size if it does not move
BLOWN_UP = 1e6  # times the scene's energy
DEEPER = 1e-3  # of the body's size; smaller distances are ignored
NEVER_RESTS = 1.5  # times the speed that gravity adds in a step, which a resting body may have between two solutions
SAME_SPEED = 4.5  # eps; speeds closer than this are equal to the last digit, also if they are norms
HELD = 3  # rows in which a clamped speed is equal to the last digit
SUDDEN, SUDDEN_OF_SAME = 1e-6, 1e4
"""The least change of a speed from row to row just before a clamp, relative to it, and to the difference of speeds that are equal to the
last digit: one that settles changes less.
"""
SAME_STARTS = 1e-9  # relative; speeds from two initial states that are equal, or in single precision those within twice `SAME_SPEED`


class Diagnosis(NamedTuple):
    """A failure mode, the criterion that is met, the value that meets it, and a message.

    The last attribute is the time up to which the motion was compared with the exact solution [s], if this ends before the motion.
    """

    mode: FailureMode
    criterion: str
    size: float
    message: str
    compared_until: float | None = None


SOUND = Diagnosis("sound", "", 0.0, "")


class ExtendedMotion(NamedTuple):
    """The motion of an engine for the duration of a scene and beyond.

    Attributes:
        scene: The scene.
        dt: The engine's time step [s].
        nominal: The motion for the scene's duration.
        whole: The whole motion; it begins with `nominal`.
        truth: The scene's exact solution.
    """

    scene: Scenario
    dt: float
    nominal: Trajectory
    whole: Trajectory
    truth: Truth | None


def worst(diagnoses: list[Diagnosis]) -> Diagnosis:
    """The most severe of several diagnoses, and of equal modes the one with the largest size; `SOUND` if there are none."""
    return max(diagnoses, key=lambda diagnosis: (FAILURE_MODES.index(diagnosis.mode), diagnosis.size), default=SOUND)


def diagnose(motion: ExtendedMotion, within: float) -> Diagnosis:
    """The most severe diagnosis of a motion; `within` is the largest error that counts as accurate."""
    bad = motion.whole.first_bad_row
    if bad is not None:
        return Diagnosis("diverged", "not finite", math.inf, f"the state is not finite at t = {motion.whole.t[bad]:g} s")
    with np.errstate(all="ignore"):  # the squares of large numbers overflow
        whole = Comparison.with_truth(motion.scene, motion.whole, motion.truth)
        exact = None if whole.reference is None else whole.reference[: len(motion.nominal)]
        case = Comparison.with_truth(motion.scene, motion.nominal, motion.truth, exact)
        diagnoses = [*_energy_gain(whole), *_errors(motion, case, within), *_position_off(case)]
        if motion.scene.floor is not None:
            diagnoses += _tunnels(motion, motion.scene.floor)
            if not motion.scene.floor.ends:
                diagnoses += [*_sinks(motion), *_never_rests(motion, whole)]
    truth = motion.truth
    return worst(diagnoses)._replace(compared_until=None if truth is None or truth.covers_all(motion.nominal.t[-1]) else truth.horizon)


def _energy_gain(whole: Comparison) -> Iterator[Diagnosis]:
    """Energy above the initial energy; more is allowed on a floor with friction, where Newton's restitution can add energy."""
    try:
        scale = whole.energy_scale
    except Unresolved:
        return
    gain = float(np.max(whole.states.energy) - whole.states.energy[0]) / scale
    if not gain <= BLOWN_UP:
        yield Diagnosis("diverged", "blows up", gain, f"the energy rises by {gain:.1e} times the scene's energy")
    elif gain > (limit := GAIN_BY_LAW if _may_gain(whole.scene) else GAIN):
        message = f"the energy rises by {gain:.4g} times the scene's energy (limit {limit:g})"
        yield Diagnosis("gains_energy", "gains energy", gain, message)


def _may_gain(scene: Scenario) -> bool:
    return not scene.body.is_ball and any(surface.friction != "none" and surface.restitution > 0.0 for surface in scene.surfaces)


def _tunnels(motion: ExtendedMotion, floor: Floor) -> Iterator[Diagnosis]:
    """The whole body below the floor, at the end or in between; where the floor ends, not beside it."""
    whole, body = motion.whole, motion.scene.body
    highest = whole.position[:, 1] + depth_of(tuple(whole.orientation.T), tuple(body.semi_axes.tolist()))
    highest += np.max([offset_of(tuple(whole.orientation.T), vertex) for vertex in body.hull.tolist()], axis=0)
    row, below = int(np.argmin(highest)), highest < -TOUCHING * body.size
    enters = int(np.argmax(below))
    passes = floor.half_extents is None or (enters > 0 and (np.abs(whole.position[enters, [0, 2]]) <= floor.half_extents).all())
    if below[row] and passes:
        depth = -float(lowest_height(motion.scene, whole[row : row + 1])[0])
        yield Diagnosis(
            "tunnels", "below the floor", depth, f"the whole body is below the floor at t = {whole.t[row]:.4g} s, down to {depth:.3g} m"
        )


def _sinks(motion: ExtendedMotion) -> Iterator[Diagnosis]:
    """Below the floor during the tenth of the motion after its middle, and deeper throughout the last tenth."""
    heights, share = lowest_height(motion.scene, motion.whole), motion.whole.t / motion.whole.t[-1]
    middle, end = (float(-heights[(share >= since) & (share <= since + 0.1)].max(initial=-math.inf)) for since in (0.5, 0.9))
    deeper = DEEPER * motion.scene.body.size
    if middle > 0.0 and end > middle + deeper:
        depths = f"{end:.3g} m below the floor after {motion.whole.t[-1]:.3g} s, and {middle:.3g} m after half of that time"
        message = f"the body is {depths} (allowed increase {deeper:.2g} m)"
        yield Diagnosis("sinks", "sinks", end, message)


def _errors(motion: ExtendedMotion, case: Comparison, within: float) -> Iterator[Diagnosis]:
    known = ERRORS if case.dt < 1.5 * motion.dt else ERRORS_OF_FEW_ROWS
    for metric in metrics_for(motion.scene, motion.truth):
        if metric.name not in known:
            continue
        try:
            size = abs(metric.value([case]))
        except Unresolved:
            if metric.name != "bounce_height_error" or math.isnan(size := _rise_error(case)):
                continue
        if metric.name == "restitution_error" and math.isnan(size):
            continue  # undefined for an exact motion at the coarsest steps too; a body without an impact has other errors
        allowed = within + (_between_rows(case) if metric.name == "restitution_error" else 0.0)
        if size <= allowed:
            yield Diagnosis("sound", metric.name, size, "")
        else:
            unit = "" if metric.unit == "1" else f" {metric.unit}"
            name = metric.name.replace("_", " ")
            value = f"{name} is {size:.4g}{unit} (tolerance {allowed:.4g})"
            why = ": no impact was detected" if case.first_contact is None else ""
            message = value if math.isfinite(size) else f"{name} is undefined{why}"
            yield Diagnosis("inaccurate", metric.name, size if math.isfinite(size) else math.inf, message)


def _rise_error(case: Comparison) -> float:
    """How far the greatest heights after the first impact differ, relative to the drop; of each state the one to which it rises.

    NaN without a state after it. A body that falls, because its impact is late, counts with the height that it has.
    """
    since = case.exact.t > min(case.impacts, default=math.inf)
    heights = [
        np.where(motion.velocity[:, 1] > 0.0, apex(case.scene, motion), motion.position[:, 1])[since]
        for motion in (case.compared, case.exact)
    ]
    return abs(float(heights[0].max() - heights[1].max())) / case.clearance if since.any() else math.nan


def _between_rows(case: Comparison) -> float:
    """The error of restitution of an exact motion, whose velocities are recorded up to a step before and after an impact: g dt/u."""
    if case.first_contact is None:
        return 0.0
    return float(case.motions.fall) / abs(case.normal_velocity_of_struck_point(case.first_contact[0]))


def _position_off(case: Comparison) -> Iterator[Diagnosis]:
    """Far from the exact position, even where the metrics cannot resolve the motion."""
    if case.reference is None:
        return
    exact = case.reference.position
    distance, size = float(length(exact - exact[0]).max()), case.scene.body.size
    distance, of = (distance, "distance covered") if distance > DEEPER * size else (size, "size of the body")
    error = float(length(case.motion.position[: len(exact)] - exact).max()) / distance
    if not error <= POSITION_OFF:
        yield Diagnosis("inaccurate", "position", error, f"the position error is {error:.3g} of the {of} (limit {POSITION_OFF:g})")


def _never_rests(motion: ExtendedMotion, whole: Comparison) -> Iterator[Diagnosis]:
    """Moving in the last tenth of the motion, during which the body rests in the exact solution."""
    exact, late = whole.reference, motion.whole.t >= 0.9 * motion.whole.t[-1]
    if exact is None or len(exact) < len(motion.whole) or exact.velocity[late].any():
        return
    fastest = float(np.linalg.norm(motion.whole.velocity[late], axis=1).max())
    allowed = motion.dt * float(np.linalg.norm(motion.scene.acceleration))
    if fastest > NEVER_RESTS * allowed:
        speed = f"{fastest:.2g} m/s, {fastest / allowed:.3g} times g dt (limit {NEVER_RESTS:g})"
        message = f"the body moves at {speed} in the last tenth of {motion.whole.t[-1]:.3g} s, during which it rests in the exact solution"
        yield Diagnosis("inaccurate", "never rests", fastest / allowed, message)


class HeldSpeed(NamedTuple):
    """The largest values that the components of a velocity and its length have, where they are possibly clamped [m/s, rad/s]; else NaN.

    Such a speed is reduced after the first step, or is suddenly constant to the last digit. Both may have other causes, unless another
    initial state gives the same value.
    """

    components: tuple[float, ...]
    norm: float

    def shared(self, other: "HeldSpeed", eps: float) -> float:
        """The value at which this speed and that from another initial state are clamped; NaN if they are not."""
        same_speed = partial(math.isclose, rel_tol=max(SAME_STARTS, 2.0 * SAME_SPEED * eps))
        components = [value for value in self.components if any(same_speed(value, of_other) for of_other in other.components)]
        most = max(components, default=math.nan)
        if not same_speed(self.norm, other.norm):
            return most
        alike = sum(same_speed(value, most) for value in components)
        are_components = same_speed(self.norm, math.sqrt(alike) * most)  # each of them is clamped, and so is the length
        return most if are_components else self.norm


def held_speeds(motion: Trajectory, eps: float) -> dict[str, HeldSpeed]:
    """The velocity and angular velocity of which the length or a component is possibly clamped; `eps` is that of the engine."""
    held = {}
    for name in ("velocity", "angular_velocity"):
        components = np.abs(getattr(motion, name))
        values = []
        for sizes in (*components.T, length(components)):
            largest = float(sizes[1:].max())
            values.append(largest if largest > 0.0 and _is_held(sizes, largest, eps) else math.nan)
        if not np.isnan(values).all():
            held[name] = HeldSpeed(tuple(values[:3]), values[3])
    return held


def _is_held(sizes: Array, largest: float, eps: float) -> bool:
    """Whether a component or norm that varied, or was larger initially, stays at its largest value for some rows."""
    same = SAME_SPEED * eps
    held, sudden = np.abs(sizes - largest) <= same * largest, max(SUDDEN, SUDDEN_OF_SAME * same)
    if sizes[0] > largest * (1.0 + sudden) and held[1]:
        return True
    in_a_row = np.logical_and.reduce([held[shift : len(held) - HELD + 1 + shift] for shift in range(HELD)])
    first = int(np.argmax(in_a_row))
    return bool(in_a_row.any()) and first > 1 and abs(sizes[first - 1] - sizes[first - 2]) > sudden * largest


def clamped(motion: Trajectory, other: Trajectory, eps: float) -> list[Diagnosis]:
    """Speeds that are possibly clamped and are equal, to the last digit, from two different initial states."""
    units = {"velocity": "m/s", "angular_velocity": "rad/s"}
    first, second = held_speeds(motion, eps), held_speeds(other, eps)
    values = {name: first[name].shared(second[name], eps) for name in first.keys() & second.keys()}
    return [
        Diagnosis("clamped", f"{name} clamped", values[name], f"{name.replace('_', ' ')} is clamped at {values[name]:.6g} {unit}")
        for name, unit in units.items()
        if not math.isnan(values.get(name, math.nan))
    ]
