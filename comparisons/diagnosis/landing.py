"""How a body lands and rests on a surface."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dropspin.comparisons.diagnosis.answers import NOTEWORTHY, REBOUND, TIPS, UNTURNED, WATCHED, Answer, Finding, Kind
from dropspin.comparisons.diagnosis.loose_body import LooseBody
from dropspin.comparisons.judging.error_budget import error_budget, is_sufficient
from dropspin.scenarios.rotations import rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, UP, VELOCITY, Array

IMPACTS = (0.5, 1.0, 3.0)  # m/s
PHASES, FEWER = 8, 4
"""Start phases at the file's time step, and at finer ones."""
LEAST_NOISE = 1e-6  # of a ratio of speeds
LONGEST_WATCHED = 3.0  # s, for an impact on a soft surface
STILL = 0.01
"""Share of the speed of an impact at which a body that has not left the surface rests on it."""
THROUGH = "passes through"
OF_CONTACT = ("solref", "solimp", "stiffness")
"""Settings of contacts that a file may have, beside restitution and friction."""
SOFTENS = {"cone": ("cone", "friction"), "diagexact": ("diagexact",)}
"""Settings that may make contacts softer, each with what it does so together with."""


class Impacts(NamedTuple):
    """Impacts of a body at one speed, one for each start phase; values are NaN if the body is not seen to leave the surface or to rest.

    Attributes:
        ratios: Rebound speed over impact speed.
        upward: Largest upward speed of the centre of mass over impact speed.
        depths: Largest depth [m].
        times: Time in contact [s]; infinite if the body does not leave the surface.
        failure: Why values are NaN, such as `THROUGH`; empty if they are not.
    """

    ratios: Array
    upward: Array
    depths: Array
    times: Array
    failure: str = ""


def impact(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The rebound above the surface in the file's pose, over speeds and start phases; the depth and the time in contact at 1 m/s."""
    if not body.lands:
        return []
    answers = [rebound(body, dts, speed, REBOUND) for speed in IMPACTS]
    if "restitution" in body.remedies:
        lively = body.tried(("restitution",), body.dt)
        answers += [rebound(lively, dts, speed, f"{REBOUND} on a surface with restitution 1") for speed in IMPACTS]
    found = _impacts(body, 1.0, dts[0], PHASES)
    blank = Answer("impact", "", "1", speed=1.0, detail=found.failure)
    of_upward = replace(blank, quantity="largest upward / impact speed", measured=float(np.mean(found.upward)))
    answers.append(replace(of_upward, least=float(min(found.upward)), most=float(max(found.upward))))
    answers.append(replace(blank, quantity="penetration", unit="m", measured=float(np.max(found.depths))))
    longest = float(np.max(found.times))
    detail = found.failure or (f"> {WATCHED:g} s" if math.isinf(longest) else "")
    answers.append(replace(blank, quantity="contact", unit="s", measured=longest, detail=detail))
    return answers


def rebound(body: LooseBody, dts: Sequence[float], speed: float, quantity: str) -> Answer:
    """The rebound over the speed of an impact [m/s], the mean over start phases: a finding if time step, phase or engine change it."""
    found = [_impacts(body, speed, dt, FEWER if number else PHASES) for number, dt in enumerate(dts)]
    exact = math.nan if body.restitution is None else body.restitution
    answer = Answer("impact", quantity, "1", speed=speed, in_force=exact, detail=found[0].failure)
    if found[0].failure == THROUGH:
        why, of_step = "because the body passes through the surface", found[-1].failure != THROUGH
        acting = () if of_step else (*body.causes.get("impact", ()), *body.in_file(*OF_CONTACT))
        through = Finding("time step" if of_step else "setting", (*acting, "timestep"), detail=why + ", not at smaller steps" * of_step)
        return replace(answer, detail="none", findings=(through,))
    if found[0].failure:
        return answer
    dts = [dt for dt, impacts in zip(dts, found, strict=True) if not impacts.failure]
    ratios = [impacts.ratios for impacts in found if not impacts.failure]
    means = [float(np.mean(ratio)) for ratio in ratios]
    limit = 0.0 if max(means) == 0.0 else math.nan
    if is_sufficient(dts) and max(means) > 0.0:
        noise = [max(float(np.ptp(ratio)) / math.sqrt(12.0) / len(ratio), LEAST_NOISE) for ratio in ratios]
        budget = error_budget(dts, means, resolution=noise, signed=False, negligible=0.1 * NOTEWORTHY)
        limit = math.nan if budget.cause == "unresolved" else budget.asymptotic_error
    change = abs(means[0] - (means[-1] if math.isnan(exact) else exact))
    findings: tuple[Finding, ...] = ()
    if max(change, float(np.ptp(ratios[0]))) > NOTEWORTHY:
        stays = not math.isnan(exact) and abs(means[-1] - exact) >= 0.6 * change
        kind: Kind = "model" if stays else "time step"
        finest = "" if math.isfinite(limit) or len(dts) < 2 else f"but {means[-1]:.3g} at {1e3 * dts[-1]:.3g} ms"
        findings = (Finding(kind, (*body.causes.get("impact", ()), "timestep"), detail=finest),)
    return replace(answer, measured=means[0], limit=limit, findings=findings, least=float(min(ratios[0])), most=float(max(ratios[0])))


def _impacts(body: LooseBody, speed: float, dt: float, phases: int) -> Impacts:
    """The impacts at a speed [m/s], watched until the body leaves the surface or rests on it, or for `LONGEST_WATCHED`.

    The rebound speed is that which the height above the surface would need, which the body reaches from its speed as it leaves the surface.
    """
    g, gap = body.gravity, body.margin
    size = float(np.linalg.norm(body.points, axis=1).max())
    starts = [body.start(height=gap + speed * dt * (phase + 0.5) / phases, velocity=-speed * UP) for phase in range(phases)]
    for seconds in (WATCHED, LONGEST_WATCHED):
        motions = body.motions(np.array(starts), dt, math.ceil(seconds / dt), -g * UP, floor=True)
        heights = [body.lowest(states) for states in motions]
        found = np.array([_impact(states, of_states, gap, dt, speed, g) for states, of_states in zip(motions, heights, strict=True)])
        moves = np.array([np.ptp(of_states[-len(of_states) // 3 :]) > STILL * speed * seconds for of_states in heights])
        if not (np.isinf(found[:, 3]) & moves).any():
            return Impacts(*found.T)
    is_through = any(of_states[-1] < -2.0 * size for of_states in heights)
    unknown = np.full(phases, math.nan)
    return Impacts(unknown, unknown, unknown, unknown, THROUGH if is_through else f"contact > {LONGEST_WATCHED:g} s")


def _impact(states: Array, heights: Array, gap: float, dt: float, speed: float, g: float) -> tuple[float, float, float, float]:
    """The values of `Impacts` of one motion, from the heights of its lowest point."""
    rows = np.arange(len(heights))
    touched = int(np.argmax(heights < gap)) if (heights < gap).any() else len(heights) - 1
    again = rows[(rows > touched) & (heights > gap)]
    watched = int(again[0]) - touched if len(again) else len(rows)
    lowest = touched + int(np.argmin(heights[touched : touched + min(watched, max(2, math.ceil(0.1 / dt)))]))
    left = rows[(rows > lowest) & (heights > gap)]
    upward = float(states[left[0], VELOCITY][1]) if len(left) else 0.0
    energy = upward**2 + 2.0 * g * (heights[left[0]] - gap) if upward > 0.0 else 0.0
    at_impact = math.sqrt(speed**2 + 2.0 * g * (heights[0] - gap))
    fastest = max(0.0, float(states[:, VELOCITY][:, 1].max())) / at_impact
    depth, time = max(0.0, -float(heights.min())), (left[0] - touched) * dt if len(left) else math.inf
    return math.sqrt(energy) / at_impact, fastest, depth, time


def rest(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The depth of the body at rest, and its speed there: findings if they differ from the exact ones by 1 % of the body's size."""
    through = Finding("setting", body.in_file("contype", "conaffinity", "group", "mask"), detail=body.missed)
    support = [Answer("rest", "support", "", detail="none", findings=(through,))] if body.missed else []
    if not body.lands:
        return support
    noteworthy = _noteworthy(body)
    depth, speed, tips = _at_rest(body, dts[0])
    depth_error, moving = abs(depth - body.rest_depth), 0.0 if tips and "wind" not in body.unknown else speed
    is_wrong = depth_error > noteworthy or moving > noteworthy
    finest_depth, finest_speed, _ = _at_rest(body, dts[-1]) if is_wrong else (depth, speed, tips)
    floats = body.margin > 0.0 and -depth > noteworthy
    of_depth = _softened(body, depth, noteworthy) or _of_error(body, depth_error, abs(finest_depth - body.rest_depth), noteworthy)
    if math.isinf(body.rest_depth):
        endless = "and grows without end: a contact without stiffness holds no body"
        of_depth = (Finding("setting", body.in_file(*OF_CONTACT), detail=endless),)
    of_depth = (Finding("setting", ("margin",)),) * floats + of_depth
    of_speed = _of_error(body, moving, finest_speed, noteworthy)
    return [
        *support,
        Answer("rest", "penetration", "m", measured=depth, in_force=body.rest_depth, physical=0.0, findings=of_depth),
        Answer("rest", "drift speed", "m/s", measured=speed, physical=0.0, detail=TIPS * tips, findings=of_speed),
    ]


def _softened(body: LooseBody, depth: float, noteworthy: float) -> tuple[Finding, ...]:
    """The finding of a depth that exceeds a limit [m] and that one of the settings of `SOFTENS` at least halves; none otherwise."""
    acting = SOFTENS.keys() & body.causes.get("rest", ()) if depth > noteworthy else ()
    softens = (name for name in sorted(acting) if _at_rest(body.tried((name,), body.dt), body.dt)[0] < 0.5 * depth)
    return next(((Finding("setting", SOFTENS[name]),) for name in softens), ())


def _of_error(body: LooseBody, error: float, finest: float, noteworthy: float) -> tuple[Finding, ...]:
    """The finding of an error that exceeds a limit, by what the error is at the finest time step; none if the error is not known.

    An error that the time step does not reduce is due to the contact, whose settings may be those of the file.
    """
    if not error > noteworthy:
        return ()
    if finest < 0.6 * error:
        return (Finding("time step", (*body.causes.get("rest", ()), "timestep")),)
    acting = (*body.unknown, *body.causes.get("rest", ()), *body.in_file(*OF_CONTACT))
    return (Finding("setting", acting) if acting else Finding("model", ("timestep",)),)


def _at_rest(body: LooseBody, dt: float) -> tuple[float, float, bool]:
    """The mean depth [m] and the speed [m/s] of a body that was put down, in the last half second, and whether it tips or rolls.

    One that tilts and leaves the surface jumps.
    """
    states = body.settled if dt == body.dt else body.put_down(dt)
    last = states[-math.ceil(0.5 / dt) :]
    speed = float(np.linalg.norm(np.ptp(last[:, POSITION], axis=0))) / 0.5
    heights = body.lowest(last)
    stays = bool(heights.max() <= body.margin + 0.1 * _noteworthy(body))
    return -float(heights.mean()), speed, stays and tilt(states) > UNTURNED


def is_at_rest(body: LooseBody) -> bool:
    """Whether a body that was put down neither rises nor falls in the last half second, to 1 % of its size."""
    last = body.settled[-math.ceil(0.5 / body.dt) :]
    return bool(np.ptp(last[:, POSITION][:, 1]) <= _noteworthy(body))


def _noteworthy(body: LooseBody) -> float:
    """A length from which a difference is noteworthy [m]."""
    return NOTEWORTHY * max(float(np.linalg.norm(body.points, axis=1).max()), 1e-12)


def tilt(states: Array) -> float:
    """The largest angle between the first vertical axis of a body and the later ones [rad]."""
    up = unrotate(states[0, ORIENTATION], UP)
    return float(np.arccos(np.clip(rotate(states[:, ORIENTATION], up)[:, 1], -1.0, 1.0)).max())
