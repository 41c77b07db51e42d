"""`rotation=note`: eq 6. ω does not change; q moves along its tangent and is normalised.

    q ← (q + dt/2 [ω, 0] q) / |…|,   ω ← ω

Order: none claimed. Without the gyroscopic term the method is inconsistent (order 0) for unequal moments. About a principal axis it is of
order 2: it rotates by 2 atan(|ω| dt/2) in a step instead of |ω| dt.
Keeps: kinetic energy and |L|, but not the direction of L.
Valid for: any |ω| dt; it never diverges.
Cost: one quaternion product and one normalisation per step, the least of all rotations.
Source: H. Wang, Rigid Body Dynamics, eq 6.
"""

from dropspin.reference_impl.quaternion import normalise, product
from dropspin.reference_impl.vectors import Quat, compiled

ORDER = None
DISCRETISATION = "note"


@compiled
def turn(q, w, dt, body):
    """Orientation and angular velocity (q, ω) after dt."""
    half = (0.5 * dt) * w
    return normalise(q + product(Quat(half.x, half.y, half.z, 0.0), q)), w
