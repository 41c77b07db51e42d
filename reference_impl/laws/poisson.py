"""`law=poisson`: sticking with Poisson's restitution: expansion returns µ times the impulse of compression.

The contact leaves straight up at s = µ max(-N·K⁻¹u, 0) / (N·K⁻¹N). Never adds energy. Without friction Poisson's and Newton's
restitution are the same, so there it is the normal law.
Source: S. D. Poisson, Traité de mécanique (1833); W. J. Stronge, Impact Mechanics (2000), section 3.4.
"""

from reference_impl.contacts.mean import N
from reference_impl.laws import normal
from reference_impl.vectors import compiled, dot, select, solve


@compiled
def impulse(K, u, mu, friction):
    """The impulse j = K⁻¹ (s N - u)."""
    compression = solve(K, u)
    s = mu * max(-dot(N, compression), 0.0) / dot(N, solve(K, N))
    return select(friction > 0.0, solve(K, s * N - u), normal.impulse(K, u, mu, friction))
