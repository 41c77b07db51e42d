"""`contact=mean`: Algorithm 2. One impulse at the mean of the vertices that collide (section 3.2).

Cost: one detection and one impulse a step. Exact for a single vertex, and for a flat fall. Where several vertices touch at
once it leaves some of them approaching; the limit of small steps is then another than Housner's (1963) for a rocking block.
"""

from reference_impl.quaternion import rotation_matrix
from reference_impl.vectors import Mat3, Vec3, compiled, cross, dot, row, transpose

N = Vec3(0.0, 1.0, 0.0)
"""The floor's normal, upwards."""


@compiled
def collide(x, q, v, w, body, floor, law):
    """Algorithm 2: the velocities (v, ω) after the floor has acted, and that this took no iteration."""
    if x.y >= body.reach:  # no vertex can be below the floor
        return v, w, True
    R = rotation_matrix(q)
    r, count = contact_point(R, v, w, x.y, body)
    if count == 0:
        return v, w, True
    v, w = apply_impulse(r, R, v, w, body, floor, law)
    return v, w, True


@compiled
def contact_point(R, v, w, height, body):
    """Eq 10 and section 3.2: the mean offset r of the vertices below the floor and still descending, and their number."""
    total = Vec3(0.0, 0.0, 0.0)
    count = 0
    for i in range(body.points.shape[0]):
        r = vertex(R, body, i)
        if height + dot(r, N) < 0.0 and dot(v + cross(w, r), N) < 0.0:
            total = total + r
            count += 1
    return (total / count if count > 0 else total), count


@compiled
def vertex(R, body, i):
    """Offset from the centre to vertex i; a rounded one touches at its lowest point (a departure, for balls)."""
    return R @ row(body.points, i) - body.radius * N


@compiled
def apply_impulse(r, R, v, w, body, floor, law):
    """Eq 7, 12 and 15: the velocities (v, ω) after one impulse j at the offset r from the centre of mass."""
    v_contact = v + cross(w, r)
    mu = 0.0 if abs(dot(v_contact, N)) < floor.rest_speed else floor.restitution
    I_inverse = R @ body.inverse_inertia @ transpose(R)  # eq 7
    j = law(impulse_response(r, I_inverse, body.mass), v_contact, mu, floor.friction)
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
