"""`contact=mean`: Algorithm 2. One impulse at the mean of the vertices that collide (section 3.2).

Cost: one detection and one impulse a step. Exact for a single vertex, and for a flat fall. Where several vertices touch at
once it leaves some of them approaching; the limit of small steps is then another than Housner's (1963) for a rocking block.
"""

from reference_impl.quaternion import rotation_matrix
from reference_impl.vectors import Mat3, Vec3, any_, compiled, cross, row, select, transpose

N = Vec3(0.0, 1.0, 0.0)
"""The floor's normal, upwards."""


@compiled
def collide(x, q, v, w, body, floor, law):
    """Algorithm 2: the velocities (v, ω) after the floor has acted, and that this took no iteration."""
    R = rotation_matrix(q)
    r, hit = contact_point(R, v, w, x.y, body)
    if any_(hit):
        v_after, w_after = apply_impulse(r, R, v, w, body, floor, law)
        v, w = select(hit, v_after, v), select(hit, w_after, w)
    return v, w, True


@compiled
def contact_point(R, v, w, height, body):
    """Eq 10 and section 3.2: the mean offset r of the vertices below the floor and still descending, if there are any."""
    total = Vec3(0.0, 0.0, 0.0)
    count = 0.0
    for i in range(body.points.shape[0]):
        below = height + along_normal(vertex(R, body, i)) < 0.0
        if any_(below):
            r = vertex(R, body, i)
            descends = along_normal(v + cross(w, r)) < 0.0
            total = select(below & descends, total + r, total)
            count = select(below & descends, count + 1.0, count)
    return total / select(count > 0.0, count, 1.0), count > 0.0


@compiled
def along_normal(a):
    """The component along N, a · N. Written out, because compiled code may not drop the products with N's zeros."""
    return a.y


@compiled
def vertex(R, body, i):
    """Offset from the centre to vertex i; a rounded one touches at its lowest point (a departure, for balls)."""
    r = R @ row(body.points, i)
    return Vec3(r.x, r.y - body.radius, r.z)


@compiled
def apply_impulse(r, R, v, w, body, floor, law):
    """Eq 7, 12 and 15: the velocities (v, ω) after one impulse j at the offset r from the centre of mass."""
    v_contact = v + cross(w, r)
    mu = select(abs(along_normal(v_contact)) < floor.rest_speed, 0.0, floor.restitution)
    I_inverse = R @ body.inverse_inertia @ transpose(R)  # eq 7
    j = law(impulse_response(r, I_inverse, body.mass), v_contact, mu, floor.friction)
    return v + (1.0 / body.mass) * j, w + I_inverse @ cross(r, j)  # eq 12


@compiled
def impulse_response(r, I_inverse, mass):
    """Eq 15: K = 1/M − r* I⁻¹ r*, the velocity that a unit impulse gives to the point it acts on.

    The products with r* are taken row by row as cross products, a* r* = a × r: the zeros of eq 14 would cost a third of the step.
    """
    turned = transpose(Mat3(cross(r, I_inverse.row1), cross(r, I_inverse.row2), cross(r, I_inverse.row3)))  # r* I⁻¹
    m = 1.0 / mass
    return Mat3(
        Vec3(m, 0.0, 0.0) - cross(turned.row1, r),
        Vec3(0.0, m, 0.0) - cross(turned.row2, r),
        Vec3(0.0, 0.0, m) - cross(turned.row3, r),
    )


@compiled
def cross_matrix(r):
    """Eq 14: the matrix r* for which r* j = r × j."""
    return Mat3(Vec3(0.0, -r.z, r.y), Vec3(r.z, 0.0, -r.x), Vec3(-r.y, r.x, 0.0))
