"""`rotation=implicit-gyroscopic`: the gyroscopic term implicitly, by one Newton step in the body frame.

    f(ω') = I (ω' - ω) + dt ω' × I ω' = 0,   J = I + dt (ω* I - (I ω)*)

Order: 1, as implicit Euler.
Keeps: nothing. Loses energy and angular momentum.
Valid for: any |ω| dt; it never diverges.
Cost: `note`, two matrix products and one solution of a 3 x 3 system.
Source: E. Catto, Numerical Methods (GDC 2015), "Gyroscopic torque"; Bullet's rigid bodies use the same method.
"""

from dropspin.reference_impl.quaternion import to_body, to_world
from dropspin.reference_impl.rotations import note
from dropspin.reference_impl.vectors import compiled, cross, cross_matrix, solve

ORDER = 1.0
DISCRETISATION = "semi-implicit Euler with the gyroscopic term implicit"


@compiled
def turn(q, w, dt, body):
    """Orientation and angular velocity (q, ω) after dt."""
    spin = to_body(q, w)
    momentum = body.inertia @ spin
    J = body.inertia + dt * (cross_matrix(spin) @ body.inertia - cross_matrix(momentum))
    spin = spin - solve(J, dt * cross(spin, momentum))
    return note.turn(q, to_world(q, spin), dt, body)
