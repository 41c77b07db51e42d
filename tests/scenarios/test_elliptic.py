"""Jacobi's functions and the integrals compared with mpmath, close to the separatrix too."""

import mpmath
import numpy as np
import pytest

from dropspin.scenarios.truths.elliptic import argument, integral_of_sn2, jacobi, quarter_period

M1 = [1.0, 0.9, 0.5, 1e-3, 1e-8, 4e-18, 4e-26]


@pytest.mark.parametrize("m1", M1)
def test_jacobi_functions_match_mpmath(m1):
    """Within two periods of 0, to 1e-14 (measured 2e-15)."""
    K = quarter_period(m1)
    u = np.linspace(-8 * K, 8 * K, 41)
    found = jacobi(u, m1)
    with mpmath.mp.workdps(60):
        m = 1 - mpmath.mpf(m1)
        for name, values in found._asdict().items():
            exact = [float(mpmath.re(mpmath.ellipfun(name, mpmath.mpf(float(v)), m=m))) for v in u]
            np.testing.assert_allclose(values, exact, rtol=0, atol=1e-14 * max(1.0, K))


def test_jacobi_functions_on_the_separatrix_are_hyperbolic():
    """m₁ = 0: sn is tanh, cn and dn are sech."""
    u = np.array([-3.0, 0.0, 0.5, 20.0])
    found = jacobi(u, 0.0)
    np.testing.assert_allclose(found.sn, np.tanh(u), rtol=1e-15)
    np.testing.assert_allclose(found.dn, 1 / np.cosh(u), rtol=1e-15)
    assert quarter_period(0.0) == np.inf


@pytest.mark.parametrize("m1", M1)
def test_argument_inverts_sn_and_cn(m1):
    """From sn and cn back to u, over a whole period, to 1e-13 of K."""
    K = quarter_period(m1)
    for u in np.linspace(-1.999 * K, 1.999 * K, 23):
        at = jacobi(np.array([u]), m1)
        dn = float(at.dn[0])
        assert argument(float(at.sn[0]), float(at.cn[0]), m1) == pytest.approx(u, abs=2e-15 * K / min(1.0, dn))


@pytest.mark.sample(7)
@pytest.mark.parametrize("n", [0.0, -0.3, -5.0, -1e4])
@pytest.mark.parametrize("m1", [0.9, 0.5, 1e-3, 1e-8])
def test_integral_of_sn2_matches_quadrature(m1, n):
    """The integral of sn²/(1 - n sn²) over several half periods, to 1e-13.

    The reference is a quadrature over the amplitude φ, dv = dφ/√(cos²φ + m₁ sin²φ), in 20 digits; it has 15 of them at least.
    """
    K = quarter_period(m1)
    for u in (-0.3 * K, 0.9 * K, 1.7 * K, 3.2 * K):
        with mpmath.mp.workdps(20):

            def integrand(phi):
                s2 = mpmath.sin(phi) ** 2
                return s2 / ((1 - n * s2) * mpmath.sqrt(mpmath.cos(phi) ** 2 + mpmath.mpf(m1) * s2))

            sn, cn = (mpmath.ellipfun(name, mpmath.mpf(abs(u)), m=1 - mpmath.mpf(m1)) for name in ("sn", "cn"))
            amplitude = mpmath.atan2(sn, cn) % (2 * mpmath.pi)  # u is below one period, 4K
            quarters = [k * mpmath.pi / 2 for k in range(int(abs(u) // K) + 1)]
            exact = float(mpmath.sign(u) * mpmath.quad(integrand, [*quarters, amplitude]))
        found = integral_of_sn2(np.array([u]), jacobi(np.array([u]), m1), n, m1)
        assert found[0] == pytest.approx(exact, rel=1e-13)


def test_sn_of_a_tiny_argument_is_the_argument():
    """Where cn/sn would overflow, in the exact solutions and in the kernels."""
    from dropspin.reference_impl.elliptic import sn_cn_dn

    for u in (1e-110, 1e-160, 1e-300, -1e-200):
        found = jacobi(np.array([u]), 0.3)
        assert (found.sn[0], found.cn[0], found.dn[0]) == (pytest.approx(u, rel=1e-14), 1.0, 1.0)
        assert sn_cn_dn(u, 0.3) == (pytest.approx(u, rel=1e-14), 1.0, 1.0)
