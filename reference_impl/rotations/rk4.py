"""`rotation=rk4`: the classical Runge-Kutta method for the quaternion and the angular velocity in the body frame.

    q' = q [ω, 0] / 2,   ω' = I⁻¹ (-ω × I ω)

Order: 4.
Keeps: nothing exactly; energy and L drift at fifth order.
Valid for: |ω| dt up to about 2.5; beyond it the method diverges.
Cost: four evaluations of the rates and one normalisation per step.
Source: W. Kutta, Z. Math. Phys. 46 (1901).
"""

from dropspin.reference_impl.quaternion import normalise, product, to_body, to_world
from dropspin.reference_impl.vectors import Quat, compiled, cross

ORDER = 4.0
DISCRETISATION = "rk4"


@compiled
def turn(q, w, dt, body):
    """Orientation and angular velocity (q, ω) after dt."""
    spin = to_body(q, w)
    q1, s1 = _rates(q, spin, body)
    q2, s2 = _rates(q + 0.5 * dt * q1, spin + 0.5 * dt * s1, body)
    q3, s3 = _rates(q + 0.5 * dt * q2, spin + 0.5 * dt * s2, body)
    q4, s4 = _rates(q + dt * q3, spin + dt * s3, body)
    q = normalise(q + (dt / 6.0) * (q1 + 2.0 * q2 + 2.0 * q3 + q4))
    spin = spin + (dt / 6.0) * (s1 + 2.0 * s2 + 2.0 * s3 + s4)
    return q, to_world(q, spin)


@compiled
def _rates(q, spin, body):
    half = 0.5 * product(q, Quat(spin.x, spin.y, spin.z, 0.0))
    return half, -(body.inverse_inertia @ cross(spin, body.inertia @ spin))
