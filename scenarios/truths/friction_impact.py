"""The impulse of one impact with Coulomb friction, where the direction of the slip may turn during the impact.

With the velocity u of the point, u' = u + K j, and N the normal, two models of the impact extend Coulomb's law of a contact force:

    cone         u'_n = -e u_n;  j = j_n (N - f d) against the remaining slip u'_t = s d, s > 0, or u'_t = 0 and |j_t| <= f j_n
    integrated   du/dp = K (N - f d) over the normal impulse p, d = u_t/|u_t|: the law holds at each instant of the impact. Where the slip
                 stops, the point sticks if that needs no more than f, else it slips on in the one direction that lasts. The impact ends by

        newton   at u_n = -e times the initial u_n
        poisson  at (1 + e) times the impulse at which u_n = 0
        energy   where the work of the normal impulse after u_n = 0 is e² times that before

All agree if the point slips in one direction until the impact ends, or if normal and tangential motion are uncoupled, as in a ball of equal
moments; `newton` also agrees with the cone if the slip stops without turning and sticks. Otherwise they are different models, and their
difference is not an error. With Newton's restitution, energy may be gained at a rough corner (T. R. Kane, 1984); with `energy` it is not.

Source: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics (1988), for the cone; E. J. Routh, Elementary Rigid
Dynamics (1905), sections 187-194, J. B. Keller, Impact with friction, J. Applied Mechanics 53 (1986), and W. J. Stronge, Impact Mechanics
(2000), chapters 3 and 4, for the integration and its ends.
Valid for: a point that approaches; a positive coefficient of friction. `cone_impulse` is None where the cone has no solution or several.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from dropspin.scenarios.state import Array

N = np.array([0.0, 1.0, 0.0])
ON_CIRCLE = 1e-6  # distance of a root from the unit circle that is due to rounding
TOLERANCE = 1e-13  # of the integration
STOPPED = -math.log(1e-16)  # decades, by e, of a slip that has stopped


def _along(angle: float) -> Array:
    """The direction d along the floor at an angle from x to z [rad], shape (3,)."""
    return np.array([math.cos(angle), 0.0, math.sin(angle)])


def _across(angle: float) -> Array:
    return _along(angle + 0.5 * math.pi)


def cone_impulse(K: Array, u: Array, e: float, friction: float) -> Array | None:
    """The impulse of the cone law [N s], shape (3,), of a point with response K [1/kg], shape (3, 3), and velocity u [m/s], shape (3,)."""

    def across(angle: float) -> float:
        """The remaining slip across d, times the response of the normal."""
        push = N - friction * _along(angle)
        return float((K[1] @ push) * (u @ _across(angle)) - (1.0 + e) * u[1] * _turning(K, friction, angle))

    impulses = []
    sticks = np.linalg.solve(K, -u - e * u[1] * N)
    if math.hypot(sticks[0], sticks[2]) <= friction * sticks[1]:
        impulses.append(sticks)
    for angle in _angles(across):
        push = N - friction * _along(angle)
        response = float(K[1] @ push)
        if response > 0.0:
            impulse = -(1.0 + e) * u[1] / response * push
            if (u + K @ impulse) @ _along(angle) > 0.0:
                impulses.append(impulse)
    return impulses[0] if len(impulses) == 1 else None


def integrated_impulse(K: Array, u: Array, e: float, friction: float, restitution: str) -> Array:
    """The impulse of the integrated law [N s], shape (3,); `restitution` names its end, the other arguments are as in `cone_impulse`."""
    compression = _Phase(u, 0.0, 0.0)
    at_rest = _advanced(K, friction, compression, lambda phase: phase.velocity[1])
    ends: dict[str, Callable[[_Phase], float]] = {
        "newton": lambda phase: phase.velocity[1] + e * u[1],
        "poisson": lambda phase: phase.impulse - (1.0 + e) * at_rest.impulse,
        "energy": lambda phase: phase.work - (1.0 - e**2) * at_rest.work,
    }
    left = _advanced(K, friction, at_rest, ends[restitution]) if e > 0.0 else at_rest
    return np.asarray(np.linalg.solve(K, left.velocity - u), dtype=np.float64)


class _Phase(NamedTuple):
    """A moment of an impact: the velocity of the point [m/s], shape (3,), and the normal impulse [N s] and its work [J] until then."""

    velocity: Array
    impulse: float
    work: float


def _advanced(K: Array, friction: float, begin: _Phase, remaining: Callable[[_Phase], float]) -> _Phase:
    """The moment at which a quantity, which is negative before, becomes 0."""
    slip = math.hypot(begin.velocity[0], begin.velocity[2])
    if slip > 0.0:
        begin, is_end = _slid(K, friction, begin, slip, remaining)
        if is_end:
            return begin
    from scipy.optimize import brentq

    # The slip has stopped: the velocity changes by the same amount per impulse from here on.
    held = np.linalg.solve(K, N)  # the impulse that changes the normal velocity alone
    change: Array = N / held[1]
    if math.hypot(held[0], held[2]) > friction * held[1]:
        lasting = [angle for angle in _angles(partial(_turning, K, friction)) if _along(angle) @ K @ (N - friction * _along(angle)) > 0.0]
        [change] = [K @ (N - friction * _along(angle)) for angle in lasting]

    def after(p: float) -> _Phase:
        work = begin.work + p * (begin.velocity[1] + 0.5 * p * change[1])
        return _Phase(begin.velocity + p * change, begin.impulse + p, work)

    longest = 1.0
    while remaining(after(longest)) < 0.0:
        longest *= 2.0
    return after(float(brentq(lambda p: remaining(after(p)), 0.0, longest, xtol=1e-300, rtol=1e-15)))


def _slid(K: Array, friction: float, begin: _Phase, slip: float, remaining: Callable[[_Phase], float]) -> tuple[_Phase, bool]:
    """The moment at which the slip stops, or at which the given quantity becomes 0, and whether it is the latter.

    With dp = |u_t| dτ, the angle φ of the slip has an equation of its own, and a slip that stops decays exponentially:
    φ' = d⊥·c, (ln |u_t|)' = d·c, with c = K (N - f d).
    """
    from scipy.integrate import solve_ivp

    def phase(y: Array) -> _Phase:
        return _Phase(slip * math.exp(y[1]) * _along(y[0]) + y[2] * N, y[3], y[4])

    def rates(_: float, y: Array) -> list[float]:
        speed, change = slip * math.exp(y[1]), K @ (N - friction * _along(y[0]))
        return [float(change @ _across(y[0])), float(change @ _along(y[0])), speed * change[1], speed, speed * y[2]]

    def ends(_: float, y: Array) -> float:
        return remaining(phase(y))

    def stops(_: float, y: Array) -> float:
        return float(y[1] + STOPPED)

    ends.terminal = stops.terminal = True  # type: ignore[attr-defined]
    start = [math.atan2(begin.velocity[2], begin.velocity[0]), 0.0, begin.velocity[1], begin.impulse, begin.work]
    solved = solve_ivp(rates, (0.0, math.inf), start, "DOP853", rtol=TOLERANCE, atol=1e-3 * TOLERANCE, events=(ends, stops))
    is_end = len(solved.t_events[0]) > 0
    last = phase(solved.y[:, -1])
    return (last, True) if is_end else (last._replace(velocity=last.velocity * N), False)


def _turning(K: Array, friction: float, angle: float) -> float:
    """The part across d of the change of velocity K (N - f d)."""
    return float(_across(angle) @ K @ (N - friction * _along(angle)))


def _angles(function: Callable[[float], float]) -> list[float]:
    """The zeros of a trigonometric polynomial of second degree [rad]."""
    samples = [function(2.0 * math.pi * k / 5.0) for k in range(5)]
    coefficients = np.fft.fftshift(np.fft.fft(samples))  # of exp(-2iφ) to exp(2iφ)
    return [float(np.angle(root)) for root in np.roots(coefficients[::-1]) if abs(abs(root) - 1.0) < ON_CIRCLE]
