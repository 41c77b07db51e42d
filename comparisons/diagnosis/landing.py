"""How a body lands and rests on a surface."""

import math
from collections.abc import Sequence
from dataclasses import replace

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


def impact(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The rebound above the surface in the file's pose, over speeds and start phases; the depth and the time in contact at 1 m/s."""
    if not body.facts.lands:
        return []
    answers = [rebound(body, dts, speed, REBOUND) for speed in IMPACTS]
    if "restitution" in body.remedies:
        lively = body.tried(("restitution",))
        answers += [rebound(lively, dts, speed, f"{REBOUND} on a surface with restitution 1") for speed in IMPACTS]
    _, upward, depths, times = _rebounds(body, 1.0, dts[0], PHASES)
    longest = float(np.max(times))
    detail = f"> {WATCHED:g} s" if math.isinf(longest) else ""
    of_upward = Answer("impact", "largest upward / impact speed", "1", speed=1.0, measured=float(np.mean(upward)))
    answers.append(replace(of_upward, least=float(min(upward)), most=float(max(upward))))
    answers.append(Answer("impact", "penetration", "m", speed=1.0, measured=float(np.max(depths))))
    answers.append(Answer("impact", "contact", "s", speed=1.0, measured=longest, detail=detail))
    return answers


def rebound(body: LooseBody, dts: Sequence[float], speed: float, quantity: str) -> Answer:
    """The rebound over the speed of an impact [m/s], the mean over start phases: a finding if time step, phase or engine change it."""
    ratios = [_rebounds(body, speed, dt, FEWER if number else PHASES)[0] for number, dt in enumerate(dts)]
    means = [float(np.mean(ratio)) for ratio in ratios]
    limit = 0.0 if max(means) == 0.0 else math.nan
    if is_sufficient(dts) and max(means) > 0.0:
        noise = [max(float(np.ptp(ratio)) / math.sqrt(12.0) / len(ratio), LEAST_NOISE) for ratio in ratios]
        budget = error_budget(dts, means, resolution=noise, signed=False, negligible=0.1 * NOTEWORTHY)
        limit = math.nan if budget.cause == "unresolved" else budget.asymptotic_error
    exact = math.nan if body.facts.restitution is None else body.facts.restitution
    change = abs(means[0] - (means[-1] if math.isnan(exact) else exact))
    findings: tuple[Finding, ...] = ()
    if max(change, float(np.ptp(ratios[0]))) > NOTEWORTHY:
        stays = not math.isnan(exact) and abs(means[-1] - exact) >= 0.6 * change
        kind: Kind = "model" if stays else "time step"
        finest = "" if math.isfinite(limit) or len(dts) < 2 else f"but {means[-1]:.3g} at {1e3 * dts[-1]:.3g} ms"
        findings = (Finding(kind, (*body.causes.get("impact", ()), "timestep"), detail=finest),)
    answer = Answer("impact", quantity, "1", speed=speed, measured=means[0], in_force=exact, limit=limit, findings=findings)
    return replace(answer, least=float(min(ratios[0])), most=float(max(ratios[0])))


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


def rest(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The depth of the body at rest, and its speed there: findings if they differ from the exact ones by 1 % of the body's size."""
    facts = body.facts
    through = Finding("setting", ("contype", "conaffinity"), detail=facts.missed)
    support = [Answer("rest", "support", "", detail="none", findings=(through,))] if facts.missed else []
    if not facts.lands:
        return support
    noteworthy = NOTEWORTHY * max(float(np.linalg.norm(facts.points, axis=1).max()), 1e-12)
    depth, speed, tips = _at_rest(body, dts[0])
    depth_error, moving = abs(depth - facts.rest_depth), 0.0 if tips else speed
    is_wrong = depth_error > noteworthy or moving > noteworthy
    finest_depth, finest_speed, _ = _at_rest(body, dts[-1]) if is_wrong else (depth, speed, tips)
    floats = facts.margin > 0.0 and -depth > noteworthy
    of_depth = (Finding("setting", ("margin",)),) * floats + _of_error(depth_error, abs(finest_depth - facts.rest_depth), noteworthy)
    of_speed = _of_error(moving, finest_speed, noteworthy)
    return [
        *support,
        Answer("rest", "penetration", "m", measured=depth, in_force=facts.rest_depth, physical=0.0, findings=of_depth),
        Answer("rest", "drift speed", "m/s", measured=speed, physical=0.0, detail=TIPS * tips, findings=of_speed),
    ]


def _of_error(error: float, finest: float, noteworthy: float) -> tuple[Finding, ...]:
    """The finding of an error that exceeds a limit, by what the error is at the finest time step; none if the error is not known."""
    return (Finding("time step" if finest < 0.6 * error else "model", ("timestep",)),) * (error > noteworthy)


def _at_rest(body: LooseBody, dt: float) -> tuple[float, float, bool]:
    """The mean depth [m] and the speed [m/s] of a body that was put down, in the last half second, and whether it tips or rolls."""
    states = body.settled if dt == body.facts.dt else body.put_down(dt)
    last = states[-math.ceil(0.5 / dt) :]
    speed = float(np.linalg.norm(np.ptp(last[:, POSITION], axis=0))) / 0.5
    return -float(body.facts.lowest(last).mean()), speed, tilt(states) > UNTURNED


def tilt(states: Array) -> float:
    """The largest angle between the first vertical axis of a body and the later ones [rad]."""
    up = unrotate(states[0, ORIENTATION], UP)
    return float(np.arccos(np.clip(rotate(states[:, ORIENTATION], up)[:, 1], -1.0, 1.0)).max())
