"""What has become of an engine: a condition, by the worst of named criteria that its motion meets.

Accuracy is judged over the scene's own duration, everything else over the whole of a run that may go on for longer.
"""

import math
from collections.abc import Iterator
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from comparisons.measuring.comparison import Comparison, Unresolved
from comparisons.measuring.metrics import metrics_for
from scenarios import Scenario, Trajectory, Truth
from scenarios.body import Sphere
from scenarios.mechanics import lowest_height
from scenarios.model import TOUCHING
from scenarios.rotations import length, rotate

Array = NDArray[np.float64]

FailureMode = Literal["declined", "sound", "inaccurate", "gains_energy", "sinks", "tunnels", "clamped", "diverged", "crashed", "timed_out"]
FAILURE_MODES: tuple[FailureMode, ...] = get_args(FailureMode)
"""From the mildest to the worst; `declined` is none, but what an engine says instead."""

ERRORS_OF_FEW_ROWS = ("orientation_error", "angular_momentum_error", "energy_error")
ERRORS = (*ERRORS_OF_FEW_ROWS, "bounce_height_error", "landing_error")
"""What must be within the tolerance for a motion to be accurate: ratios, and angles in radians; an impact needs every step to be seen."""
GAIN, GAIN_BY_LAW = 0.01, 10.0  # of the scene's energy; the latter where Newton's restitution may itself add some
ASTRAY = 0.5  # of the truth's way, or of the body's size if it stays where it is
BLOWN_UP = 1e6  # times the scene's energy
DEEPER = 1e-3  # of the body's size; less is no way to speak of
RESTLESS = 1.5  # times what gravity adds to a speed in a step; 1 is what a resting body may have between two solutions
ULPS = 1e-15  # of a speed; what is the same to the last digit, of a norm
HELD = 3  # rows in which a speed stays the same to the last digit
SUDDEN = 1e-6  # of a speed; how much it still changes from row to row before that, while one that settles has come to rest by then


class Diagnosis(NamedTuple):
    """A condition, the criterion it is met by, the criterion's figure, and all of it in words."""

    mode: FailureMode
    criterion: str
    size: float
    message: str


SOUND = Diagnosis("sound", "", 0.0, "")


class ExtendedMotion(NamedTuple):
    """What an engine did with a scene.

    Attributes:
        scene: The scene.
        dt: The engine's step [s].
        own: Its motion for as long as the scene lasts.
        whole: Its motion to the end; it begins with `own`.
        truth: The scene's.
    """

    scene: Scenario
    dt: float
    own: Trajectory
    whole: Trajectory
    truth: Truth | None


def worst(findings: list[Diagnosis]) -> Diagnosis:
    """The worst of several, of equals the one with the largest figure; sound without errors if there is none."""
    return max(findings, key=lambda one: (FAILURE_MODES.index(one.mode), one.size), default=SOUND)


def diagnose(run: ExtendedMotion, within: float) -> Diagnosis:
    """The worst that a run shows; `within` is how large an error may be."""
    bad = run.whole.first_bad_row
    if bad is not None:
        return Diagnosis("diverged", "not finite", math.inf, f"the state is not finite at t = {run.whole.t[bad]:g} s")
    with np.errstate(all="ignore"):  # numbers may be too large for their squares
        whole = Comparison.with_truth(run.scene, run.whole, run.truth)
        exact = None if whole.reference is None else whole.reference[: len(run.own)]
        own = Comparison.with_truth(run.scene, run.own, run.truth, exact)
        found = [*_energy_that_rises(whole), *_tunnels(run), *_sinks(run), *_errors(run, own, within), *_lost(own), *_restless(run, whole)]
    return worst(found)


def _energy_that_rises(whole: Comparison) -> Iterator[Diagnosis]:
    """Above the start's; on a floor that grips, Newton's restitution may add some, and more is allowed there."""
    try:
        scale = whole.energy_scale
    except Unresolved:
        return
    gain = float(np.max(whole.energy) - whole.energy[0]) / scale
    if not gain <= BLOWN_UP:
        yield Diagnosis("diverged", "blows up", gain, f"the energy rises by {gain:.1e} of the scene's")
    elif gain > (GAIN_BY_LAW if _may_gain(whole.scene) else GAIN):
        yield Diagnosis("gains_energy", "gains energy", gain, f"the energy rises by {gain:.2g} of the scene's")


def _may_gain(scene: Scenario) -> bool:
    floor = scene.floor
    return floor is not None and floor.friction != "none" and floor.restitution > 0.0 and not isinstance(scene.body, Sphere)


def _tunnels(run: ExtendedMotion) -> Iterator[Diagnosis]:
    if run.scene.floor is None:
        return
    end = run.whole[-1:]
    body = run.scene.body
    highest = float(end.position[0, 1] + rotate(end.orientation[0], body.vertices)[:, 1].max() + body.rounding)
    if highest < -TOUCHING * body.size:
        depth = -float(lowest_height(run.scene, end)[0])
        yield Diagnosis("tunnels", "below the floor", depth, f"all of it is below the floor at the end, down to {depth:.3g} m")


def _sinks(run: ExtendedMotion) -> Iterator[Diagnosis]:
    """Under the floor half way through a run, for a tenth of it, and deeper all through the last tenth: it does not come up in between."""
    if run.scene.floor is None:
        return
    heights, share = lowest_height(run.scene, run.whole), run.whole.t / run.whole.t[-1]
    half_way, end = (float(-heights[(share >= since) & (share <= since + 0.1)].max(initial=-math.inf)) for since in (0.5, 0.9))
    deeper = DEEPER * run.scene.body.size
    if half_way > 0.0 and end > half_way + deeper:
        yield Diagnosis("sinks", "sinks", end, f"{end:.3g} m below the floor after {run.whole.t[-1]:.3g} s, {half_way:.3g} m half way")


def _errors(run: ExtendedMotion, own: Comparison, within: float) -> Iterator[Diagnosis]:
    known = ERRORS if own.dt < 1.5 * run.dt else ERRORS_OF_FEW_ROWS
    for metric in metrics_for(run.scene, run.truth):
        if metric.name not in known:
            continue
        try:
            size = abs(metric.average([own]).value)
        except Unresolved:
            continue
        if size <= within:
            yield Diagnosis("sound", metric.name, size, "")
        else:
            unit = "" if metric.unit == "1" else f" {metric.unit}"
            name = metric.name.replace("_", " ")
            said = f"{name} is {size:.2g}{unit}" if math.isfinite(size) else f"no {name} to be had: nothing like the impact happened"
            yield Diagnosis("inaccurate", metric.name, size if math.isfinite(size) else math.inf, said)


def _lost(own: Comparison) -> Iterator[Diagnosis]:
    """Somewhere else than the truth, whatever the metrics can resolve."""
    if own.reference is None:
        return
    exact = own.reference.position
    way, size = float(length(exact - exact[0]).max()), own.scene.body.size
    way = way if way > DEEPER * size else size
    astray = float(length(own.motion.position[: len(exact)] - exact).max()) / way
    if not astray <= ASTRAY:
        yield Diagnosis("inaccurate", "astray", astray, f"its place is off by {astray:.2g} of the way it goes")


def _restless(run: ExtendedMotion, whole: Comparison) -> Iterator[Diagnosis]:
    """Moving on where the truth rests, in the last tenth of the run."""
    exact, late = whole.reference, run.whole.t >= 0.9 * run.whole.t[-1]
    if exact is None or run.scene.floor is None or len(exact) < len(run.whole) or exact.velocity[late].any():
        return
    fastest = float(np.linalg.norm(run.whole.velocity[late], axis=1).max())
    allowed = run.dt * float(np.linalg.norm(run.scene.acceleration))
    if fastest > RESTLESS * allowed:
        said = f"never rests: moves at {fastest:.2g} m/s, {fastest / allowed:.3g} times g dt, when the truth is at rest"
        yield Diagnosis("inaccurate", "never rests", fastest / allowed, said)


def held_speeds(motion: Trajectory) -> dict[str, float]:
    """Components of velocity [m/s] and angular velocity [rad/s], or norms, that look as if cut off there.

    They are less than the start's after one step already, or stay the same to the last digit, all of a sudden. That may have other reasons;
    that the same value comes of another start has not.
    """
    found: dict[str, float] = {}
    for name in ("velocity", "angular_velocity"):
        components = np.abs(getattr(motion, name))
        for sizes in (*components.T, length(components)):
            largest = float(sizes[1:].max())
            if largest > 0.0 and _is_held(sizes, largest):
                found[name] = max(largest, found.get(name, 0.0))
    return found


def _is_held(sizes: Array, largest: float) -> bool:
    """Whether a component, or the norm, that varied or was larger at the start, stays at the largest value for some rows."""
    held = np.abs(sizes - largest) <= ULPS * largest
    if sizes[0] > largest * (1.0 + SUDDEN) and held[1]:
        return True
    in_a_row = np.logical_and.reduce([held[shift : len(held) - HELD + 1 + shift] for shift in range(HELD)])
    first = int(np.argmax(in_a_row))
    return bool(in_a_row.any()) and first > 1 and abs(sizes[first - 1] - sizes[first - 2]) > SUDDEN * largest


def clamped(motion: Trajectory, other: Trajectory) -> list[Diagnosis]:
    """Speeds that come out the same, to the last digit, of two different starts."""
    units = {"velocity": "m/s", "angular_velocity": "rad/s"}
    first, second = held_speeds(motion), held_speeds(other)
    return [
        Diagnosis("clamped", f"{name} clamped", value, f"{name.replace('_', ' ')} is cut off at {value:.6g} {units[name]}")
        for name, value in first.items()
        if math.isclose(value, second.get(name, math.nan), rel_tol=1e-9)
    ]
