"""`law=coulomb`: stick if the impulse of eq 17 lies in the friction cone, else slip along the initial sliding direction.

    stick   K j = -u - µ u_n N
    slip    j = j_n (N - f t),  t = u_t / |u_t|,  j_n = -(1 + µ) u_n / (N·K (N - f t))

f is the coefficient of friction. If the contact does not slide initially, t is the direction in which the normal impulse moves it, along (K
N)_t. If the direction of slip would reverse within the impact, or the contact would jam (N·K (N - f t) not above 0), friction stops the
slip during the impact: the contact sticks, with a larger tangential impulse than the cone allows.

Order: infinite; no time step enters (see the package's docstring).
Keeps: the friction cone where it slips. Slipping never adds energy; sticking adds energy where eq 17 does.
Valid for: any friction. One direction of slip per impact.
Cost: one solution of a 3 x 3 system and three products with K per impact.
Source: C. A. de Coulomb (1785); E. J. Routh, Elementary Rigid Dynamics (1905), section 187.
"""

import math

from dropspin.reference_impl.floor_plane import N
from dropspin.reference_impl.laws import normal, note
from dropspin.reference_impl.vectors import compiled, dot

ORDER = math.inf
ANY_FRICTION = True


@compiled
def impulse(K, u, mu, friction):
    """The impulse j, with |j_t| <= f j_n where it slips."""
    if not friction > 0.0:
        return normal.impulse(K, u, mu, friction)
    v_normal = dot(u, N)
    stick = note.impulse(K, u, mu, friction)
    driven = K @ N
    sliding = u - v_normal * N if _along_floor(u) > 0.0 else driven - driven.y * N
    speed = _along_floor(sliding)
    if _along_floor(stick) <= friction * stick.y or friction == math.inf or speed == 0.0:
        return stick
    direction = N - (friction / speed) * sliding
    response = dot(N, K @ direction)
    if not response > 0.0:
        return stick
    slip = -(1.0 + mu) * v_normal / response * direction
    return slip if dot(u + K @ slip, sliding) >= 0.0 else stick


@compiled
def _along_floor(a):
    """Length of the component along the floor."""
    return math.sqrt(a.x * a.x + a.z * a.z)
