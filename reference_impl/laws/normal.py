"""`law=normal`: the impulse of a frictionless floor, straight up, with Newton's restitution.

Never adds energy, keeps horizontal momentum. Valid for frictionless floors; on others it is a model of its own.
Source: E. T. Whittaker, Analytical Dynamics, section 95.
"""

from reference_impl.contacts.mean import N
from reference_impl.vectors import compiled, dot


@compiled
def impulse(K, u, mu, friction):
    """The impulse j = -(1 + µ) u_n / (N·K N) N."""
    return -(1.0 + mu) * dot(u, N) / dot(N, K @ N) * N
