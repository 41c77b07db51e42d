"""A box that stands on an edge falls about it, lands on a face, and rocks from edge to edge until it lies still.

ψ is the angle at the pivot between the vertical and the centre of mass, R their distance, k = I/(M R²):

    ψ'' = p² sin ψ,   p² = g / ((1 + k) R)               (an inverted pendulum)
    sin(ψ/2) = √s nd(u),   ψ' = 2p √s √(1-s) sd(u)       u = p (t - T); at rest at the time T with sin²(ψ/2) = s; modulus² = 1 - s

The box lands at tan α = a/h, where a is the half width of the face on which it lands and h the half height above that face, and continues
about the other edge of that face. For the rockings n = 0, 1, …:

    ω⁺/ω⁻ = r = (k R² + h² - a²) / ((1 + k) R²)          (conservation of angular momentum about the new pivot)
    sin²(α/2) - s_n = r²ⁿ (sin²(α/2) - s_0)              (from one rocking motion to the next)

For r <= 0 the box stops at the first landing. The landings accumulate like the impacts of a bouncing ball; then the box lies still.

Source: G. W. Housner, Bull. Seismological Soc. America 53 (1963), 403-417, for the landing; E. T. Whittaker, Analytical Dynamics,
section 44, for the pendulum.
Valid for: a box that stands on one edge, at rest or turning about it too slowly to pass the top; infinite friction and restitution 0, or
any restitution until it lands; gravity straight down, no damping; a normal force that is never negative: k + 3 cos²ψ - 2 cos ψ (1 - 2 s) >=
0.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.model import TOUCHING, Scenario
from scenarios.rotations import about, multiply
from scenarios.state import ORIENTATION, UP, VELOCITY
from scenarios.truths.elliptic import argument, jacobi
from scenarios.truths.stand import MIN_LEVEL, Stand, on_one_edge
from scenarios.truths.truth import Impact, Truth

Array = NDArray[np.float64]

PENDULUM = "inverted pendulum by Jacobi's elliptic functions (Whittaker, section 44)"
MAX_ROCKINGS = 100_000
MIN_ENERGY_SHARE = 1e-24
"""Energy of a rocking motion relative to the first one, below which the box counts as resting, as in the bounce ladder."""


class _Ladder(NamedTuple):
    """The successive rocking motions: time of rest [s], sin²(ψ/2) at rest, and time of landing [s]; shapes (n,)."""

    rests: Array
    levels: Array
    landings: Array


def rocking(scene: Scenario) -> Truth | None:
    """The exact solution of a box that falls about an edge."""
    floor = scene.floor
    if floor is None or floor.friction != "infinite" or scene.damping is not None:
        return None
    stand = on_one_edge(scene)
    if stand is None or not _pivots(scene, stand):
        return None
    ladder = _ladder(stand, scene.duration)
    if ladder is None:
        return None

    def states(t: Array) -> Array:
        # The time of a landing belongs to the rocking before it.
        begins = np.concatenate([[0.0], ladder.landings])
        number = np.maximum(np.searchsorted(begins, t, side="left") - 1, 0)
        lies = number == len(ladder.rests)
        which = np.minimum(number, len(ladder.rests) - 1)
        half_sine, speed = _pendulum(_rate(stand), t - ladder.rests[which], ladder.levels[which])
        angle = np.where(lies, stand.flat, 2.0 * np.arcsin(half_sine))
        return _states(scene, stand, number, angle, np.where(lies, 0.0, speed))

    if not len(ladder.landings) or ladder.landings[0] > scene.duration:
        return Truth("tipping", PENDULUM, states, horizon=scene.duration)
    if floor.restitution > 0.0:
        return Truth("tipping", PENDULUM, states, horizon=float(ladder.landings[0]))
    statement = f"{PENDULUM}; angular momentum about the new edge is conserved on landing (Housner 1963)"
    return Truth("rocking", statement, states, _impacts(scene, stand, ladder), scene.duration)


def _pivots(scene: Scenario, stand: Stand) -> bool:
    """Whether the edge on which the box stands is at rest."""
    velocity = scene.initial_state[VELOCITY]
    turning = np.cross(stand.speed * stand.falling, stand.to_centre)
    return bool(np.abs(velocity - turning).max() <= TOUCHING * np.linalg.norm(velocity))


def _rate(stand: Stand) -> float:
    """The parameter p of the pendulum [1/s]."""
    return math.sqrt(stand.gravity / ((1.0 + stand.share) * stand.radius))


def _ratio(stand: Stand) -> float:
    """Ratio r of the angular speeds after and before a landing."""
    squares = stand.half_height**2 - stand.half_width**2
    return (stand.share * stand.radius**2 + squares) / ((1.0 + stand.share) * stand.radius**2)


def _ladder(stand: Stand, duration: float) -> _Ladder | None:
    """All rocking motions until the scene ends or the box lies still; None if the box passes the top, lifts off, or lands too often."""
    at_start, at_end = math.sin(0.5 * stand.angle) ** 2, math.sin(0.5 * stand.flat) ** 2
    risen = (0.5 * stand.speed / _rate(stand)) ** 2
    level = at_start - risen
    if level < MIN_LEVEL or _would_lift_off(stand, level):
        return None
    rest = math.copysign(_time_from_rest(stand, level, risen), -stand.speed)
    fallen = at_end - level
    rests, levels, landings = [rest], [level], [rest + _time_from_rest(stand, level, fallen)]
    while _ratio(stand) > 0.0 and landings[-1] <= duration and len(rests) < MAX_ROCKINGS:
        still = _ratio(stand) ** (2 * len(rests)) * fallen
        if still < MIN_ENERGY_SHARE * fallen:
            break
        half = _time_from_rest(stand, at_end - still, still)
        rests.append(landings[-1] + half)
        levels.append(at_end - still)
        landings.append(rests[-1] + half)
    if len(rests) == MAX_ROCKINGS:
        return None
    return _Ladder(np.array(rests), np.array(levels), np.array(landings))


def _would_lift_off(stand: Stand, level: float) -> bool:
    """Whether the normal force would be negative at some angle of the first rocking motion, which is the widest."""
    at_rest = 1.0 - 2.0 * level
    cosine = min(max(at_rest / 3.0, math.cos(stand.flat)), at_rest)
    return stand.share + 3.0 * cosine**2 - 2.0 * cosine * at_rest < 0.0


def _time_from_rest(stand: Stand, level: float, fallen: float) -> float:
    """Time [s] from rest at sin²(ψ/2) = level to sin²(ψ/2) = level + fallen."""
    now = level + fallen
    sn = math.sqrt(fallen / (now * (1.0 - level)))
    cn = math.sqrt(level * (1.0 - now) / (now * (1.0 - level)))
    return argument(sn, cn, level) / _rate(stand)


def _pendulum(rate: float, since_rest: Array, level: Array) -> tuple[Array, Array]:
    """Sin(ψ/2) and ψ' [rad/s] at times since rest [s], shape (n,), for the level of each, shape (n,)."""
    sn, _, dn = jacobi(rate * since_rest, level)
    return np.sqrt(level) / dn, 2.0 * rate * np.sqrt(level * (1.0 - level)) * sn / dn


def _states(scene: Scenario, stand: Stand, number: NDArray[np.intp], angle: Array, speed: Array) -> Array:
    """States, shape (n, 13), of the rocking motions with these numbers n, at angles ψ [rad] and speeds ψ' [rad/s], shapes (n,)."""
    side = np.where(number % 2 == 0, 1.0, -1.0)[:, None]
    pivot = stand.pivot + np.where(side > 0.0, 0.0, 2.0 * stand.half_width) * stand.outward
    sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]
    to_centre = stand.radius * (side * sine * stand.outward + cosine * UP)
    turned = stand.flat - stand.angle - side[:, 0] * (stand.flat - angle)
    spin = side * speed[:, None] * stand.falling
    orientation = multiply(about(stand.falling, turned), scene.initial_state[ORIENTATION])
    return np.hstack([pivot + to_centre, orientation, np.cross(spin, to_centre), spin])


def _impacts(scene: Scenario, stand: Stand, ladder: _Ladder) -> tuple[Impact, ...]:
    """The landings within the scene's duration."""
    times = ladder.landings[ladder.landings <= scene.duration]
    number = np.arange(len(times))
    flat = np.full(len(times), stand.flat)
    speeds = 2.0 * _rate(stand) * np.sqrt(math.sin(0.5 * stand.flat) ** 2 - ladder.levels[: len(times)])
    stops = number == len(ladder.rests) - 1
    before = _states(scene, stand, number, flat, speeds)
    after = _states(scene, stand, number + 1, flat, np.where(stops, 0.0, -_ratio(stand) * speeds))
    return tuple(Impact(float(time), *pair) for time, *pair in zip(times, before, after, strict=True))
