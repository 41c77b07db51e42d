"""`rotation=midpoint`: the implicit midpoint rule for the angular momentum m in the body, and Cayley's map for the orientation.

    m' = m + dt m̄ × ω̄,   m̄ = (m + m')/2,   ω̄ = I⁻¹ m̄,   q' = q (dt ω̄/2, 1) / |…|

Order: 2, because the rule is symmetric in time.
Keeps: kinetic energy and L in space, to the rounding of each step.
Valid for: |ω| dt up to about 3; beyond it Newton's method finds no root.
Cost: a few Newton steps, each with two matrix products and one solution of a 3 x 3 system.
Source: E. Hairer, C. Lubich & G. Wanner, Geometric Numerical Integration (2006), IV.8 and VII.5.
"""

from dropspin.reference_impl.quaternion import normalise, product, to_body, to_world
from dropspin.reference_impl.vectors import Mat3, Quat, Vec3, compiled, cross, cross_matrix, dot, solve

ORDER = 2.0
DISCRETISATION = "midpoint"

MAX_NEWTON_STEPS = 30
IDENTITY = Mat3(Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0))


@compiled
def turn(q, w, dt, body):
    """Orientation and angular velocity (q, ω) after dt."""
    start = body.inertia @ to_body(q, w)
    m = start
    small = 1e-32 * dot(start, start)
    for _ in range(MAX_NEWTON_STEPS):
        middle = 0.5 * (start + m)
        spin = body.inverse_inertia @ middle
        residual = m - start - dt * cross(middle, spin)
        J = IDENTITY - (0.5 * dt) * (cross_matrix(middle) @ body.inverse_inertia - cross_matrix(spin))
        correction = solve(J, residual)
        m = m - correction
        if not dot(correction, correction) > small:
            break
    half = (0.5 * dt) * (body.inverse_inertia @ (0.5 * (start + m)))
    q = normalise(product(q, Quat(half.x, half.y, half.z, 1.0)))
    return q, to_world(q, body.inverse_inertia @ m)
