"""`rotation=note`: eq 6. ω stays as it is; q moves along its tangent and is pulled back to unit length.

No gyroscopic term: not consistent for a body with unequal moments (order 0). Turns 2 atan(|ω| dt/2) a step instead of |ω| dt. Keeps
kinetic energy and |L|, and loses the direction of L. Never blows up.
Source: H. Wang, Rigid Body Dynamics, eq 6.
"""

from reference_impl.quaternion import normalise, product
from reference_impl.vectors import Quat, compiled


@compiled
def turn(q, w, dt, body):
    """Orientation and angular velocity (q, ω) after dt."""
    half = (0.5 * dt) * w
    return normalise(q + product(Quat(half.x, half.y, half.z, 0.0), q)), w
