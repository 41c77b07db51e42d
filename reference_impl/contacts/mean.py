"""`contact=mean`: Algorithm 2. One impulse at the mean of the colliding vertices (section 3.2).

Order: none claimed (see the package's docstring).
Valid for: a single vertex, and a flat fall; it is exact there. If several vertices touch at once, some of them still approach the floor
after the impulse; as dt → 0, the motion of a rocking block then does not converge to that of Housner (1963).
Cost: one detection and one impulse per step.
Source: H. Wang, Rigid Body Dynamics, Algorithm 2, eq 10, 12 and section 3.2.
"""

from dropspin.reference_impl.contacts.response import impulse_response
from dropspin.reference_impl.floor_plane import along_normal, block_count, block_range, contact_offset, is_below
from dropspin.reference_impl.quaternion import rotation_matrix
from dropspin.reference_impl.vectors import Vec3, compiled, cross, transpose

ORDER = None


@compiled
def collide(x, q, v, w, body, floor, law):
    """Algorithm 2: the velocities (v, ω) after the floor has acted, and True, because no iteration can fail."""
    R = rotation_matrix(q)
    r, hit = contact_point(R, x, v, w, body, floor)
    if hit:
        v, w = apply_impulse(r, R, v, w, body, floor, law)
    return v, w, True


@compiled
def contact_point(R, x, v, w, body, floor):
    """Eq 10 and section 3.2: the mean offset r of the vertices that are below the floor and descending, and whether there are any."""
    total = Vec3(0.0, 0.0, 0.0)
    count = 0.0
    for block in range(block_count(body.many_points)):
        for i in range(*block_range(x, R, body, body.many_points, block)):
            r = contact_offset(R, body, i)
            if is_below(x, r, floor) and along_normal(v + cross(w, r)) < 0.0:
                total = total + r
                count += 1.0
    return total / max(count, 1.0), count > 0.0


@compiled
def apply_impulse(r, R, v, w, body, floor, law):
    """Eq 7, 12 and 15: the velocities (v, ω) after one impulse j at the offset r from the centre of mass."""
    v_contact = v + cross(w, r)
    mu = 0.0 if abs(along_normal(v_contact)) < floor.rest_speed else floor.restitution
    I_inverse = R @ body.inverse_inertia @ transpose(R)  # eq 7
    j = law(impulse_response(r, I_inverse, body.mass), v_contact, mu, floor.friction)
    return v + (1.0 / body.mass) * j, w + I_inverse @ cross(r, j)  # eq 12
