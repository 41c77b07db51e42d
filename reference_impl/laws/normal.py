"""`law=normal`: the impulse of a frictionless floor, straight up, with Newton's restitution.

Order: infinite; no time step enters (see the package's docstring).
Keeps: horizontal momentum. Never adds energy.
Valid for: frictionless floors. On other floors it applies no friction either.
Cost: one product with K per impact.
Source: E. T. Whittaker, Analytical Dynamics, section 95.
"""

import math

from dropspin.reference_impl.floor_plane import N
from dropspin.reference_impl.vectors import compiled, dot

ORDER = math.inf
ANY_FRICTION = True


@compiled
def impulse(K, u, mu, friction):
    """The impulse j = -(1 + µ) u_n / (N·K N) N."""
    return -(1.0 + mu) * dot(u, N) / dot(N, K @ N) * N
