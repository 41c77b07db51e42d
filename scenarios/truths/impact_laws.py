"""The velocities of a body after one impulse at one of its points, for each impact law.

With u = v + ω × r the velocity of the point, K = 1/M - r* I⁻¹ r* (eq 15 of Wang's lecture note), e the restitution and f the friction:

    note       K j = -(1 + e) u_n N without friction (eq 15), K j = -u - e u_n N with infinite friction (eq 17)
    normal     j = -(1 + e) u_n / (N·K N) N for any friction
    poisson    normal without friction; with infinite friction K j = s N - u,  s = e max(-N·K⁻¹u, 0) / (N·K⁻¹N)
    clamped    normal without friction; with infinite friction eq 17 with the largest restitution up to e that adds no energy
    coulomb    eq 17 while it stays within the cone of f, else j = j_n (N - f t), t along u's tangential part
    cone, integrated-newton, integrated-poisson, integrated-energy    `friction_impact`

An edge or a face whose points have equal velocities acts as one point at its middle.

Source: H. Wang, Rigid Body Dynamics, eq 15 and 17; E. T. Whittaker, Analytical Dynamics, section 95; S. D. Poisson, Traité de mécanique
(1833); A. Chatterjee & A. Ruina, J. Applied Mechanics 65 (1998); C. A. de Coulomb (1785), E. J. Routh, Elementary Rigid Dynamics (1905).
Valid for: a point that approaches. `coulomb`: a point whose direction of sliding does not change during the impact, as on a ball of equal
moments.
"""

from typing import Literal, get_args

import numpy as np

from dropspin.scenarios.model import Scenario
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.state import ORIENTATION, SPIN, UP, VELOCITY, Array
from dropspin.scenarios.surfaces import FrictionLaw, Surface
from dropspin.scenarios.truths.friction_impact import cone_impulse, integrated_impulse

Law = Literal["note", "normal", "poisson", "clamped", "coulomb", FrictionLaw]
LAWS: tuple[Law, ...] = get_args(Law)
FRICTION_LAWS: tuple[Law, ...] = get_args(FrictionLaw)


def law_of(scene: Scenario, surface: Surface | None = None) -> Law:
    """The impact law of the exact solution: the normal impulse without friction, eq 17 with infinite friction, else that of the surface.

    The surface is by default the floor. All laws with a coefficient of friction are Coulomb's for a ball of equal moments, whose slip does
    not turn in an impact.
    """
    surface = surface or scene.floor
    assert surface is not None
    if isinstance(surface.friction, str):
        return "normal" if surface.friction == "none" else "note"
    is_round = scene.body.is_ball and float(np.ptp(np.linalg.eigvalsh(scene.body.inertia_tensor))) == 0.0
    return "coulomb" if is_round else surface.impact_law


def velocities_after(state: Array, point: Array, mass: float, inertia: Array, surface: Surface, law: Law) -> Array | None:
    """Velocity and angular velocity, shape (6,), after the impact of one point, offset `point` from the centre in the world frame [m].

    If the state is in the frame of a wall, so is the result. None if the law has no solution, or several.
    """
    q, v, w = state[ORIENTATION], state[VELOCITY], state[SPIN]
    axes = rotate(q, np.eye(3))  # rows: the body's axes in the world
    inverse = axes.T @ np.linalg.inv(inertia) @ axes
    response = response_of(point, mass, inverse)
    approach = v + np.cross(w, point)
    e = 0.0 if abs(approach[1]) < surface.rest_speed else surface.restitution
    impulse = _impulse(law, response, approach, e, surface.friction)
    return None if impulse is None else np.concatenate([v + impulse / mass, w + inverse @ np.cross(point, impulse)])


def response_of(point: Array, mass: float, inverse: Array) -> Array:
    """K of eq 15, the change of a point's velocity by an impulse there [1/kg], shape (3, 3).

    Args:
        point: The point, from the centre of mass [m], shape (3,).
        mass: Mass [kg].
        inverse: The inverse inertia in the world frame [1/(kg m²)], shape (3, 3).
    """
    arm = np.cross(np.eye(3), point)  # as a matrix: arm @ j = point × j
    return np.eye(3) / mass - arm @ inverse @ arm


def _impulse(law: Law, response: Array, u: Array, e: float, friction: str | float) -> Array | None:
    if friction == "none" and law == "note":
        return np.linalg.solve(response, -(1.0 + e) * u[1] * UP)
    if friction == "none" or law == "normal":
        return -(1.0 + e) * u[1] / response[1, 1] * UP
    if law == "note" or (friction == "infinite" and law not in ("poisson", "clamped")):
        return np.linalg.solve(response, -u - e * u[1] * UP)
    if law == "coulomb":
        return _coulomb(response, u, e, float(friction))
    if law == "cone":
        return cone_impulse(response, u, e, float(friction))
    if law in FRICTION_LAWS:
        return integrated_impulse(response, u, e, float(friction), law.removeprefix("integrated-"))
    stiffness = np.linalg.inv(response)
    if law == "poisson":
        leaving = e * max(-float(stiffness[1] @ u), 0.0) / stiffness[1, 1]
    else:
        leaving = min(-e * float(u[1]), float(np.sqrt(u @ stiffness @ u / stiffness[1, 1])))
    return stiffness @ (leaving * UP - u)


def _coulomb(response: Array, u: Array, e: float, friction: float) -> Array:
    sticks = np.linalg.solve(response, -u - e * u[1] * UP)
    if np.hypot(sticks[0], sticks[2]) <= friction * sticks[1]:
        return sticks
    along = np.array([u[0], 0.0, u[2]])
    direction = UP - friction * along / np.linalg.norm(along)
    return -(1.0 + e) * u[1] / (response[1] @ direction) * direction
