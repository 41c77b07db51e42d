"""`rotation=exact`: the free rotor in closed form, restarted at every step.

    ω = (A_a cn, ± A_b sn, ± A_c dn)(u) along the principal axes a, b, c; b the intermediate one, c the one that L circles
    R' = R B₀ R_z(φ) B'ᵀ, B a triad in the body with L along its third axis, φ the angle by which it has turned about L

Order: infinite; each step is exact to the rounding of its restart.
Keeps: energy and L.
Valid for: any |ω| dt.
Cost: one set of elliptic functions, two integrals R_F and two to four R_J per step, by far the most of all rotations.
Source: L. D. Landau & E. M. Lifshitz, Mechanics, section 37; E. T. Whittaker, Analytical Dynamics, section 69; Carlson's integrals.
"""

import math

from dropspin.reference_impl.elliptic import r_f, r_j, sn_cn_dn
from dropspin.reference_impl.quaternion import conjugate, from_matrix, normalise, product, to_body, to_world
from dropspin.reference_impl.vectors import Mat3, Quat, Vec3, compiled, cross, dot, transpose

ORDER = math.inf
DISCRETISATION = "exact"

PARALLEL = 1e-15
"""Sine of the angle between L and ω below which the body counts as rotating about a principal axis."""


@compiled
def turn(q, w, dt, body):
    """Orientation and angular velocity (q, ω) after dt."""
    q = product(q, body.axes)
    spin = to_body(q, w)
    I = body.moments
    L = Vec3(I.x * spin.x, I.y * spin.y, I.z * spin.z)
    torque = cross(L, spin)
    if dot(torque, torque) <= PARALLEL * PARALLEL * dot(L, L) * dot(spin, spin):
        return normalise(product(product(q, _about(spin, dt)), conjugate(body.axes))), w
    a, b, c = _axes(I, spin)
    # The third axis is reversed unless b follows a in the cyclic order of the axes.
    sign = 1.0 if (b - a) % 3 == 1 else -1.0
    moments = Vec3(I[a], I[b], I[c])
    turned, after = _asymmetric_top(moments, Vec3(spin[a], spin[b], sign * spin[c]), dt)
    relative = Quat(_component(turned, a, b, 0, sign), _component(turned, a, b, 1, sign), _component(turned, a, b, 2, sign), turned.w)
    spin = Vec3(_component(after, a, b, 0, sign), _component(after, a, b, 1, sign), _component(after, a, b, 2, sign))
    q = normalise(product(q, relative))
    return product(q, conjugate(body.axes)), to_world(q, spin)


@compiled
def _square(x):
    """x², computed as a product, because powers round differently in Python and in compiled code."""
    return x * x


@compiled
def _about(spin, dt):
    """The rotation by |ω| dt about ω."""
    speed = math.sqrt(dot(spin, spin))
    share = math.sin(0.5 * dt * speed) / speed if speed > 0.0 else 0.0
    return Quat(share * spin.x, share * spin.y, share * spin.z, math.cos(0.5 * dt * speed))


@compiled
def _axes(I, spin):
    """The indices a, b, c of the principal axes: b intermediate, c the one that L circles."""
    low, middle, high = 0, 1, 2
    if I[low] > I[middle]:
        low, middle = middle, low
    if I[middle] > I[high]:
        middle, high = high, middle
    if I[low] > I[middle]:
        low, middle = middle, low
    beyond = I[high] * (I[high] - I[middle]) * _square(spin[high]) - I[low] * (I[middle] - I[low]) * _square(spin[low])
    return (low, middle, high) if beyond >= 0.0 else (high, middle, low)


@compiled
def _component(vector, a, b, axis, sign):
    """The component along a principal axis of a vector that is given by components along a, b and (signed) c."""
    if axis == a:
        return vector.x
    return vector.y if axis == b else sign * vector.z


@compiled
def _asymmetric_top(moments, spin, dt):
    """The rotation within dt, as a quaternion, and the angular velocity after it, along a, b, c."""
    Ia, Ib, Ic = moments.x, moments.y, moments.z
    to_c = Ia * (Ic - Ia) * _square(spin.x) + Ib * (Ic - Ib) * _square(spin.y)  # 2 T Ic - L²
    to_a = Ib * (Ib - Ia) * _square(spin.y) + Ic * (Ic - Ia) * _square(spin.z)  # L² - 2 T Ia
    to_b = Ic * (Ic - Ib) * _square(spin.z) - Ia * (Ib - Ia) * _square(spin.x)  # L² - 2 T Ib
    A = math.sqrt(to_c / (Ia * (Ic - Ia)))
    C = math.copysign(math.sqrt(to_a / (Ic * (Ic - Ia))), spin.z)
    B = math.copysign(math.sqrt(to_c / (Ib * (Ic - Ib))), (Ic - Ib) * C)
    rate = math.sqrt((Ic - Ib) * to_a / (Ia * Ib * Ic))
    m1 = min(max((Ic - Ia) * to_b / ((Ic - Ib) * to_a), 1e-300), 1.0)
    K = r_f(0.0, m1, 1.0)
    # The start's own sn and cn, of unit length together.
    cn0, sn0 = spin.x / A, spin.y / B
    length = math.sqrt(cn0 * cn0 + sn0 * sn0)
    cn0, sn0 = cn0 / length, sn0 / length
    dn0 = math.sqrt(m1 + (1.0 - m1) * cn0 * cn0)
    u0 = sn0 * r_f(cn0 * cn0, dn0 * dn0, 1.0)
    if cn0 < 0.0:
        u0 = math.copysign(2.0 * K, sn0) - u0
    u = u0 + rate * dt
    sn, cn, dn = sn_cn_dn(u, m1)
    after = Vec3(A * cn, B * sn, C * dn)

    # Measure the turn about L from the axis p that L stays away from; o is the other one, near L where sn = 0.
    ma, mb, mc = Ia * A, Ib * B, Ic * C
    about_c = abs(ma) > abs(mc)
    Io, mo = (Ia, ma) if about_c else (Ic, mc)
    mp2 = (1.0 - m1) * mc * mc if about_c else ma * ma
    L = math.sqrt(ma * ma + mc * mc)
    n = -mp2 / (mo * mo)
    swing = L * mb * mb * (Io - Ib) / (Io * Ib * mo * mo * rate)
    phi = L / Io * dt + swing * (_integral(u, sn, cn, dn, n, m1, K) - _integral(u0, sn0, cn0, dn0, n, m1, K))

    before = _triad(Vec3(ma * cn0, mb * sn0, mc * dn0), about_c)
    end = _triad(Vec3(ma * cn, mb * sn, mc * dn), about_c)
    c, s = math.cos(phi), math.sin(phi)
    about_momentum = Mat3(Vec3(c, -s, 0.0), Vec3(s, c, 0.0), Vec3(0.0, 0.0, 1.0))
    return from_matrix(transpose(before) @ about_momentum @ end), after


@compiled
def _integral(u, sn, cn, dn, n, m1, K):
    """The integral of sn² / (1 - n sn²) from 0 to u."""
    half_turns = math.floor(u / (2.0 * K) + 0.5)
    sign = 1.0 if half_turns % 2.0 == 0.0 else -1.0
    within = sign * sn * sn * sn / 3.0 * r_j(cn * cn, dn * dn, 1.0, 1.0 - n * sn * sn)
    if half_turns == 0.0:
        return within
    return 2.0 * half_turns * r_j(0.0, m1, 1.0, 1.0 - n) / 3.0 + within


@compiled
def _triad(L, about_c):
    """Three rows: two directions perpendicular to L, of which the first is also perpendicular to the axis p, and the direction of L."""
    along = L / math.sqrt(dot(L, L))
    first = cross(along, Vec3(0.0, 0.0, 1.0) if about_c else Vec3(1.0, 0.0, 0.0))
    first = first / math.sqrt(dot(first, first))
    return Mat3(first, cross(along, first), along)
