"""`rotation=implicit-gyroscopic`: the gyroscopic term implicitly, by one Newton step in the body frame.

    f(ω') = I (ω' - ω) + dt ω' × I ω' = 0,   J = I + dt (ω* I - (I ω)*)

Order 1. Loses energy and angular momentum, never blows up.
Source: E. Catto, Numerical Methods (GDC 2015), "Gyroscopic torque"; so do Bullet's rigid bodies.
"""

from reference_impl.contacts.mean import cross_matrix
from reference_impl.quaternion import to_body, to_world
from reference_impl.rotations import note
from reference_impl.vectors import compiled, cross, solve


@compiled
def turn(q, w, dt, body):
    """Orientation and angular velocity (q, ω) after dt."""
    spin = to_body(q, w)
    momentum = body.inertia @ spin
    J = body.inertia + dt * (cross_matrix(spin) @ body.inertia - cross_matrix(momentum))
    spin = spin - solve(J, dt * cross(spin, momentum))
    return note.turn(q, to_world(q, spin), dt, body)
