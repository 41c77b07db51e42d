"""How a body slides, creeps and rolls on a surface."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dropspin.comparisons.diagnosis.answers import KEPT, MOVES, NOTEWORTHY, TIPS, UNTURNED, WATCHED, Answer, Finding, judged
from dropspin.comparisons.diagnosis.landing import is_at_rest, tilt
from dropspin.comparisons.diagnosis.loose_body import LooseBody
from dropspin.scenarios.rotations import about, conjugate, multiply, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, UP, VELOCITY, Array
from dropspin.scenarios.truths.damped_joint import spin_about_axis

SLIDE = 0.5  # m/s
LONGEST_SLIDE = 5.0  # m
LONG_SLIDE = 0.25  # s, within which a body stops
SHORT = 0.1
"""Relative error up to which a shorter slide says more of the time in which soft contacts take up a load than of friction."""
CENTRAL = 1e-9
"""Distance of the middle of a ball from the centre of mass, relative to its radius, that is attributed to rounding."""
STOPPED = 1e-3  # m/s, of a ball that rolled at 1 m/s
MARGINAL = 1.01
"""Ratio of the two levers up to which a body, such as a cube with a coefficient of friction of 1, is not said to tip."""
LEANING = np.array([0.0, 0.01, 0.0101])
"""Angles by which the lever of the weight about the leading edge is found [rad]; an uneven load tilts a body at rest by less."""
EDGES = np.radians(np.arange(-80.0, 81.0))
"""Directions from that of a slide to the normals of edges about which the body may turn [rad]."""
WAYS = {"0°": np.array([1.0, 0.0, 0.0]), "45°": math.sqrt(0.5) * np.array([1.0, 0.0, 1.0])}
"""Directions of a slide, by their angle to an axis of the surface."""


def slide(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The distance in which a body that slides stops, along an axis of the surface and at 45 degrees to it."""
    if not body.lands or not body.friction > 0.0 or _is_ball(body):
        return []
    free, exact = SLIDE**2 / (2.0 * body.friction * body.gravity), _stop(body)
    blank, long = Answer("slide", "stopping distance", "m", speed=SLIDE, physical=free), f"more than {LONGEST_SLIDE:g} m: not simulated"
    if free > LONGEST_SLIDE:
        return [replace(blank, detail=long)]
    if SLIDE / (body.friction * body.gravity) < body.dt:
        return [replace(blank, detail="within a step: not simulated")]
    if not is_at_rest(body):
        return [replace(blank, direction=way, detail=MOVES) for way in WAYS]
    end = body.settled[-1:]
    rests = [body.motions(end, dt, math.ceil(WATCHED / dt), -body.gravity * UP, floor=True)[0, -1] for dt in dts]
    least = float(np.nanmin([body.friction, body.friction_across]))
    longest = SLIDE**2 / (2.0 * LONGEST_SLIDE * body.gravity)  # the friction of the longest slide
    each = zip(WAYS.items(), (body.friction, max(least, longest)), strict=True)
    answers = []
    for (way, direction), friction in each:
        found = [] if _is_tipped(body, end[0], direction) else _stops(body, dts, rests, direction, friction)
        of_way = replace(blank, direction=way)
        answers.append(judged(body, of_way, dts[: len(found)], found, [exact] * len(found)) if found else replace(of_way, detail=TIPS))
    if not math.isnan(body.friction_across) and not answers[1].detail:
        turned = replace(blank, direction="45°", physical=math.nan)
        return [answers[0], replace(turned, detail=long) if least < longest else replace(turned, measured=answers[1].measured)]
    if SLIDE / (body.friction * body.gravity) < LONG_SLIDE:
        answers = [_of_short_slide(one) for one in answers]
    return answers


def _of_short_slide(answer: Answer) -> Answer:
    """An answer without the finding of an error that is small for a short slide."""
    is_small = abs(answer.measured - answer.exact) <= SHORT * answer.exact
    change, deviation = answer.in_force - answer.physical, answer.measured - answer.physical
    # Of a setting whose small effect such errors hide or exceed, the deviation says nothing.
    shows = math.copysign(deviation, deviation * change) > NOTEWORTHY * answer.physical
    is_kept = [not is_small if found.is_error or math.isnan(change) else shows for found in answer.findings]
    return replace(answer, findings=tuple(found for found, kept in zip(answer.findings, is_kept, strict=True) if kept))


def _stops(body: LooseBody, dts: Sequence[float], rests: Sequence[Array], direction: Array, friction: float) -> list[float]:
    """The distances in which a body that slides in a direction stops [m], with this friction or more, down to a step at which it tips."""
    found = []
    for dt, rest in zip(dts, rests, strict=True):
        start = rest.copy()
        start[VELOCITY], start[SPIN] = SLIDE * direction, 0.0
        steps = math.ceil((1.5 * SLIDE / (friction * body.gravity) + 0.1) / dt)
        states = body.motions(start[np.newaxis], dt, steps, -body.gravity * UP, floor=True)[0]
        if tilt(states) > UNTURNED:
            break
        foot = unrotate(start[ORIENTATION], -start[1] * UP)  # a point of the body below its centre, which sways less
        moved = states[-1, POSITION] - start[POSITION] + rotate(states[-1, ORIENTATION], foot) - rotate(start[ORIENTATION], foot)
        found.append(float(np.hypot(moved[0], moved[2])))  # friction that differs between directions turns the motion
    return found


def _is_tipped(body: LooseBody, rest: Array, direction: Array) -> bool:
    """Whether friction turns a rigid body that slides in a direction over its leading edge: at first its weight has the shorter arm."""
    yaw, leans = about(UP, EDGES)[:, np.newaxis], about(np.cross(UP, direction), LEANING)
    states = np.zeros((len(EDGES), len(LEANING), 13))
    states[..., ORIENTATION] = multiply(multiply(yaw, multiply(leans, conjugate(yaw))), rest[ORIENTATION])
    heights = -body.lowest(states.reshape(-1, 13))  # of the centre of mass, which rises by the lever as the body leans, and falls
    height, leaning, further = heights.reshape(-1, len(LEANING)).T
    levers = (further - leaning) / (LEANING[2] - LEANING[1]) + LEANING[1] * leaning
    return bool((body.friction * height > MARGINAL * levers / np.cos(EDGES)).any())


def _stop(body: LooseBody) -> float:
    """The exact distance in which friction and damping stop a body [m]: the integral of v over its deceleration."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    v = 0.5 * SLIDE * (1.0 + nodes)
    dry = body.friction * body.mass * body.gravity * (1.0 - body.lifted)
    force = dry + v * (body.falls.linear + v * (body.falls.quadratic + v * body.falls.cubic))
    return float(0.5 * SLIDE * weights @ ((body.mass + body.armature) * v / force))


def creep(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The speed of a body on a slope of half of its friction, which should hold it."""
    dt = dts[0]
    if not body.lands or not body.friction > 0.0 or _is_ball(body):
        return []
    answer = Answer("slide", "creep on a slope of half of the friction", "m/s", physical=0.0)
    if not is_at_rest(body):
        return [replace(answer, detail=MOVES)]
    slope = math.atan(0.5 * body.friction)
    gravity = body.gravity * np.array([math.sin(slope), -math.cos(slope), 0.0])
    start = body.settled[-1:].copy()
    start[:, VELOCITY] = start[:, SPIN] = 0.0
    states = body.motions(start, dt, math.ceil(1.0 / dt), gravity, floor=True)[0]
    if tilt(states) > UNTURNED:
        return [replace(answer, detail=TIPS)]
    half = len(states) // 2
    moved = float(np.linalg.norm((states[-1] - states[half])[POSITION]))
    return [replace(answer, measured=moved / (dt * (len(states) - 1 - half)))]


def roll(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The speed that a ball keeps as it rolls for a second.

    The second begins when the ball rolls without slip: above a soft surface, its speed is not that of its radius.
    """
    if not body.lands or not _is_ball(body):
        return []
    answer = Answer("roll", KEPT, "1", speed=1.0, physical=1.0)
    if not is_at_rest(body):
        return [replace(answer, detail=MOVES)]
    radius, inertia = float(body.colliding[0].shape.semi_axes[0]), float(body.principal[0].mean())
    start = body.settled[-1:].copy()
    start[:, VELOCITY], start[:, SPIN] = [1.0, 0.0, 0.0], [0.0, 0.0, -1.0 / radius]
    kept, exact = [], []
    heavy = body.mass + body.armature + (inertia + body.armature) / radius**2
    drag = (body.falls.linear + body.spins[0].linear / radius**2, body.falls.quadratic + body.spins[0].quadratic / radius**3)
    for dt in dts:
        before, steps = round(WATCHED / dt), round(1.0 / dt)
        states = body.motions(start, dt, before + steps, -body.gravity * UP, floor=True)[0]
        first, last = (float(states[row][VELOCITY][0]) for row in (before, -1))
        rolls = abs(first) > STOPPED
        kept.append(last / first if rolls else 0.0)
        exact.append(float(spin_about_axis(1.0, first, heavy, 0.0, *drag)) / first if rolls else 0.0)
    is_off_joint = body.offset.any() and (body.armature or any(drag))  # which act at the body's origin
    if (body.rolling or body.falls.cubic) and abs(kept[0] - 1.0) > NOTEWORTHY:
        acting = (*body.unknown, *["damping"] * any(body.falls), *body.rolling)
        return [replace(answer, measured=kept[0], findings=(Finding("setting", acting),))]
    if body.rolling or not body.friction or body.falls.cubic or is_off_joint:
        return [replace(answer, measured=kept[0])]
    return [judged(body, answer, dts, kept, exact)]


def _is_ball(body: LooseBody) -> bool:
    """Whether a body is a ball about its centre of mass, which rolls where others slide."""
    parts = body.colliding
    return len(parts) == 1 and parts[0].shape.is_ball and float(np.abs(parts[0].position).max()) <= CENTRAL * parts[0].shape.size
