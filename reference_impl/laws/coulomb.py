"""`law=coulomb`: stick if the impulse of eq 17 lies in the friction cone, else slip along the initial sliding direction.

    stick   K j = -u - µ u_n N
    slip    j = j_n (N - f t),  t = u_t / |u_t|,  j_n = -(1 + µ) u_n / (N·K (N - f t))

f is the coefficient of friction. The direction of slip is kept through the impact; a body that would turn it around within one
impact, or jam, is beyond this law. With Newton's restitution it can add energy where eq 17 does.
Source: C. A. de Coulomb (1785); E. J. Routh, Elementary Rigid Dynamics (1905), section 187.
"""

import math

from reference_impl.contacts.mean import N
from reference_impl.laws import normal, note
from reference_impl.vectors import compiled, dot, select


@compiled
def impulse(K, u, mu, friction):
    """The impulse j within the cone |j_t| <= f j_n."""
    v_normal = dot(u, N)
    stick = note.impulse(K, u, mu, friction)
    holds = (math.sqrt(stick.x * stick.x + stick.z * stick.z) <= friction * stick.y) | (friction == math.inf)
    sliding = u - v_normal * N
    speed = math.sqrt(sliding.x * sliding.x + sliding.z * sliding.z)
    direction = N - (friction / select(speed > 0.0, speed, 1.0)) * sliding
    slip = -(1.0 + mu) * v_normal / dot(N, K @ direction) * direction
    return select(friction > 0.0, select(holds, stick, slip), normal.impulse(K, u, mu, friction))
