"""A free rigid body by Taylor series in mpmath: no elliptic function in sight, as many digits as asked for.

Euler's equations and the quaternion's are polynomial, so each Taylor coefficient follows from the ones before it by sums of
products; steps of fixed length and high order give 40 digits and more.
"""

import mpmath
from mpmath import mp, mpf


def free_rotor(moments, spin, quaternion, times, digits=40, order=40, step="0.4", damping=0.0):
    """Quaternions [x, y, z, w] (body to world) and body-frame spins at ascending times, from t = 0.

    Everything starts from the exact values of the doubles given. `step` is divided by the spin, so that the series converge
    alike for slow and fast bodies. `damping` is the decay rate κ of (I ω)' = -κ I ω.
    """
    with mp.workdps(digits):
        moments = [mpf(m) for m in moments]
        spin = [mpf(w) for w in spin]
        norm = mpmath.sqrt(sum(mpf(c) ** 2 for c in quaternion))
        quaternion = [mpf(c) / norm for c in quaternion]
        longest = mpf(step) / mpmath.sqrt(sum(w * w for w in spin))
        t, states = mpf(0), []
        for time in times:
            while t < time:
                h = min(longest, mpf(time) - t)
                spin, quaternion = _advance(moments, spin, quaternion, h, order, mpf(damping))
                t += h
            states.append(([+c for c in quaternion], [+w for w in spin]))
    return states


def _advance(moments, spin, quaternion, h, order, damping):
    I1, I2, I3 = moments
    factors = ((I2 - I3) / I1, (I3 - I1) / I2, (I1 - I2) / I3)
    w = [[c] for c in spin]
    q = [[c] for c in quaternion]
    for n in range(order):
        products = [mpmath.fdot((w[a][k], w[b][n - k]) for k in range(n + 1)) for a, b in ((1, 2), (2, 0), (0, 1))]

        # q' = q [w, 0] / 2, with w in the body
        def conv(i, j, n=n):
            return mpmath.fdot((q[i][k], w[j][n - k]) for k in range(n + 1))

        rates = (
            conv(3, 0) + conv(1, 2) - conv(2, 1),
            conv(3, 1) + conv(2, 0) - conv(0, 2),
            conv(3, 2) + conv(0, 1) - conv(1, 0),
            -conv(0, 0) - conv(1, 1) - conv(2, 2),
        )
        for series, factor, product in zip(w, factors, products, strict=True):
            series.append((factor * product - damping * series[n]) / (n + 1))
        for series, rate in zip(q, rates, strict=True):
            series.append(rate / 2 / (n + 1))
    return [mpmath.polyval(s, h, asc=True) for s in w], [mpmath.polyval(s, h, asc=True) for s in q]
