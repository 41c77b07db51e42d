"""Contact with the floor y = 0: Algorithm 2 and the equations of the note's section 3."""

from typing import NamedTuple

from reference_impl.quaternion import rotation_matrix
from reference_impl.vectors import Mat3, Vec3, compiled, cross, dot, row, solve, transpose

N = Vec3(0.0, 1.0, 0.0)
"""The floor's normal, upwards."""


class Floor(NamedTuple):
    """What the floor does to a vertex that hits it."""

    restitution: float
    """The note's µ, the field's e: separation speed over approach speed."""
    sticking: bool
    """True: infinite friction (eq 17). False: the note's frictionless response (eq 15)."""
    rest_speed: float
    """Normal speed [m/s] below which restitution counts as 0 (section 3.2); 0 switches the rule off."""


@compiled
def handle_collision(q, v, w, height, body, floor):
    """Algorithm 2: the velocities (v, ω) after the floor has acted on a body whose centre is at `height`."""
    if height >= body.reach:  # no vertex can be below the floor
        return v, w
    R = rotation_matrix(q)
    r, count = contact_point(R, v, w, height, body)
    if count == 0:
        return v, w
    return apply_impulse(r, R, v, w, body, floor)


@compiled
def contact_point(R, v, w, height, body):
    """Eq 10 and section 3.2: the mean offset r of the vertices below the floor and still descending, and their number."""
    total = Vec3(0.0, 0.0, 0.0)
    count = 0
    for i in range(body.points.shape[0]):
        p = row(body.points, i)
        # A rounded vertex touches at its lowest point. That is a departure from the note, for balls; radius is 0 otherwise.
        r = R @ p - body.radius * N
        if height + dot(r, N) < 0.0 and dot(v + cross(w, r), N) < 0.0:
            total = total + r
            count += 1
    return (total / count if count > 0 else total), count


@compiled
def apply_impulse(r, R, v, w, body, floor):
    """Eq 11 to 17: the velocities (v, ω) after one impulse j at the offset r from the centre of mass."""
    v_contact = v + cross(w, r)
    v_normal = dot(v_contact, N)
    mu = 0.0 if abs(v_normal) < floor.rest_speed else floor.restitution
    if floor.sticking:
        change = -v_contact - mu * v_normal * N  # eq 17
    else:
        change = -(1.0 + mu) * v_normal * N  # eq 11
    I_inverse = R @ body.inverse_inertia @ transpose(R)  # eq 7
    j = solve(impulse_response(r, I_inverse, body.mass), change)
    return v + j / body.mass, w + I_inverse @ cross(r, j)  # eq 12


@compiled
def impulse_response(r, I_inverse, mass):
    """Eq 15: K = 1/M − r* I⁻¹ r*, the velocity that a unit impulse gives to the point it acts on."""
    r_star = cross_matrix(r)
    m = 1.0 / mass
    return Mat3(Vec3(m, 0.0, 0.0), Vec3(0.0, m, 0.0), Vec3(0.0, 0.0, m)) - r_star @ I_inverse @ r_star


@compiled
def cross_matrix(r):
    """Eq 14: the matrix r* for which r* j = r × j."""
    return Mat3(Vec3(0.0, -r.z, r.y), Vec3(r.z, 0.0, -r.x), Vec3(-r.y, r.x, 0.0))
