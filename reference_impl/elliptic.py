"""Elliptic functions and integrals for the kernels, one number at a time.

Source: R. Bulirsch, Numerische Mathematik 7 (1965), for sn, cn, dn; B. C. Carlson, Numerical Algorithms 10 (1995), for R_F, R_C and R_J.
"""

import math

from dropspin.reference_impl.vectors import compiled

SMALLEST_SINE = 1e-100  # below it sn equals its argument, and the square of cn/sn would overflow
MAX_MEANS = 40  # of the arithmetic-geometric mean, which converges quadratically: a dozen suffice for m₁ down to 1e-300


@compiled
def sn_cn_dn(u, m1):
    """Jacobi's functions of u for the complementary parameter m₁ = 1 - k² in (0, 1]."""
    a, b = 1.0, math.sqrt(m1)
    c = 0.5 * (a + b)
    rounds = 0
    while abs(a - b) > 1e-8 * a and rounds < MAX_MEANS:
        a, b = c, math.sqrt(a * b)
        c = 0.5 * (a + b)
        rounds += 1
    sine, cosine = math.sin(c * u), math.cos(c * u)
    if abs(sine) < SMALLEST_SINE:
        return sine / c, cosine, 1.0
    ratio, dn = cosine / sine, 1.0
    c = c * ratio
    for done in range(rounds, -1, -1):
        a, b = _means(m1, done)
        ratio, c = c * ratio, c * dn
        dn = (b + ratio) / (a + ratio)
        ratio = c / a
    sn = math.copysign(1.0 / math.sqrt(c * c + 1.0), sine)
    return sn, c * sn, dn


@compiled
def _means(m1, rounds):
    """The arithmetic and geometric mean after some rounds; recomputed on each call, because a kernel keeps no list."""
    a, b = 1.0, math.sqrt(m1)
    for _ in range(rounds):
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    return a, b


@compiled
def r_f(x, y, z):
    """Carlson's R_F; at most one argument is 0."""
    mean = (x + y + z) / 3.0
    off = max(abs(mean - x), abs(mean - y), abs(mean - z))
    fourth, mean0, x0, y0 = 1.0, mean, x, y
    while off * fourth > 2.5e-3 * abs(mean):  # the series below is of sixth order, and 2.5e-3^6 is below rounding
        root = math.sqrt(x * y) + math.sqrt(y * z) + math.sqrt(z * x)
        x, y, z, mean = 0.25 * (x + root), 0.25 * (y + root), 0.25 * (z + root), 0.25 * (mean + root)
        fourth *= 0.25
    X, Y = (mean0 - x0) * fourth / mean, (mean0 - y0) * fourth / mean
    Z = -X - Y
    e2, e3 = X * Y - Z * Z, X * Y * Z
    return (1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0) / math.sqrt(mean)


@compiled
def r_c1(y):
    """Carlson's R_C(1, 1 + y) for y > -1: arctan(√y)/√y and its continuation."""
    if abs(y) < 1e-3:
        return 1.0 - y * (1.0 / 3.0 - y * (0.2 - y * (1.0 / 7.0 - y * (1.0 / 9.0 - y / 11.0))))
    if y > 0.0:
        return math.atan(math.sqrt(y)) / math.sqrt(y)
    return math.atanh(math.sqrt(-y)) / math.sqrt(-y)


@compiled
def r_j(x, y, z, p):
    """Carlson's R_J for p > 0; at most one of x, y and z is 0."""
    mean = (x + y + z + 2.0 * p) / 5.0
    delta = (p - x) * (p - y) * (p - z)
    off = max(abs(mean - x), abs(mean - y), abs(mean - z), abs(mean - p))
    fourth, total, mean0, x0, y0, z0 = 1.0, 0.0, mean, x, y, z
    while off * fourth > 1.5e-3 * abs(mean):
        sx, sy, sz, sp = math.sqrt(x), math.sqrt(y), math.sqrt(z), math.sqrt(p)
        root = sx * sy + sy * sz + sz * sx
        d = (sp + sx) * (sp + sy) * (sp + sz)
        total += fourth / d * r_c1(delta * fourth * fourth * fourth / (d * d))
        x, y, z, p, mean = 0.25 * (x + root), 0.25 * (y + root), 0.25 * (z + root), 0.25 * (p + root), 0.25 * (mean + root)
        fourth *= 0.25
    X, Y, Z = (mean0 - x0) * fourth / mean, (mean0 - y0) * fourth / mean, (mean0 - z0) * fourth / mean
    P = -(X + Y + Z) / 2.0
    xyz = X * Y * Z
    e2 = X * Y + X * Z + Y * Z - 3.0 * P * P
    e3 = xyz + 2.0 * e2 * P + 4.0 * P * P * P
    e4 = (2.0 * xyz + e2 * P + 3.0 * P * P * P) * P
    e5 = xyz * P * P
    series = 1.0 - 3.0 * e2 / 14.0 + e3 / 6.0 + 9.0 * e2 * e2 / 88.0 - 3.0 * e4 / 22.0 - 9.0 * e2 * e3 / 52.0 + 3.0 * e5 / 26.0
    return fourth * series / (mean * math.sqrt(mean)) + 6.0 * total
