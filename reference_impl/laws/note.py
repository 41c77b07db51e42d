"""`law=note`: eq 15 without friction, eq 17 with infinite friction.

Eq 15 keeps the tangential velocity of the contact, so its impulse is not normal: it has a tangential component, and it can increase the
energy by up to a factor of 7 at restitution 1. Eq 17 can add energy at restitution above 0.66 (a solid box), and its normal impulse can be
negative.

Order: infinite; no time step enters (see the package's docstring).
Valid for: friction 0 or infinity.
Cost: one solution of a 3 x 3 system per impact.
Source: H. Wang, Rigid Body Dynamics, eq 11 to 17.
"""

import math

from dropspin.reference_impl.floor_plane import N, along_normal
from dropspin.reference_impl.vectors import compiled, solve

ORDER = math.inf
ANY_FRICTION = False


@compiled
def impulse(K, u, mu, friction):
    """The impulse j that takes the contact velocity u to the prescribed one: K j = change."""
    v_normal = along_normal(u)
    sticks = -u - mu * v_normal * N  # eq 17
    slides = -(1.0 + mu) * v_normal * N  # eq 11
    return solve(K, sticks if friction > 0.0 else slides)
