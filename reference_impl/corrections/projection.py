"""`correction=projection`: after the step, lift a body that has sunk below the floor; its velocities do not change.

Wang's method corrects no position, so a body with restitution 0 sinks. The lift leaves the lowest vertex `PENETRATION_LEFT` below the
floor, so that the strict inequality of eq 10 still detects the contact.

Order: none claimed; the lift is as large as the penetration that contact detection left.
Keeps: a penetration of at most 1e-7 m at rest. Lifting adds potential energy, M g times the depth.
Cost: one pass over the vertices of a body that is near the floor.
Source: the simplest stabilisation of J. Baumgarte, CMAME 1 (1972), and E. Catto, Iterative Dynamics (GDC 2005).
"""

from dropspin.reference_impl.floor_plane import N, along_normal, contact_count, contact_offset, is_below
from dropspin.reference_impl.quaternion import rotation_matrix
from dropspin.reference_impl.vectors import compiled

ORDER = None

PENETRATION_LEFT = 1e-7  # m


@compiled
def correct(x, q, body, floor):
    """The position after lifting the lowest vertex to `PENETRATION_LEFT` below the floor, if it was lower."""
    if not x.y < body.reach:
        return x
    R = rotation_matrix(q)
    lowest = 0.0
    for i in range(contact_count(body)):
        r = contact_offset(R, body, i)
        if is_below(x, r, floor):
            lowest = min(lowest, x.y + along_normal(r))
    return x + max(-lowest - PENETRATION_LEFT, 0.0) * N
