"""`law=clamped`: sticking as in eq 17, with the largest restitution up to µ that adds no energy.

Kinetic energy is u·K⁻¹u/2 of the contact velocity u plus a part that no impulse changes; after eq 17 it is µ² u_n² (K⁻¹)_nn / 2.
Without friction it is the normal law, because eq 15 can add energy even at µ = 0.

Order: infinite; no time step enters (see the package's docstring).
Keeps: never adds energy.
Valid for: friction 0 or infinity.
Cost: three solutions of a 3 x 3 system per impact.
Source: follows from eq 12 and 15; A. Chatterjee & A. Ruina, J. Applied Mechanics 65 (1998), for the bound.
"""

import math

from dropspin.reference_impl.floor_plane import N
from dropspin.reference_impl.laws import normal
from dropspin.reference_impl.vectors import compiled, dot, solve

ORDER = math.inf
ANY_FRICTION = False


@compiled
def impulse(K, u, mu, friction):
    """The impulse j = K⁻¹ (-u - µ' u_n N) with µ' = min(µ, √(u·K⁻¹u / (u_n² N·K⁻¹N)))."""
    if not friction > 0.0:
        return normal.impulse(K, u, mu, friction)
    v_normal = dot(u, N)
    before = dot(u, solve(K, u))
    at_one = v_normal * v_normal * dot(N, solve(K, N))
    most = math.sqrt(max(before, 0.0) / (at_one if at_one > 0.0 else 1.0))
    return solve(K, -u - min(mu, most) * v_normal * N)
