"""A velocity in a plane under a constant acceleration and under friction of constant size that opposes it, for sliding and rolling.

    du/dt = p - a u/|u|        until u = 0; then u = 0 if a >= |p|, else u' = p - a p/|p|

With ψ the angle from p to u, w = tan(ψ/2), λ = ln(w₀/w), c = cos(ψ₀/2), s = sin(ψ₀/2), κ = a/|p|, and D(k) = (1 - e^(-kλ))/k,

    t   = |u₀|/|p| (c² D(κ-1) + s² D(κ+1))
    u   = |u₀| (c² e^(-(κ-1)λ) - s² e^(-(κ+1)λ)) along p,   2 |u₀| c s e^(-κλ) across
    ∫u  = |u₀|²/|p| (c⁴ D(2κ-2) - s⁴ D(2κ+2)) along p,   2 |u₀|²/|p| (c³ s D(2κ-1) + c s³ D(2κ+1)) across

For κ > 1 the velocity vanishes at t = |u₀|/|p| (c²/(κ-1) + s²/(κ+1)), where λ is infinite.

Source: derived by separation of variables in ψ; tests/scenarios/test_dry_friction.py compares it with a Taylor integration.
"""

import math
from collections.abc import Callable

import numpy as np

from dropspin.scenarios.state import Array

Motion = Callable[[Array], tuple[Array, Array]]
"""A function from times [s], shape (n,), to velocities and their integrals, each of shape (n, 3)."""

NEWTON_STEPS = 200
"""At least every other step halves the interval, so far fewer steps suffice."""
ALONG_A_LINE = 1e-15
"""Sine of the angle between velocity and pull up to which they are parallel."""


def dry_friction(start: Array, pull: Array, friction: float) -> tuple[Motion, float]:
    """The motion and the time at which the velocity vanishes, or infinity if it does not.

    Args:
        start: Velocity at t = 0 [m/s], shape (3,).
        pull: Constant acceleration [m/s²], in the same plane, shape (3,).
        friction: Deceleration by friction [m/s²], not negative; infinite if the velocity is 0 and stays 0.
    """
    speed, force = float(np.linalg.norm(start)), float(np.linalg.norm(pull))
    downhill = pull / force if force else np.zeros(3)
    heading = start / speed if speed else downhill
    along = float(heading @ downhill)
    across = heading - along * downhill
    sine = float(np.linalg.norm(across))
    if friction == 0.0 or (force and speed and sine > ALONG_A_LINE):
        return _uniform(start, pull) if friction == 0.0 else _turning(speed, force, friction / force, downhill, along, across)
    # Along a line: it slows down until it stops, and then moves down or stays.
    towards = math.copysign(1.0, along) * force
    stops = speed / (friction - towards) if friction > towards and speed else (0.0 if not speed else math.inf)
    onward = max(force - friction, 0.0) * downhill

    def states(t: Array) -> tuple[Array, Array]:
        until, after = np.minimum(t, stops)[:, None], np.maximum(t - stops, 0.0)[:, None]
        slowing = (towards - friction) * heading if speed else np.zeros(3)
        velocity = np.where(t[:, None] < stops, speed * heading + slowing * until, 0.0) + onward * after
        return velocity, speed * heading * until + 0.5 * slowing * until**2 + 0.5 * onward * after**2

    return states, stops if friction >= force else math.inf


def _uniform(start: Array, pull: Array) -> tuple[Motion, float]:
    return lambda t: (start + pull * t[:, None], start * t[:, None] + 0.5 * pull * t[:, None] ** 2), math.inf


def _turning(speed: float, force: float, ratio: float, downhill: Array, cosine: float, across: Array) -> tuple[Motion, float]:
    """The motion at an angle to the pull; `across` is the heading without its part along the pull."""
    near, far = 0.5 * (1.0 + cosine), 0.5 * (1.0 - cosine)  # c², s²
    product = 0.25 * float(across @ across)  # c² s², without the loss of digits in the smaller one
    near, far = (near, product / near) if near > far else (product / far, far)
    unit = speed / force
    stops = unit * (near / (ratio - 1.0) + far / (ratio + 1.0)) if ratio > 1.0 else math.inf

    def time(turned: Array) -> Array:
        return unit * (near * _decayed(ratio - 1.0, turned) + far * _decayed(ratio + 1.0, turned))

    def pace(turned: Array) -> Array:
        return unit * (near * np.exp((1.0 - ratio) * turned) + far * np.exp(-(1.0 + ratio) * turned))

    def states(t: Array) -> tuple[Array, Array]:
        turned = np.full(len(t), np.inf)
        moving = t < stops
        turned[moving] = _inverse(time, pace, t[moving])
        a, b = near * np.exp((1.0 - ratio) * turned), far * np.exp(-(1.0 + ratio) * turned)
        # 2 c s is the length of `across`, so that c³ s and c s³ are products of c² and s² with it.
        velocity = speed * ((a - b)[:, None] * downhill + np.exp(-ratio * turned)[:, None] * across)
        along = near**2 * _decayed(2.0 * ratio - 2.0, turned) - far**2 * _decayed(2.0 * ratio + 2.0, turned)
        sideways = near * _decayed(2.0 * ratio - 1.0, turned) + far * _decayed(2.0 * ratio + 1.0, turned)
        return velocity, speed * unit * (along[:, None] * downhill + sideways[:, None] * across)

    return states, stops


def _decayed(rate: float, turned: Array) -> Array:
    """D(k) = (1 - exp(-k λ))/k, which is λ for k = 0."""
    if rate == 0.0:
        return turned
    return -np.expm1(-rate * turned) / rate


@np.errstate(divide="ignore", invalid="ignore")  # where the pace is 0 or overflows, the interval is halved
def _inverse(time: Callable[[Array], Array], pace: Callable[[Array], Array], t: Array) -> Array:
    """λ at each time, by Newton's method within a shrinking interval; `time` increases with the pace dt/dλ."""
    low, high = np.zeros(len(t)), np.ones(len(t))
    while (short := time(high) < t).any():
        high[short] *= 2.0
    turned = 0.5 * (low + high)
    for _ in range(NEWTON_STEPS):
        excess = time(turned) - t
        low, high = np.where(excess > 0.0, low, turned), np.where(excess > 0.0, turned, high)
        newton = turned - excess / pace(turned)
        following = np.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high))
        if (np.abs(following - turned) <= 1e-16 * turned).all():
            break
        turned = following
    return turned
