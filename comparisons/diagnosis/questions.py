"""The questions of a diagnosis: how a body falls, spins, lands, rests, slides and rolls, measured and compared with exact solutions.

Each question is a function of a body and of time steps, of which the first is judged, and gives answers as rows.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal, NamedTuple

import numpy as np

from dropspin.comparisons.diagnosis.loose_body import DIRECTIONS, Facts, LooseBody
from dropspin.comparisons.engines.base import Diverged
from dropspin.comparisons.judging.error_budget import error_budget, is_sufficient
from dropspin.scenarios.rotations import rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, UP, VELOCITY, Array
from dropspin.scenarios.truths.settings import spin_about_axis, terminal_speed, time_constant

Finding = Literal["", "impossible", "changed", "time step", "setting", "model", "target"]
NOTEWORTHY = 0.01
"""Share from which a difference is a finding."""
FALL, TURN = 1.0, 1.0  # s
SPEED = 10.0  # rad/s
OBLIQUE = np.array([0.6, 0.48, 0.64])
"""The stated direction of a spin, in the body frame."""
DIAGONALS = np.array([[0, 1, 1], [1, 0, 1], [1, 1, 0], [0, 1, -1], [1, 0, -1], [1, -1, 0]]) / math.sqrt(2.0)
FASTEST, SLOWEST = 1e3, 1e-2  # rad/s
IMPACTS = (0.5, 1.0, 3.0)  # m/s
PHASES, FEWER = 8, 4
"""Start phases at the file's time step, and at finer ones."""
LEAST_NOISE = 1e-6  # of a ratio of speeds
WATCHED, SETTLED = 0.3, 3.0  # s
SLIDE = 0.5  # m/s, and more where friction would stop it within a quarter of a second
LONGEST_SLIDE = 5.0  # m
UNTURNED = 0.05  # rad
LONG_SLIDE = 0.25  # s, within which a body stops
ONE_WAY = 0.05
"""Relative difference of two distances from which friction depends on direction."""
FRICTIONAL = ("cone", "impratio", "timestep")
LONGEST = 1_000_000
"""Steps of one question at most."""


class Remedy(NamedTuple):
    """A change that removes a finding.

    Attributes:
        text: What to write.
        value: The value measured with it; NaN if it was not tried.
        others: The number of other bodies of the model that it applies to as well.
        runs: Whether the whole model runs with it.
    """

    text: str
    value: float = math.nan
    others: int = 0
    runs: bool = True


@dataclass(frozen=True)
class Answer:
    """A measured value of a body, beside the exact ones.

    Attributes:
        question: What it is about, such as `fall`.
        quantity: What was measured.
        unit: Its unit.
        measured: The value at the file's time step; NaN if it is computed alone.
        in_force: The exact value with the settings in force; NaN if it is not known.
        physical: The exact value without damping, armature and margin; NaN if it is not known.
        limit: The value as dt → 0, extrapolated; NaN if it is not determined.
        least: The least value over start phases; NaN if there is one start.
        most: The largest.
        finding: The kind of finding; empty if it is none.
        settings: The names of the settings that cause it.
        remedies: What removes the finding.
        detail: A sentence's part that explains the value, or replaces one that is not a number.
    """

    question: str
    quantity: str
    unit: str
    measured: float = math.nan
    in_force: float = math.nan
    physical: float = math.nan
    limit: float = math.nan
    least: float = math.nan
    most: float = math.nan
    finding: Finding = ""
    settings: tuple[str, ...] = ()
    remedies: tuple[Remedy, ...] = ()
    detail: str = ""


def fall(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The distance fallen in a second, and the terminal speed."""
    facts = body.facts
    if not facts.gravity > 0.0:
        return []
    start, fallen, exact = facts.start(), [], []
    for dt in dts:
        steps = round(FALL / dt)
        end = body.motions(start[np.newaxis], dt, steps, -facts.gravity * UP, floor=False)[0, -1]
        fallen.append(start[1] - end[1])
        exact.append(facts.fallen(steps * dt))
    free = 0.5 * facts.gravity * (round(FALL / dts[0]) * dts[0]) ** 2
    answers = [judged(body, "fall", "distance in 1 s", "m", dts, fallen, exact, free)]
    if any(facts.falls):
        speed = terminal_speed(facts.gravity * (1.0 - facts.lifted), facts.mass, *facts.falls)
        answers.append(Answer("fall", "terminal speed", "m/s", in_force=speed, physical=math.inf))
    return answers


def spin(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The decay of a spin about each principal axis."""
    facts, answers = body.facts, []
    moments, axes = facts.principal
    for number, axis in enumerate(axes.T):
        name = f"about {'xyz'[number]}" if np.count_nonzero(axis) == 1 else f"about {_vector(axis)}"
        start = facts.start(spin=SPEED * axis)
        tau = time_constant(SPEED, moments[number], facts.armature, *facts.spins[number])
        if tau < TURN:
            times = [_decay(body, start, dt, tau) for dt in dts]
            answers.append(judged(body, "spin", f"1/e time {name}", "s", dts, times, [tau] * len(dts), math.inf))
        else:
            ends = [_turned(body, start, dt) for dt in dts]
            kept = [float(np.linalg.norm(end[SPIN])) / SPEED for end in ends]
            exact = [facts.spun(number, SPEED, TURN) / SPEED] * len(dts)
            answers.append(judged(body, "spin", f"fraction kept in 1 s {name}", "1", dts, kept, exact, 1.0))
    return answers


def _decay(body: LooseBody, start: Array, dt: float, tau: float) -> float:
    """The time at which a spin is 1/e of its start [s], interpolated between steps as an exponential."""
    steps = min(math.ceil(3.0 * tau / dt) + 3, LONGEST)
    speeds = np.linalg.norm(body.motions(start[np.newaxis], dt, steps, np.zeros(3), floor=False)[0, :, SPIN], axis=1)
    below = np.flatnonzero(speeds <= SPEED / math.e)
    if not len(below):
        return math.inf
    last = int(below[0])
    if speeds[last] <= 0.0:
        return dt * last
    before, after = math.log(speeds[last - 1]), math.log(speeds[last])
    return dt * (last - 1 + (before - math.log(SPEED) + 1.0) / (before - after))


def _turned(body: LooseBody, starts: Array, dt: float) -> Array:
    """The states after a second without gravity and contacts, of one start, shape (13,), or of several, shape (n, 13)."""
    motions = body.motions(np.atleast_2d(starts), dt, round(TURN / dt), np.zeros(3), floor=False)
    found: Array = motions[:, -1]
    return found[0] if starts.ndim == 1 else found


def tumble(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The change of energy of a spin about no principal axis, which turns freely: as stated, worst, and where it reaches 1 %."""
    facts = body.facts
    moments, axes = facts.principal
    is_slowed = any(time_constant(SPEED, m, facts.armature, *drag) < TURN for m, drag in zip(moments, facts.spins, strict=True))
    if np.ptp(moments) < 1e-9 * moments.max() or is_slowed:
        return []
    start, free = facts.start(spin=SPEED * OBLIQUE), 0.0
    ends = [_turned(body, start, dt) for dt in dts]
    gains = [float(_energy_gain(body, start, end)) for end in ends]
    steps = round(TURN / dts[0])
    after = facts.in_force(start, np.array([0.0, steps * dts[0]]), 0.0)[-1]
    exact = float(_energy_gain(body, start, after))
    of_stated = judged(body, "tumble", f"energy change in 1 s, {SPEED:g} rad/s", "%", dts, gains, [exact] * len(dts), free)
    if of_stated.finding == "setting":  # of damping, which no direction and no step is without
        return [of_stated]
    tried = np.concatenate([DIRECTIONS[DIRECTIONS[:, 1] >= 0.0], DIAGONALS, [OBLIQUE]])
    starts = np.array([facts.start(spin=SPEED * (axes @ direction)) for direction in tried])
    by_direction = _energy_gain(body, starts, _turned(body, starts, dts[0]))
    worst = int(np.argmax(np.abs(by_direction)))
    turned = 2.0 * math.degrees(math.acos(min(1.0, abs(float(ends[0][ORIENTATION] @ after[ORIENTATION])))))
    answers = [of_stated, Answer("tumble", "attitude error", "°", turned, in_force=0.0)]
    answers += [Answer("tumble", f"worst axis {_vector(tried[worst])}", "%", float(by_direction[worst]))]
    if abs(by_direction[worst] - exact) > 100.0 * NOTEWORTHY or of_stated.finding:
        speed = _threshold(lambda w: _gain(body, facts.start(spin=w * (axes @ tried[worst])), dts[0]), SLOWEST, FASTEST)
        answers.append(Answer("tumble", "spin for 1 %", "rad/s", speed))
    if of_stated.finding == "time step":
        step = _threshold(lambda dt: _gain(body, start, dt), 1e-2 * dts[0], dts[0])
        answers.append(Answer("tumble", "dt for 1 %", "s", step))
    return answers


def _gain(body: LooseBody, start: Array, dt: float) -> float:
    """The change of energy in a second [%]; inf if the simulation breaks down."""
    try:
        return float(_energy_gain(body, start, _turned(body, start, dt)))
    except Diverged:
        return math.inf


def _energy_gain(body: LooseBody, first: Array, last: Array) -> Array:
    """The change of the kinetic energy of rotation from first to last states [%], shape (...)."""

    def energy(states: Array) -> Array:
        spins = unrotate(states[..., ORIENTATION], states[..., SPIN])
        return np.einsum("...i,ij,...j->...", spins, body.facts.inertia, spins)

    return 100.0 * (energy(last) / energy(first) - 1.0)


def _threshold(gain: Callable[[float], float], low: float, high: float) -> float:
    """The value from which a gain that grows with it exceeds 1 %, by bisection; inf if it does nowhere, low if it does from there."""
    if abs(gain(high)) < 100.0 * NOTEWORTHY:
        return math.inf
    while high > 1.02 * low:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if abs(gain(middle)) >= 100.0 * NOTEWORTHY else (middle, high)
    return low


def impact(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The rebound above the surface in the file's pose, over speeds and start phases; the depth and the time in contact at 1 m/s."""
    facts, answers = body.facts, []
    if not facts.surface or not facts.gravity > 0.0:
        return []
    at_1: list[Answer] = []
    bodies = {"": body}
    if "restitution" in body.remedies:
        bodies["surface with restitution 1, "] = body.changed(body.remedies["restitution"][0])
    for (name, one), speed in product(bodies.items(), IMPACTS):
        found = [_rebounds(one, speed, dt, FEWER if number else PHASES) for number, dt in enumerate(dts)]
        ratios, upward, depths, times = zip(*found, strict=True)
        means = [float(np.mean(ratio)) for ratio in ratios]
        noise = [max(float(np.ptp(ratio)) / math.sqrt(12.0) / len(ratio), LEAST_NOISE) for ratio in ratios]
        limit = 0.0 if max(means) == 0.0 else math.nan
        if is_sufficient(dts) and max(means) > 0.0:
            budget = error_budget(dts, means, resolution=noise, signed=False, negligible=0.1 * NOTEWORTHY)
            limit = math.nan if budget.cause == "unresolved" else budget.asymptotic_error
        quantity = f"{name}rebound / impact speed at {speed:g} m/s"
        exact = math.nan if one.facts.restitution is None else one.facts.restitution
        change = abs(means[0] - (means[-1] if math.isnan(exact) else exact))
        finding: Finding = "time step" if max(change, float(np.ptp(ratios[0]))) > NOTEWORTHY else ""
        settings = ("timestep",) if finding else ()
        if finding and not math.isnan(exact):
            settings = ("contactERP", *settings)
            if abs(means[-1] - exact) >= 0.6 * change:
                finding = "model"
        least, most = float(min(ratios[0])), float(max(ratios[0]))
        answers.append(
            Answer(
                "impact",
                quantity,
                "1",
                means[0],
                exact,
                limit=limit,
                finding=finding,
                least=least,
                most=most,
                settings=settings,
            )
        )
        if speed == 1.0 and one is body:
            longest = float(np.max(times[0]))
            detail = f"> {WATCHED:g} s" if math.isinf(longest) else ""
            ratio = float(np.mean(upward[0]))
            ends = float(min(upward[0])), float(max(upward[0]))
            at_1 = [Answer("impact", "largest upward / impact speed at 1 m/s", "1", ratio, least=ends[0], most=ends[1])]
            at_1 += [Answer("impact", "penetration at 1 m/s", "m", float(np.max(depths[0])))]
            at_1.append(Answer("impact", "contact at 1 m/s", "s", longest, detail=detail))
    return answers + at_1


def _rebounds(body: LooseBody, speed: float, dt: float, phases: int) -> tuple[Array, Array, Array, Array]:
    """For each start phase: the rebound speed and the largest upward speed over the impact speed, depth [m] and time in contact [s].

    The rebound speed is that which the height above the surface would need, which the body reaches from its speed as it leaves the surface.
    """
    facts = body.facts
    g = facts.gravity
    steps = math.ceil(WATCHED / dt)
    gap = facts.margin
    starts = [facts.start(height=gap + speed * dt * (phase + 0.5) / phases, velocity=-speed * UP) for phase in range(phases)]
    ratios, fastest, depths, times = [], [], [], []
    for states in body.motions(np.array(starts), dt, steps, -g * UP, floor=True):
        heights = facts.lowest(states)
        rows = np.arange(len(heights))
        touched = int(np.argmax(heights < gap)) if (heights < gap).any() else len(heights) - 1
        again = rows[(rows > touched) & (heights > gap)]
        watched = int(again[0]) - touched if len(again) else len(rows)
        lowest = touched + int(np.argmin(heights[touched : touched + min(watched, max(2, math.ceil(0.1 / dt)))]))
        left = rows[(rows > lowest) & (heights > gap)]
        upward = float(states[left[0], VELOCITY][1]) if len(left) else 0.0
        energy = upward**2 + 2.0 * g * (heights[left[0]] - gap) if upward > 0.0 else 0.0
        at_impact = math.sqrt(speed**2 + 2.0 * g * (heights[0] - gap))
        ratios.append(math.sqrt(energy) / at_impact)
        fastest.append(max(0.0, float(states[:, VELOCITY][:, 1].max())) / at_impact)
        depths.append(max(0.0, -float(heights.min())))
        times.append((left[0] - touched) * dt if len(left) else math.inf)
    return np.array(ratios), np.array(fastest), np.array(depths), np.array(times)


def settled(body: LooseBody, dt: float) -> Array:
    """The states of the body that is put down in the file's pose, over three seconds, shape (n, 13)."""
    facts = body.facts
    return body.motions(facts.start()[np.newaxis], dt, math.ceil(SETTLED / dt), -facts.gravity * UP, floor=True)[0]


def rest(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The depth of the body at rest, and its speed there."""
    facts = body.facts
    if not facts.surface or not facts.gravity > 0.0:
        return []
    states = settled(body, dts[0])
    last = states[-math.ceil(0.5 / dts[0]) :]
    heights = facts.lowest(last)
    depth = -float(heights.mean())
    size = max(float(np.linalg.norm(facts.points, axis=1).max()), 1e-12)
    floats = facts.margin > 0.0 and -depth > NOTEWORTHY * size
    finding: Finding = "setting" if floats else ""
    speed = float(np.linalg.norm(np.ptp(last[:, POSITION], axis=0))) / 0.5
    tipped = _tilt(states) > UNTURNED
    return [
        Answer("rest", "penetration", "m", depth, facts.rest_depth, 0.0, finding=finding, settings=("margin",) * floats),
        Answer("rest", "drift speed", "m/s", speed, physical=0.0, detail="tips over" if tipped else ""),
    ]


def slide(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The distance in which a body that slides without tipping stops, along and at 45 degrees; and its creep on a slope that holds."""
    facts = body.facts
    if not facts.surface or not facts.gravity > 0.0 or not facts.friction > 0.0:
        return []
    free, exact = SLIDE**2 / (2.0 * facts.friction * facts.gravity), _stop(facts)
    if free > LONGEST_SLIDE:
        return []
    end = settled(body, dts[0])[-1:]
    rests = [body.motions(end, dt, math.ceil(WATCHED / dt), -facts.gravity * UP, floor=True)[0, -1] for dt in dts]
    half = math.sqrt(0.5)
    found = [_stops(body, dts, rests, direction) for direction in (np.array([1.0, 0.0, 0.0]), np.array([half, 0.0, half]))]
    if not all(found):
        return []
    along, across = found
    answers = [
        judged(body, "slide", f"stopping distance from {SLIDE:g} m/s{name}", "m", dts, stops, [exact] * len(dts), free)
        for name, stops in (("", along), (" at 45°", across))
    ]
    # Soft contacts take some time to carry a load that shifts: a shorter slide says more of that than of friction.
    is_short = SLIDE / (facts.friction * facts.gravity) < LONG_SLIDE
    answers = [replace(one, finding="", settings=()) if one.finding in ("time step", "model") and is_short else one for one in answers]
    turns = min(abs(second / first - 1.0) for first, second in zip(along, across, strict=True)) > ONE_WAY
    if turns and not answers[1].finding:
        answers[1] = replace(answers[1], finding="model")
    answers = [replace(one, settings=FRICTIONAL) if one.finding in ("time step", "model") else one for one in answers]
    return answers + _creep(body, dts[0])


def _stops(body: LooseBody, dts: Sequence[float], rests: Sequence[Array], direction: Array) -> list[float]:
    """The distances in which a body that slides in a direction stops [m]; empty if it tips over."""
    facts, found = body.facts, []
    for dt, rest in zip(dts, rests, strict=True):
        start = rest.copy()
        start[VELOCITY], start[SPIN] = SLIDE * direction, 0.0
        steps = math.ceil((1.5 * SLIDE / (facts.friction * facts.gravity) + 0.1) / dt)
        states = body.motions(start[np.newaxis], dt, steps, -facts.gravity * UP, floor=True)[0]
        if _tilt(states) > UNTURNED:
            return []
        foot = unrotate(start[ORIENTATION], -start[1] * UP)  # a point of the body below its centre, which sways less
        moved = states[-1, POSITION] - start[POSITION] + rotate(states[-1, ORIENTATION], foot) - rotate(start[ORIENTATION], foot)
        found.append(float(moved @ direction))
    return found


def _stop(facts: Facts) -> float:
    """The exact distance in which friction and damping stop a body [m]: the integral of v over its deceleration."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    v = 0.5 * SLIDE * (1.0 + nodes)
    force = facts.friction * facts.mass * facts.gravity * (1.0 - facts.lifted) + facts.falls.linear * v + facts.falls.quadratic * v * v
    return float(0.5 * SLIDE * weights @ ((facts.mass + facts.armature) * v / force))


def _tilt(states: Array) -> float:
    """The largest angle between the first vertical axis of a body and the later ones [rad]."""
    up = unrotate(states[0, ORIENTATION], UP)
    return float(np.arccos(np.clip(rotate(states[:, ORIENTATION], up)[:, 1], -1.0, 1.0)).max())


def _creep(body: LooseBody, dt: float) -> list[Answer]:
    """The speed of a body on a slope of half of its friction."""
    facts = body.facts
    slope = math.atan(0.5 * facts.friction)
    gravity = facts.gravity * np.array([math.sin(slope), -math.cos(slope), 0.0])
    start = settled(body, dt)[-1:]
    start[:, VELOCITY] = start[:, SPIN] = 0.0
    states = body.motions(start, dt, math.ceil(1.0 / dt), gravity, floor=True)[0]
    if _tilt(states) > UNTURNED:
        return []
    half = len(states) // 2
    moved = float(np.linalg.norm((states[-1] - states[half])[POSITION]))
    speed = moved / (dt * (len(states) - 1 - half))
    return [Answer("slide", f"creep on a slope of {math.degrees(slope):.3g}°", "m/s", speed, physical=0.0)]


def roll(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The speed that a ball keeps as it rolls for a second."""
    facts = body.facts
    if (
        not facts.surface
        or not facts.gravity > 0.0
        or len(facts.colliding) != 1
        or not facts.colliding[0].shape.is_ball
        or facts.offset.any()
    ):
        return []
    radius, inertia = float(facts.colliding[0].shape.semi_axes[0]), float(facts.principal[0].mean())
    kept = []
    end = settled(body, dts[0])[-1]
    for dt in dts:
        start = end.copy()
        start[VELOCITY], start[SPIN] = [1.0, 0.0, 0.0], [0.0, 0.0, -1.0 / radius]
        kept.append(body.motions(start[np.newaxis], dt, round(1.0 / dt), -facts.gravity * UP, floor=True)[0, -1, VELOCITY][0])
    name = "fraction kept in 1 s, from 1 m/s"
    if facts.rolling or not facts.friction:
        return [Answer("roll", name, "1", kept[0], physical=1.0)]
    heavy = facts.mass + facts.armature + (inertia + facts.armature) / radius**2
    drag = (facts.falls.linear + facts.spins[0].linear / radius**2, facts.falls.quadratic + facts.spins[0].quadratic / radius**3)
    exact = float(spin_about_axis(1.0, 1.0, heavy, 0.0, *drag))
    return [judged(body, "roll", name, "1", dts, kept, [exact] * len(dts), 1.0)]


QUESTIONS = (fall, spin, tumble, impact, rest, slide, roll)


def judged(
    body: LooseBody,
    question: str,
    quantity: str,
    unit: str,
    dts: Sequence[float],
    values: Sequence[float],
    exact: Sequence[float],
    free: float,
) -> Answer:
    """A value at each time step beside the exact ones: a finding if settings, time step or engine change it by more than 1 %."""
    facts = body.facts
    scale = 100.0 if unit == "%" else max(abs(exact[0]), 1e-300)
    errors = [value - truth for value, truth in zip(values, exact, strict=True)]
    finding: Finding = ""
    settings: tuple[str, ...] = ()
    limit = math.nan
    if facts.unknown:
        exact = [math.nan] * len(values)
        if abs(values[0] - free) > NOTEWORTHY * (100.0 if unit == "%" else abs(free)):
            finding, settings = "setting", (*facts.unknown, *(FRICTIONAL if question == "slide" else ()))
        return Answer(question, quantity, unit, values[0], physical=free, finding=finding, settings=settings)
    if all(map(math.isfinite, values)) and is_sufficient(dts):
        limit = error_budget(dts, errors, negligible=0.1 * NOTEWORTHY * scale).asymptotic_error if any(errors) else 0.0
    if (not math.isfinite(free) and math.isfinite(exact[0])) or abs(exact[0] - free) > NOTEWORTHY * scale:
        finding, settings = "setting", tuple(name for name in ("damping", "armature", "gravcomp") if _acts(body, name))
    elif abs(errors[0]) > NOTEWORTHY * scale * (1.0 + 1e-6):
        vanishes = abs(errors[-1]) < 0.6 * abs(errors[0])
        finding, settings = ("time step", ("integrator", "timestep")) if vanishes else ("model", ())
    return Answer(question, quantity, unit, values[0], exact[0], free, exact[0] + limit, finding=finding, settings=settings)


def _acts(body: LooseBody, setting: str) -> bool:
    facts = body.facts
    return bool({"damping": any(facts.falls), "armature": facts.armature, "gravcomp": facts.lifted}[setting])


def _vector(axis: Array) -> str:
    return f"({', '.join(f'{value:.3g}' for value in axis)})"
