"""`law=poisson`: sticking with Poisson's restitution, in which expansion returns µ times the impulse of compression.

The contact leaves straight up at s = µ max(-N·K⁻¹u, 0) / (N·K⁻¹N). Without friction Poisson's and Newton's restitution are equal, so this
law equals `normal`.

Order: infinite; no time step enters (see the package's docstring).
Keeps: never adds energy.
Valid for: friction 0 or infinity.
Cost: three solutions of a 3 x 3 system per impact.
Source: S. D. Poisson, Traité de mécanique (1833); W. J. Stronge, Impact Mechanics (2000), section 3.4.
"""

import math

from dropspin.reference_impl.floor_plane import N
from dropspin.reference_impl.laws import normal
from dropspin.reference_impl.vectors import compiled, dot, solve

ORDER = math.inf
ANY_FRICTION = False


@compiled
def impulse(K, u, mu, friction):
    """The impulse j = K⁻¹ (s N - u)."""
    if not friction > 0.0:
        return normal.impulse(K, u, mu, friction)
    compression = solve(K, u)
    s = mu * max(-dot(N, compression), 0.0) / dot(N, solve(K, N))
    return solve(K, s * N - u)
