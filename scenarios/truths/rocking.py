"""A body that stands on an edge falls about it, lands on a face, and continues about the next edge: it rocks, or it rolls over its edges.

ψ is the angle at the edge between the direction against gravity and the centre of mass, R their distance, k = I/(M R²):

    ψ'' = p² sin ψ,   p² = g / ((1 + k) R)               (an inverted pendulum)
    s = sin²(ψ/2) - (ψ'/2p)²                             (constant; its energy)
    sin(ψ/2) = √s nd(u),   ψ' = 2p √s √(1-s) sd(u)       if s > 0: u = p (t - T), at rest at the time T; modulus² = 1 - s
    sin(ψ/2) = √m sd(u),   ψ' = 2p √-s nd(u)             if s < 0: u = p √(1-s) (t - T), at the top at T; 1 - modulus² = m = s/(s-1)

A landing on a face at the height h of the centre of mass, which has the distances a from the old edge and b from the new edge along the
face, changes the angular velocity by Housner's ratio, and the body continues about the new edge, where k and R are those of this edge:

    ω⁺/ω⁻ = r = (k R² + h² - a b) / ((1 + k) R²)         (conservation of angular momentum about the new edge)

For a box a = b. For a regular prism of n faces r = (k + cos(2π/n))/(1 + k): a rimless wheel, which on a slope approaches a constant speed
downhill. For r <= 0 the body stops at the landing. If it cannot pass the top any more, it rocks about the edges of one face; the landings
accumulate like the impacts of a bouncing ball, then it lies still.

Source: G. W. Housner, Bull. Seismological Soc. America 53 (1963), 403-417, for the landing; T. McGeer, Int. J. Robotics Research 9 (1990),
62-82, and M. J. Coleman, A. Chatterjee & A. Ruina, Dynamics and Stability of Systems 12 (1997), 139-159, for the wheel; E. T. Whittaker,
Analytical Dynamics, section 44, for the pendulum.
Valid for: a body that stands on one edge, at rest or turning about it, see `on_one_edge`; infinite friction and restitution 0, or any
restitution until it lands; gravity into the floor, which may be sloped across the edge, no damping. It ends where the floor would have to
pull, or where it nearly stops at the top. With the angle θ from the floor's normal and the slope γ, ψ = θ + γ, the normal force is positive
if (k + 3/2) cos γ + 3/2 cos(2θ + γ) > 2 (1 - 2 s) cos θ.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios.model import TOUCHING, Scenario
from dropspin.scenarios.rotations import about, multiply
from dropspin.scenarios.state import ORIENTATION, UP, VELOCITY, Array
from dropspin.scenarios.surfaces import Floor
from dropspin.scenarios.truths.edge_geometry import MIN_LEVEL, Stand, on_one_edge
from dropspin.scenarios.truths.elliptic import argument, jacobi
from dropspin.scenarios.truths.truth import Impact, Truth, impacts_of, piece

PENDULUM = "the body turns about an edge as an inverted pendulum, solved with Jacobi's elliptic functions (Whittaker, section 44)"
MAX_LANDINGS = 100_000
MIN_ENERGY_SHARE = 1e-24
"""Energy of a rocking motion relative to the largest before, below which the body counts as resting, as in the bounce ladder."""


class _Pose(NamedTuple):
    """Number of the edge, angle ψ [rad] and angular velocity ψ' [rad/s]."""

    edge: int
    angle: float
    speed: float


class _Fall(NamedTuple):
    """A motion about one edge.

    Attributes:
        edge: Number of the edge.
        level: s.
        centre: T [s].
        side: Sign of ψ if s > 0, else that of ψ'.
        lands: Time of the landing that ends it [s].
        landing: The pose just before this landing.
    """

    edge: int
    level: float
    centre: float
    side: float
    lands: float
    landing: _Pose


class _Ladder(NamedTuple):
    """The successive motions, the poses with which each begins, and one more pose: that in which the last one ends; the final time [s].

    `rests` is whether the body rests after the last motion, and `ends` why the motion is not known after the final time, if it is not.
    """

    falls: list[_Fall]
    poses: list[_Pose]
    rests: bool
    horizon: float
    ends: str = ""


def rocking(scene: Scenario, floor: Floor) -> Truth | None:
    """The exact solution of a body that falls about an edge."""
    stand = on_one_edge(scene) if floor.friction == "infinite" else None
    if stand is None or not _pivots(scene, stand):
        return None
    ladder = _ladder(stand, scene.duration)
    if not ladder.falls:
        return None

    falls = ladder.falls
    begins = np.array([0.0, *(fall.lands for fall in falls)])
    levels, centres, sides = (np.array([getattr(fall, name) for fall in falls]) for name in ("level", "centre", "side"))
    edges = np.array([pose.edge for pose in ladder.poses])

    def states(t: Array) -> Array:
        number = np.minimum(piece(begins, t), len(falls) - (not ladder.rests))
        lies = number == len(falls)
        which = np.minimum(number, len(falls) - 1)
        half_sine, speed = _pendulum(_rate(stand, edges[which]), t - centres[which], levels[which])
        angle = np.where(lies, ladder.poses[-1].angle, 2.0 * np.arcsin(sides[which] * half_sine))
        return _states(scene, stand, edges[number], angle, np.where(lies, 0.0, sides[which] * speed))

    if falls[0].lands > scene.duration:
        return Truth("tipping", PENDULUM, states, horizon=scene.duration)
    if floor.restitution > 0.0:
        return Truth("tipping", PENDULUM, states, horizon=falls[0].lands, ends="the body lands on a face and rebounds")
    name, source = ("rimless-wheel", "McGeer 1990") if np.ptp([fall.edge for fall in falls]) > 1 else ("rocking", "Housner 1963")
    statement = f"{PENDULUM}; each landing conserves the angular momentum about the new edge ({source})"
    return Truth(name, statement, states, _impacts(scene, stand, ladder), ladder.horizon, ladder.ends)


def _pivots(scene: Scenario, stand: Stand) -> bool:
    """Whether the edge on which the body stands is at rest."""
    velocity = scene.initial_state[VELOCITY]
    turning = np.cross(stand.speed * stand.falling, stand.to_centre)
    return bool(np.abs(velocity - turning).max() <= TOUCHING * np.linalg.norm(velocity))


def _rate(stand: Stand, edge: NDArray[np.intp] | int) -> Array:
    """The parameter p of the pendulum about an edge [1/s]."""
    at = edge % len(stand.radii)
    return np.sqrt(stand.gravity / ((1.0 + stand.shares[at]) * stand.radii[at]))


def _ratio(stand: Stand, old: int, new: int) -> float:
    """Ratio r of the angular velocities after and before a landing."""
    first, last = (edge % len(stand.radii) for edge in sorted((old, new)))
    R, S, at = stand.radii[first], stand.radii[last], new % len(stand.radii)
    product = R * S * math.cos(stand.ahead[first] - stand.behind[last])  # of the vectors from the edges to the centre of mass: h² - a b
    square = stand.radii[at] ** 2
    return float((stand.shares[at] * square + product) / ((1.0 + stand.shares[at]) * square))


def _ends(stand: Stand, edge: int) -> tuple[float, float]:
    """The angles ψ about an edge between which no other edge touches the floor [rad]."""
    at = edge % len(stand.radii)
    return float(stand.behind[at] + stand.slope), float(stand.ahead[at] + stand.slope)


def _ladder(stand: Stand, duration: float) -> _Ladder:
    """All motions until the scene ends, the body lies still, or a motion is not known; there may be none."""
    falls: list[_Fall] = []
    poses = [_Pose(0, stand.angle + stand.slope, stand.speed)]
    now, fastest, rocked = 0.0, 0.0, 0
    while now <= duration and len(falls) < MAX_LANDINGS:
        pose = poses[-1]
        fall = _fall(stand, pose, now)
        if fall is None:
            return _Ladder(falls, poses, False, now, "rounding determines to which side the body falls")
        # The first of several rocking motions between two edges is the widest about its edge.
        if rocked < 2 and _would_lift_off(stand, pose, fall):
            return _Ladder(falls, poses, False, now, "the body would lift off the floor")
        now, fastest = fall.lands, max(fastest, abs(fall.landing.speed))
        after, is_stable = _after(stand, fall.landing)
        falls.append(fall)
        poses.append(after)
        returns = fall.landing.speed * pose.speed < 0.0
        rocked = rocked + 1 if returns else 0
        if is_stable and (after.speed == 0.0 or (returns and after.speed**2 < MIN_ENERGY_SHARE * fastest**2)):
            return _Ladder(falls, poses, True, duration)
    return _Ladder(falls, poses, False, min(now, duration), "" if now > duration else f"landing {MAX_LANDINGS + 1} follows")


def _fall(stand: Stand, pose: _Pose, now: float) -> _Fall | None:
    """The motion from a pose at a time [s] to the next landing; None if it nearly stops at the top or at the landing."""
    edge, angle, speed = pose
    rate, (behind, ahead) = float(_rate(stand, edge)), _ends(stand, edge)
    risen = (0.5 * speed / rate) ** 2
    level = math.sin(0.5 * angle) ** 2 - risen
    if abs(level) < MIN_LEVEL:
        return None
    forward = speed > 0.0 if speed else angle > 0.0
    end = ahead if forward else behind
    rises, ends_across = (angle > 0.0) != forward, (end > 0.0) == forward
    if level > 0.0 and rises and (ends_across or math.sin(0.5 * end) ** 2 < level):  # it turns back
        forward, end = not forward, behind if forward else ahead
    at_end = risen + (math.sin(0.5 * end) ** 2 - math.sin(0.5 * angle) ** 2)
    if at_end <= 0.0:
        return None
    way = 1.0 if forward else -1.0
    if level > 0.0:
        side = math.copysign(1.0, angle)
        since = math.copysign(_time_from_rest(level, risen), side * speed)
        until = math.copysign(_time_from_rest(level, at_end), side * way)
    else:
        side = way
        since, until = (_time_from_top(level, side * at) for at in (angle, end))
    centre = now - since / rate
    return _Fall(edge, level, centre, side, centre + until / rate, _Pose(edge, end, way * 2.0 * rate * math.sqrt(at_end)))


def _after(stand: Stand, landing: _Pose) -> tuple[_Pose, bool]:
    """The pose just after a landing, and whether the centre of mass is above the face, so that the body may rest on it."""
    step = 1 if landing.speed > 0.0 else -1
    new = landing.edge + step
    angle = _ends(stand, new)[0 if step > 0 else 1]
    return _Pose(new, angle, max(_ratio(stand, landing.edge, new), 0.0) * landing.speed), step * angle < 0.0 < step * landing.angle


def _would_lift_off(stand: Stand, pose: _Pose, fall: _Fall) -> bool:
    """Whether the normal force would be negative at some angle of a motion."""
    angles = [pose.angle, fall.landing.angle]
    if fall.level > 0.0 and fall.landing.speed * pose.speed <= 0.0:
        angles.append(fall.side * 2.0 * math.asin(math.sqrt(fall.level)))
    k, slope, c = stand.shares[fall.edge % len(stand.shares)], stand.slope, 2.0 * (1.0 - 2.0 * fall.level)
    first, last = min(angles) - slope, max(angles) - slope
    turn = complex(math.cos(slope), math.sin(slope))
    stationary = np.angle(np.roots([-3.0 * turn, c, 0.0, -c, 3.0 * turn.conjugate()]))  # in exp(iθ)
    theta = np.append(np.clip(stationary, first, last), [first, last])
    force = (k + 1.5) * math.cos(slope) + 1.5 * np.cos(2.0 * theta + slope) - c * np.cos(theta)
    return bool(force.min() < 0.0)


def _time_from_rest(level: float, fallen: float) -> float:
    """Time from rest at sin²(ψ/2) = level to sin²(ψ/2) = level + fallen, in units of 1/p."""
    now = level + fallen
    sn = math.sqrt(fallen / (now * (1.0 - level)))
    cn = math.sqrt(level * (1.0 - now) / (now * (1.0 - level)))
    return argument(sn, cn, level)


def _time_from_top(level: float, angle: float) -> float:
    """Time from the top to an angle ψ [rad], in units of 1/p, for a level below 0."""
    m, tangent = level / (level - 1.0), math.tan(0.5 * angle)
    length = math.sqrt(m + tangent**2)
    return argument(tangent / length, math.sqrt(m) / length, m) / math.sqrt(1.0 - level)


def _pendulum(rate: Array, since: Array, level: Array) -> tuple[Array, Array]:
    """Sin(ψ/2) and ψ' [rad/s] on the positive side, at times since T [s], shape (n,), for the rate and the level of each, shape (n,)."""
    rests = level > 0.0
    part = np.sqrt(np.abs(level))
    m = np.where(rests, level, level / (level - 1.0))
    sn, _, dn = jacobi(rate * since * np.where(rests, 1.0, np.sqrt(1.0 - level)), m)
    over = rests * sn * np.sqrt(1.0 - m) + ~rests  # √(1-s) sn, or 1
    return np.where(rests, part, np.sqrt(m) * sn) / dn, 2.0 * rate * part * over / dn


def _states(scene: Scenario, stand: Stand, edge: NDArray[np.intp], angle: Array, speed: Array) -> Array:
    """States, shape (n, 13), about the edges of these numbers, at angles ψ [rad] and angular velocities ψ' [rad/s], shapes (n,)."""
    count = len(stand.radii)
    turns, at = np.divmod(edge, count)
    pivot = stand.pivot + (stand.ways[at] + turns * stand.ways[-1])[:, None] * stand.outward
    theta = (angle - stand.slope)[:, None]
    to_centre = stand.radii[at, None] * (np.sin(theta) * stand.outward + np.cos(theta) * UP)
    turned = stand.turns[at] + 2.0 * math.pi * turns - (stand.ahead[at] - theta[:, 0])
    spin = speed[:, None] * stand.falling
    orientation = multiply(about(stand.falling, turned), scene.initial_state[ORIENTATION])
    return np.hstack([pivot + to_centre, orientation, np.cross(spin, to_centre), spin])


def _impacts(scene: Scenario, stand: Stand, ladder: _Ladder) -> tuple[Impact, ...]:
    """The landings within the scene's duration."""
    falls = [fall for fall in ladder.falls if fall.lands <= scene.duration]
    poses = zip(*(fall.landing for fall in falls), strict=True), zip(*ladder.poses[1 : len(falls) + 1], strict=True)
    before, after = (_states(scene, stand, *map(np.array, columns)) for columns in poses)
    return impacts_of(np.array([fall.lands for fall in falls]), before, after)
