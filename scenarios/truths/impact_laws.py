"""What one impulse at one point of a body does, by each of the laws that are in use.

With u = v + ω × r the velocity of the point, K = 1/M - r* I⁻¹ r* (the note's eq 15), e the restitution and f the friction:

    note       K j = -(1 + e) u_n N, or, where the floor grips, K j = -u - e u_n N                     eq 15, eq 17
    normal     j = -(1 + e) u_n / (N·K N) N                                                        without friction
    poisson    as normal; where the floor grips K j = s N - u,  s = e max(-N·K⁻¹u, 0) / (N·K⁻¹N)
    clamped    as normal; where the floor grips eq 17 with the largest restitution up to e that adds no energy
    coulomb    eq 17 while it stays within the cone of f, else j = j_n (N - f t), t along u's tangential part

An edge or a face that strikes with one velocity is one point at its middle.

Source: H. Wang, Rigid Body Dynamics, eq 15 and 17; E. T. Whittaker, Analytical Dynamics, section 95; S. D. Poisson, Traité de mécanique
(1833); A. Chatterjee & A. Ruina, J. Applied Mechanics 65 (1998); C. A. de Coulomb (1785), E. J. Routh, Elementary Rigid Dynamics (1905).
Valid for: a point that approaches. `coulomb` for one that slides the same way throughout the impact: a ball of equal moments does.
"""

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from scenarios.model import Floor
from scenarios.rotations import rotate

Array = NDArray[np.float64]
Law = Literal["note", "normal", "poisson", "clamped", "coulomb"]
LAWS: tuple[Law, ...] = get_args(Law)

UP = np.array([0.0, 1.0, 0.0])


def law_of(floor: Floor) -> Law:
    """The law that is the truth on a floor: none but the normal impulse without friction, eq 17 where it grips, else Coulomb's."""
    return {"none": "normal", "infinite": "note"}.get(str(floor.friction), "coulomb")  # type: ignore[return-value]


def velocities_after(state: Array, point: Array, mass: float, inertia: Array, floor: Floor, law: Law) -> Array:
    """Velocity and angular velocity, shape (6,), after the impact of one point, offset `point` from the centre in the world frame [m]."""
    q, v, w = state[3:7], state[7:10], state[10:13]
    axes = rotate(q, np.eye(3))  # rows: the body's axes in the world
    inverse = axes.T @ np.linalg.inv(inertia) @ axes
    arm = np.cross(np.eye(3), point)  # as a matrix: arm @ j = point × j
    response = np.eye(3) / mass - arm @ inverse @ arm
    approach = v + np.cross(w, point)
    e = 0.0 if abs(approach[1]) < floor.rest_speed else floor.restitution
    impulse = _impulse(law, response, approach, e, floor.friction)
    return np.concatenate([v + impulse / mass, w + inverse @ np.cross(point, impulse)])


def _impulse(law: Law, response: Array, u: Array, e: float, friction: str | float) -> Array:
    if friction == "none" and law == "note":
        return np.linalg.solve(response, -(1.0 + e) * u[1] * UP)
    if friction == "none" or law == "normal":
        return -(1.0 + e) * u[1] / response[1, 1] * UP
    if law == "note":
        return np.linalg.solve(response, -u - e * u[1] * UP)
    if law == "coulomb":
        return _coulomb(response, u, e, np.inf if friction == "infinite" else float(friction))
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
