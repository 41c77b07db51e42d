"""How a body falls, spins and tumbles, far from any surface."""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from dropspin.comparisons.diagnosis.answers import DECAY_TIME, KEPT, NOTEWORTHY, Answer, Finding, judged, vector_text
from dropspin.comparisons.diagnosis.geometries import DIRECTIONS
from dropspin.comparisons.diagnosis.loose_body import STILL, LooseBody, time_of_decay
from dropspin.comparisons.engines.base import Diverged
from dropspin.scenarios.rotations import unrotate
from dropspin.scenarios.state import ORIENTATION, SPIN, UP, Array
from dropspin.scenarios.truths.damped_joint import terminal_speed

FALL, TURN = 1.0, 1.0  # s
SPEED = 10.0  # rad/s
OBLIQUE = np.array([0.6, 0.48, 0.64])
"""The stated direction of a spin, in the body frame."""
STATED = Answer("tumble", f"energy change in 1 s, {SPEED:g} rad/s", "%", vector_text(OBLIQUE), physical=0.0)
DIAGONALS = np.array([[0, 1, 1], [1, 0, 1], [1, 1, 0], [0, 1, -1], [1, 0, -1], [1, -1, 0]]) / math.sqrt(2.0)
FASTEST, SLOWEST = 1e3, 1e-2  # rad/s
LONGEST = 1_000_000
"""Steps of one question at most."""


def fall(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The distance fallen in a second, and the terminal speed."""
    if not body.gravity > 0.0:
        return [Answer("fall", "gravity", "", detail="none")]
    start, fallen = body.start(), []
    for dt in dts:
        steps = math.ceil(round(FALL / dt, 9))
        ends = body.motions(start[np.newaxis], dt, steps, -body.gravity * UP, floor=False)[0, -3:, 1]
        at = 2.0 + (FALL - steps * dt) / dt  # a step that does not divide the time: on the parabola through the last three heights
        fallen.append(start[1] - np.array([(at - 1.0) * (at - 2.0) / 2.0, at * (2.0 - at), at * (at - 1.0) / 2.0]) @ ends)
    free, exact = 0.5 * body.gravity * FALL**2, [body.fallen(FALL)] * len(dts)
    answers = [judged(body, Answer("fall", "distance in 1 s", "m", physical=free), dts, fallen, exact)]
    if any(body.falls) and not body.unknown:
        speed = terminal_speed(body.gravity * (1.0 - body.lifted), body.mass, *body.falls)
        answers.append(Answer("fall", "terminal speed", "m/s", in_force=speed, physical=math.inf))
    return answers


def spin(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The decay of a spin about each principal axis."""
    answers = []
    for number, axis in enumerate(body.principal[1].T):
        direction, start = vector_text(axis), body.start(spin=SPEED * axis)
        decay = body.slowed(number, SPEED)
        if decay < TURN:
            answer, exact = Answer("spin", DECAY_TIME, "s", direction, physical=math.inf), [decay] * len(dts)
            values = [_decay(body, start, dt, decay) for dt in dts]
            if math.isnan(values[0]):
                unstable = Finding("time step", (*body.causes.get("spin", ()), "timestep"), detail="because the spin diverges")
                answers.append(replace(answer, in_force=decay, detail="none", findings=(unstable,)))
                continue
        else:
            answer = Answer("spin", KEPT, "1", direction, physical=1.0)
            exact = [body.spun(number, SPEED, round(TURN / dt) * dt) / SPEED for dt in dts]
            values = [float(np.linalg.norm(_turned(body, start, dt)[SPIN])) / SPEED for dt in dts]
        answers.append(judged(body, answer, dts, values, exact))
    return answers


def _decay(body: LooseBody, start: Array, dt: float, tau: float) -> float:
    """The time at which a spin is 1/e of its start [s], interpolated between steps as an exponential; NaN if the spin grows."""
    steps = min(math.ceil(3.0 * tau / dt) + 3, LONGEST)
    try:
        speeds = np.linalg.norm(body.motions(start[np.newaxis], dt, steps, STILL, floor=False)[0, :, SPIN], axis=1)
    except Diverged:
        return math.nan
    grows = speeds.max() > (1.0 + NOTEWORTHY) * speeds[0]  # by damping that is integrated explicitly, in too large steps
    return math.nan if grows else time_of_decay(dt * np.arange(1.0 + steps), speeds)


def _turned(body: LooseBody, starts: Array, dt: float) -> Array:
    """The states after a second without gravity and contacts, of one start, shape (13,), or of several, shape (n, 13)."""
    motions = body.motions(np.atleast_2d(starts), dt, round(TURN / dt), STILL, floor=False)
    return motions[:, -1].reshape(starts.shape)


def tumble(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The change of energy of a spin about no principal axis, which turns freely, and the error of the attitude."""
    if not _tumbles(body):
        return []
    start, after, exact = _stated(body, dts[0])
    ends = [_turned(body, start, dt) for dt in dts]
    gains = [float(_energy_gain(body, start, end)) for end in ends]
    of_stated = judged(body, STATED, dts, gains, [exact] * len(dts))
    if body.unknown:
        return [of_stated]
    turned = 2.0 * math.degrees(math.acos(min(1.0, abs(float(ends[0][ORIENTATION] @ after[ORIENTATION])))))
    return [of_stated, Answer("tumble", "attitude error", "°", measured=turned, in_force=0.0)]


def worst_tumble(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """The largest change of energy of a spin over many axes, and from which spin and time step it exceeds 1 %."""
    dt = dts[0]
    if not _tumbles(body) or body.unknown:
        return []
    start, _, exact = _stated(body, dt)
    if abs(exact) > 100.0 * NOTEWORTHY:  # of damping, which no direction and no step is without
        return []
    axes = body.principal[1]
    tried = np.concatenate([DIRECTIONS[DIRECTIONS[:, 1] >= 0.0], DIAGONALS, [OBLIQUE]]) @ axes.T
    by_direction = _energy_gain(body, starts := np.array([body.start(spin=SPEED * axis) for axis in tried]), _turned(body, starts, dt))
    worst = int(np.argmax(np.abs(by_direction)))
    answers = [Answer("tumble", "largest energy change", "%", vector_text(tried[worst]), measured=float(by_direction[worst]))]
    if abs(by_direction[worst] - exact) > 100.0 * NOTEWORTHY:
        speed = _threshold(lambda w: _gain(body, body.start(spin=w * tried[worst]), dt), SLOWEST, FASTEST)
        answers.append(replace(answers[0], quantity="spin for 1 %", unit="rad/s", measured=speed))
    if abs(_gain(body, start, dt) - exact) > 100.0 * NOTEWORTHY:
        step = _threshold(lambda dt: _gain(body, start, dt), 1e-2 * dt, dt)
        answers.append(replace(STATED, quantity="dt for 1 %", unit="s", physical=math.nan, measured=step))
    return answers


def _tumbles(body: LooseBody) -> bool:
    """Whether a spin of a body is not about a principal axis always, and not damped within a second."""
    moments = body.principal[0]
    is_slowed = any(body.slowed(axis, SPEED) < TURN for axis in range(3))
    return bool(np.ptp(moments) >= 1e-9 * moments.max()) and not is_slowed


def _stated(body: LooseBody, dt: float) -> tuple[Array, Array, float]:
    """The start of the stated spin; with the settings in force, the exact state after a second in steps of dt and the change of energy."""
    start = body.start(spin=SPEED * OBLIQUE)
    after = body.in_force(start, np.array([0.0, round(TURN / dt) * dt]), 0.0)[-1]
    return start, after, float(_energy_gain(body, start, after))


def _gain(body: LooseBody, start: Array, dt: float) -> float:
    """The change of energy in a second [%]; inf if the simulation breaks down."""
    with suppress(Diverged):
        return float(_energy_gain(body, start, _turned(body, start, dt)))
    return math.inf


def _energy_gain(body: LooseBody, first: Array, last: Array) -> Array:
    """The change of the kinetic energy of rotation from first to last states [%], shape (...)."""

    def energy(states: Array) -> Array:
        spins = unrotate(states[..., ORIENTATION], states[..., SPIN])
        return np.einsum("...i,ij,...j->...", spins, body.inertia, spins)

    return 100.0 * (energy(last) / energy(first) - 1.0)


def _threshold(gain: Callable[[float], float], low: float, high: float) -> float:
    """The value from which a gain that grows with it exceeds 1 %, by bisection; inf if it does nowhere, low if it does from there."""
    if abs(gain(high)) < 100.0 * NOTEWORTHY:
        return math.inf
    while high > 1.02 * low:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if abs(gain(middle)) >= 100.0 * NOTEWORTHY else (middle, high)
    return low
