"""`rotation=gyroscopic`: eq 6 with the gyroscopic torque that it omits, explicitly.

    ω ← ω + dt I⁻¹ (-ω × I ω)

Order: 1, as explicit Euler.
Keeps: nothing. Gains energy at every step and diverges.
Valid for: short times and |ω| dt below 0.02.
Cost: `note` and one product with I and I⁻¹ each.
Source: L. Euler (1758) for the equations; many engines take the term explicitly, for instance MuJoCo's integrator Euler and
Bullet's btMultiBody.
"""

from dropspin.reference_impl.quaternion import to_body, to_world
from dropspin.reference_impl.rotations import note
from dropspin.reference_impl.vectors import compiled, cross

ORDER = 1.0
DISCRETISATION = "semi-implicit Euler with the gyroscopic term explicit"


@compiled
def turn(q, w, dt, body):
    """Orientation and angular velocity (q, ω) after dt."""
    spin = to_body(q, w)
    spin = spin - dt * (body.inverse_inertia @ cross(spin, body.inertia @ spin))
    return note.turn(q, to_world(q, spin), dt, body)
