"""A body that keeps one contact point on the floor: it rolls or spins without slip, or slides without friction.

In the body frame, n is upwards, S has the semi-axes of the ellipsoid, disc or ball about the lowest vertex c, of a corner 0, r is the
vector from the centre of mass to the contact point, r' its rate of change in the world, and g gravity:

    r  = c - S² n/|S n|,   n' = n × ω,   r' = ω × r - (S² n' - S² n (S n · S n')/|S n|²)/|S n|
    I ω' = -ω × I ω + r × F,   F = M (dv/dt - g)
    rough:   v = -ω × r                         (no slip; F has any direction)
    smooth:  v·n = -(ω × r)·n,  F = N n         (no friction; the rest of dv/dt is that of g)

With D = 1 on a rough floor and D = n on a smooth one, and X = [r ×] D, both are

    (I + M X Xᵀ) ω' = -ω × I ω - M X Dᵀ (g + ω × r')

They are integrated numerically. Small oscillations of a body at rest, with principal axes along those of its surface, have the frequencies
√(M g (ρ - h)/(I + M h²)) on a rough floor and √(M g (ρ - h)/I) on a smooth one, h the height of the centre of mass, ρ the radius of
curvature at the contact. A cylinder that rolls on its rim at a constant angle θ from its axis to the vertical, with d the height of its
centre of mass above the face within and R its radius, has for its precession Ω and its spin ω_n = ω·n about its axis, of moment C, with A
across it,

    Ω sin θ (C ω_n - A Ω cos θ) = M (R sin θ + d cos θ) Ω (Ω d sin θ - ω_n R) - M g (R cos θ - d sin θ)

and with its centre at rest, Ω d sin θ = ω_n R, Euler's disc: for a thin one Ω² = M g R/(A sin θ).

Source: J. L. Lagrange, Mécanique analytique (1788), for the top; E. J. Routh, Advanced Part of Dynamics of a System of Rigid Bodies
(1905), art. 244, and K. T. McDonald, physics/0008227v1 (2000), sections 2.2 to 2.5, for the disc without thickness, whose balance of
moments has r with the thickness here; A. V. Borisov & I. S. Mamaev, Regul. Chaotic Dyn. 7 (2002), 177-200, section 1, for the equations of
any body; E. Hairer, S. P. Nørsett & G. Wanner, Solving Ordinary Differential Equations I (1993), section II.5, for DOP853.
Valid for: an ellipsoid, a ball with any centre of mass, the end of a capsule, the rim of a cylinder, or a corner, such as the tip of a
top, that touches the floor at the start and does not slip there, or on a frictionless floor; also a capsule or cylinder on its side that
rolls about its axis; gravity into the floor, no damping. It ends where the friction coefficient is exceeded, the floor would have to pull,
another part of the body touches the floor, or an initial disturbance has grown too much: an unstable motion is known for a while only.
Restitution has no effect, because no contact separates.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dropspin.scenarios.bodies import OnAxis
from dropspin.scenarios.model import TOUCHING, Scenario
from dropspin.scenarios.rotations import cross, crossing, dot, length, multiply, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, UP, VELOCITY, Array
from dropspin.scenarios.surfaces import Floor
from dropspin.scenarios.truths.truth import Truth

AT_REST = 1e-12
"""Speed of the contact point that counts as rest, relative to that of the body."""
ACROSS = 1e-12
"""Largest component of a direction perpendicular to the intended one, relative to its length, that is attributed to rounding."""
TINY = 1e-300
FLATTEST = 1e-3
"""Sine of the angle between the face within a rim and the floor at which the face counts as touching it."""
RTOL, ATOL = 3e-14, 1e-15
"""Tolerances of the integrator, close to the least that double precision allows; the motion is then exact to about 1e-12."""
SAMPLES_PER_STEP = 8
"""Times in a step of the integrator at which the contact is verified."""
DISTURBANCE = 1e-10 * np.array([0.48, -0.6, 0.64])  # rad/s, of the start
MAX_GROWTH = 1e4
"""Growth of the disturbance beyond which an engine's error cannot be distinguished from the growth of rounding."""
GROWS = "the motion amplifies small differences too much"
SMALL = 1e-5
"""Of differences for derivatives, relative to a radian or to the spin, and of a growth in a radian that is rounding."""
SHARES = 1.0 / 64.0, 1.0 / 8.0, 1.0
"""Of the duration, in which a motion is solved until it ends."""
COARSER = 300.0
"""Factor on the tolerances for the disturbed motion."""


def point_contact(scene: Scenario, floor: Floor) -> Truth | None:
    """The exact solution of a body on one contact point; None for other scenes."""
    start = scene.initial_state
    if scene.acceleration[1] >= 0.0 or not scene.starts_on_floor:
        return None
    contact = _contact(scene, is_rough=floor.friction != "none")
    if contact is None:
        return None
    arm, spin = contact.arm(unrotate(start[ORIENTATION], UP)), unrotate(start[ORIENTATION], start[SPIN])
    slip = start[VELOCITY] + rotate(start[ORIENTATION], cross(spin, arm))
    fastest = max(float(length(start[VELOCITY])), float(length(spin)) * scene.body.size)
    if length(slip if contact.is_rough else slip * UP) > AT_REST * fastest:
        return None
    for share in SHARES:  # an unstable motion ends early
        part = scene.model_copy(update={"duration": share * scene.duration})
        truth = _solved(part, contact, floor.coefficient)
        if truth.ends:
            break
    return truth if truth.horizon > 0.0 else None


def growth_of_a_spin(scene: Scenario) -> float:
    """The rate at which disturbances of a body grow that spins about the vertical on one point of a smooth floor [1/s]; 0 if none does.

    In the body frame, the equations of a turn ε of the body and of its change of ω have constant coefficients: ε' = δω - ω × ε.
    """
    start = scene.initial_state
    orientation, spin = start[ORIENTATION], unrotate(start[ORIENTATION], start[SPIN])
    contact = _contact(scene, is_rough=False)
    if contact is None:
        return 0.0
    speed = float(length(spin))

    def rates(step: Array) -> Array:
        turns, faster = np.append(0.5 * step[:3], 1.0), spin + speed * step[3:]
        return contact.forces(multiply(orientation, turns / length(turns)), faster)[0] / speed

    columns = [(rates(step) - rates(-step)) / (2.0 * SMALL) for step in SMALL * np.eye(6)]
    matrix = np.vstack([np.hstack([-crossing(spin), speed * np.eye(3)]), np.column_stack(columns)])
    growth = float(np.linalg.eigvals(matrix).real.max())
    return growth if growth > SMALL * speed else 0.0


@dataclass(frozen=True, eq=False)
class _Contact:
    """A body on its lowest vertex.

    Attributes:
        is_rough: Whether it rolls without slip, or slides without friction.
        mass: M [kg].
        inertia: I [kg m²], shape (3, 3).
        vertex: c [m], shape (3,).
        squares: Squares of the semi-axes about it [m²], shape (3,).
        others: The vertices that must not touch the floor, relative to c [m], shape (m, 3).
        axes: The axes about which the body can turn, as columns, shape (3, k).
        gravity: In the world [m/s²], shape (3,).
    """

    is_rough: bool
    mass: float
    inertia: Array
    vertex: Array
    squares: Array
    others: Array
    axes: Array
    gravity: Array

    def arm(self, up: Array) -> Array:
        """The vector r to the contact point [m], shape (..., 3), where `up` is n."""
        stretched = self.squares * up
        return self.vertex - stretched / np.maximum(np.sqrt(dot(stretched, up)), TINY)[..., None]

    def forces(self, orientation: Array, spin: Array) -> tuple[Array, Array, Array]:
        """For one state, ω' in the body frame [rad/s²], and in the world the force over the mass [m/s²] and the way of the contact [m/s].

        The last is the velocity at which the contact point moves along the floor if it does not slip.

        Args:
            orientation: Shape (4,).
            spin: In the body frame [rad/s], shape (3,).
        """
        turn = crossing(orientation[:3])
        to_body = np.eye(3) - 2.0 * float(orientation[3]) * turn + 2.0 * turn @ turn
        up, turns = to_body[:, 1], crossing(spin)
        stretched, turning = self.squares * up, -turns @ up
        depth = float(np.sqrt(stretched @ up)) or 1.0  # of a corner, 0
        arm = self.vertex - stretched / depth
        moved = (self.squares * turning - stretched * (stretched @ turning) / depth**2) / depth
        drawn = to_body @ self.gravity + turns @ (turns @ arm - moved)
        lever = crossing(arm)
        levers = lever if self.is_rough else np.outer(lever @ up, up)
        torque = -turns @ (self.inertia @ spin) - self.mass * levers @ drawn
        response = self.inertia + self.mass * levers @ levers.T
        rate = self.axes @ np.linalg.solve(self.axes.T @ response @ self.axes, self.axes.T @ torque)
        force = lever @ rate - drawn
        return rate, (force if self.is_rough else up * (up @ force)) @ to_body, -moved @ to_body

    def gap(self, up: Array) -> float:
        """Height of the other vertices above the contact, or of the centre of a rim above it beyond a flat one [m]."""
        lowest = float(np.min(self.others @ up, initial=np.inf))
        if self.squares[1] > 0.0 or not self.squares.any():
            return lowest
        return min(lowest, float(length(np.sqrt(self.squares) * up) - FLATTEST * np.sqrt(self.squares[0])))


def _contact(scene: Scenario, *, is_rough: bool) -> _Contact | None:
    """The contact of a scene's body; None if more than one point touches the floor, and the body does not roll on its side."""
    body, start, g = scene.body, scene.initial_state, scene.acceleration
    heights, axes, squares = rotate(start[ORIENTATION], body.vertices)[:, 1], np.eye(3), body.semi_axes**2
    lowest = heights <= heights.min() + TOUCHING * body.size
    vertex, others = body.vertices[lowest][0], body.vertices[~lowest]
    if lowest.sum() > 1:
        if not isinstance(body, OnAxis):
            return None
        axis, ends = rotate(start[ORIENTATION], UP), body.vertices[:, 1]
        keeps = (
            ends.min() < -TOUCHING * body.size
            and ends.max() > TOUCHING * body.size
            and np.abs(body.inertia_tensor[1, [0, 2]]).max() <= ACROSS * body.inertia_tensor[1, 1]
            and length(cross(start[SPIN], axis)) <= ACROSS * length(start[SPIN])
            and all(abs(along @ axis) <= ACROSS * length(along) for along in (start[VELOCITY], g))
        )
        if not keeps:
            return None
        axes, squares = axes[:, 1:2], np.full(3, body.radius**2)
    contact = _Contact(is_rough, body.mass, body.inertia_tensor, vertex, squares, others - vertex, axes, g)
    return contact if contact.gap(unrotate(start[ORIENTATION], UP)) > 0.0 else None


def _integrated(scene: Scenario, contact: _Contact, disturbance: Array, coarser: float) -> tuple[Array, Callable[[Array], Array], bool]:
    """The steps of the integrator [s], the solution of these times, and whether it ends where another part touches the floor.

    A row of the solution is the orientation, the spin in the body frame, and the position without the height: of the contact point, or of
    the centre of mass if there is no friction.
    """
    from scipy.integrate import solve_ivp

    start = scene.initial_state
    arm = rotate(start[ORIENTATION], contact.arm(unrotate(start[ORIENTATION], UP)))
    at = start[POSITION] + arm if contact.is_rough else start[POSITION]
    spin = unrotate(start[ORIENTATION], start[SPIN]) + contact.axes @ (contact.axes.T @ disturbance)

    def rates(t: float, y: Array) -> Array:
        (x, y_, z, w), (a, b, c) = y[:4].tolist(), y[4:7].tolist()
        rate, _, way = contact.forces(y[:4], y[4:7])
        velocity = way if contact.is_rough else start[VELOCITY] + t * scene.acceleration
        turning = [w * a + y_ * c - z * b, w * b + z * a - x * c, w * c + x * b - y_ * a, -(x * a + y_ * b + z * c)]
        return np.concatenate([0.5 * np.array(turning), rate, velocity[[0, 2]]])

    def touches(t: float, y: Array) -> float:
        return contact.gap(unrotate(y[:4], UP))

    touches.terminal = True  # type: ignore[attr-defined]
    solved = solve_ivp(
        rates,
        (0.0, scene.duration * (1.0 + 1e-9)),
        np.concatenate([start[ORIENTATION], spin, at[[0, 2]]]),
        method="DOP853",
        rtol=coarser * RTOL,
        atol=coarser * ATOL,
        dense_output=True,
        events=touches,
    )
    return solved.t, lambda t: solved.sol(t).T, solved.status != 0


def _solved(scene: Scenario, contact: _Contact, friction: float) -> Truth:
    steps, solution, touches = _integrated(scene, contact, np.zeros(3), 1.0)
    others, disturbed, touches_too = _integrated(scene, contact, DISTURBANCE, COARSER)

    def states(t: Array) -> Array:
        y = solution(t)
        q = y[:, :4] / length(y[:, :4])[:, None]
        up = unrotate(q, np.broadcast_to(UP, (len(t), 3)))
        arm, spin = rotate(q, contact.arm(up)), rotate(q, y[:, 4:7])
        position, moving = -arm, cross(arm, spin)
        if contact.is_rough:
            position[:, [0, 2]] += y[:, 7:]
        else:
            position[:, [0, 2]] = y[:, 7:]
            moving[:, [0, 2]] = (scene.initial_state[VELOCITY] + t[:, None] * scene.acceleration)[:, [0, 2]]
        return np.hstack([position, q, moving, spin])

    between = np.linspace(0.0, 1.0, SAMPLES_PER_STEP, endpoint=False)
    times = np.append((steps[:-1, None] + between * np.diff(steps)[:, None]).ravel(), steps[-1])
    times = times[times <= others[-1]]
    y = solution(times)
    force = np.array([contact.forces(row[:4], row[4:7])[1] for row in y])
    along = np.hypot(force[:, 0], force[:, 2])
    causes = {
        "the floor would have to pull": force[:, 1] <= 0.0,
        "the contact point slips": along > (friction if contact.is_rough else np.inf) * force[:, 1],
        GROWS: np.abs(disturbed(times)[:, 4:7] - y[:, 4:7]).max(axis=1) > MAX_GROWTH * 1e-10,
    }
    firsts = {cause: int(np.argmax(ends)) for cause, ends in causes.items() if ends.any()}
    horizon, ends = float(times[-1]), "another part of the body touches the floor" if touches or touches_too else ""
    if firsts:
        ends = min(firsts, key=firsts.__getitem__)
        horizon = float(times[max(firsts[ends] - 1, 0)])
    manner = "rolls without slip" if contact.is_rough else "slides without friction"
    statement = f"the equations of a body that {manner} on one contact point, integrated numerically (Runge–Kutta method DOP853)"
    name = "rough-contact" if contact.is_rough else "smooth-contact"
    return Truth(name, statement, states, horizon=min(horizon, scene.duration), ends=ends if horizon < scene.duration else "")
