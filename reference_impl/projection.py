"""`correction=projection`: after the step, lift a body that has sunk, without touching its velocities.

The note corrects no position, so a body with restitution 0 sinks. What stays below is `SLOP`, so that the strict test of eq 10 still sees
the contact. Lifting adds M g times the depth of potential energy.
Source: the simplest of the stabilisations in J. Baumgarte, CMAME 1 (1972), and E. Catto, Iterative Dynamics (GDC 2005).
"""

from reference_impl.contacts.mean import N, along_normal, vertex
from reference_impl.quaternion import rotation_matrix
from reference_impl.vectors import any_, compiled, select

SLOP = 1e-7  # m


@compiled
def lift(x, q, body):
    """The position after lifting the lowest vertex to SLOP below the floor, if it was lower."""
    near = x.y < body.reach
    if not any_(near):
        return x
    R = rotation_matrix(q)
    lowest = 0.0
    for i in range(body.points.shape[0]):
        lowest = min(lowest, x.y + along_normal(vertex(R, body, i)))
    return select(near, x + max(-lowest - SLOP, 0.0) * N, x)
