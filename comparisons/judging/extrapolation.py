"""Extrapolation to dt = 0 with a credible interval: a Bayesian average over models of the error as a function of the time step.

    e(h) = m + s Hᵖ (c₀ + q (c₁ r Hᵈ + c₂ r² H²ᵈ + c₃ r³ H³ᵈ)) + s ρ Hᵖ ξ(h) + noise        H = h / the coarsest h

m is the asymptotic error. The cₖ and ξ(h) are independent standard normal variables: the former give a series of powers that starts at the
order p, the latter a discrepancy that no smooth series has, such as a kink of a maximum or the time of an impact between two steps. Some
series have another term in the bracket: c (X/H)ˡ of the lower order p - l, which is as large as the leading term at the step X. In an error
from one start, a term of first order may be multiplied by the remainder of a time T divided by the step, T/h mod 1. What is not known is
averaged over: p, r, d, l, X, ρ and T over the values below, s with the density 1/s, and m, which is 0 with even odds and else normal with a
standard deviation of s times a value on a logarithmic grid. Given these, everything is Student-t, with closed forms.

The error of a signed metric is e itself. One that cannot be negative is a norm, |m + …|, whose square is a smooth function of the step
where the norm itself has a kink; then e and e² have even odds of being the series above.

Source: the model average is in the manner of C. J. Oates et al., Probabilistic Richardson Extrapolation, J. R. Stat. Soc. B (2024), and of
    L. Eça & M. Hoekstra, J. Comput. Phys. 262 (2014), who take the spread between forms for the effect of the form. The weights of the
    forms and the credible level are dropspin's own; docs/coverage.md shows how often the interval is right.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.judging.mixtures import quantiles, student_t
from dropspin.scenarios.state import Array

ORDERS = np.arange(0.5, 6.01, 0.5)
"""Possible orders of the leading term."""
EACH_ORDER_FURTHER = 0.5
"""Weight of an order relative to the order nearer to 1 by 1, because an apparent high order may be due to lower powers that cancel."""
LATER_TERMS = 1.0 / 3.0
"""q: the size of further coefficients relative to the leading one; a series whose leading term is cancelled by others is rare."""
TERM_RATIOS = (0.3, 1.0)
"""r: the ratio of each further coefficient to the previous one, at the coarsest time step."""
TERM_DISTANCES = {1.0: 0.5, 2.0: 0.1, 0.5: 0.1}
"""d: the difference of successive powers, and its probability: all powers, only even powers, or also half powers."""
LOGARITHM = 0.1
"""Probability that a logarithm of the step multiplies the leading power."""
COMPETING = 0.2
"""Probability of a lower order beside the leading one: these four kinds of series are all that there are."""
LOWER_BY = (0.5, 1.0, 1.5, 2.0, 3.0)
"""l: by how much the lower order is lower."""
CROSSINGS = (1 / 2, 1 / 16, 1 / 128)
"""X: from the coarsest steps to steps so fine that the lower order hardly shows at those in use; its size varies by more than the factor of
eight between two of these values, because c does.
"""
REMAINDER, ALONE = 0.05, 0.01
"""Probability that an error from one start has a first-order part that is proportional to the remainder of a time divided by the step: one
as large as its other first-order part, or as the term of first order beside the second; and without any other part.
"""
LONGEST_PERIOD = 64
"""Largest common multiple of the steps, in common divisors, for which each remainder has its own form; else they count as independent."""
UNIFORM = 1.0 / math.sqrt(12.0)
"""Standard deviation of a number that is uniform between 0 and 1."""
DISCREPANCIES = {0.001: 0.7, 0.2: 0.3}
"""ρ and its probability: a smooth series, or one in which chance, a kink or a change of regime changes each error by a fifth."""
WIDE, WIDE_DISCREPANCY = 100.0, 1e-6
"""Above such a ratio of the steps each error has this part of its size alone: covariances differ by more than the digits of a double."""
RELATIVE_ROUNDING = 8.0 * np.finfo(float).eps
"""Rounding of each error, relative to the largest."""
NO_ASYMPTOTIC_ERROR = 0.5
"""Probability that m is 0 before the errors are seen."""
SMALLEST_SCALE, LARGEST_SCALE, SCALES_PER_DECADE = 1e-3, 10.0, 2
"""Standard deviations of m if it is not 0: from a thousandth of the change of the errors to ten times the largest error."""
NEGLIGIBLE_WEIGHT = 1e-3
"""The least likely forms, whose total weight is this, are left out."""
CREDIBLE = 0.99
"""Probability of the interval in this model, given that m is not 0: more than 95 %, because some series are described by no form."""


class _Forms(NamedTuple):
    covariances: Array
    """Covariances of the series divided by `leading`, shape (forms, n, n)."""
    leading: Array
    """Hᵖ, for steps of a wide range times the standard deviations of the series divided by it, shape (forms, n)."""
    orders: Array
    """The order that dominates at the finest step."""
    log_weights: Array
    without_claim: Array
    """The logarithm of the weights that no claim has changed, relative to `log_weights`."""


class _Fit(NamedTuple):
    log_weights: Array
    """(forms, 1 + scales), the first for m = 0."""
    centres: Array
    """Centres of the distributions of m, of the same shape as the widths."""
    widths: Array


@dataclass(frozen=True)
class Posterior:
    """The posterior distribution of the value m of an error at dt = 0.

    Attributes:
        zero: Probability that m is 0.
        weights: Weights of the Student-t distributions of m if it is not 0, the largest first, shape (k,); their sum is 1 - zero.
        centres: Centres of these distributions, of m² where `squares` is true.
        widths: Scales of these distributions.
        squares: Whether each is a distribution of m².
        freedom: Degrees of freedom of these distributions.
        has_sign: Whether m can be negative.
        order_lower: Lower end of the interval of the order.
        order_upper: Upper end of the interval of the order.
    """

    zero: float
    weights: Array
    centres: Array
    widths: Array
    squares: NDArray[np.bool_]
    freedom: int
    has_sign: bool
    order_lower: float
    order_upper: float

    def beyond(self, reach: float) -> tuple[float, float]:
        """Probabilities of m above `reach` and of m below -reach, which is not negative."""
        low, high = self._below(np.array([-reach, reach]))
        return float(1.0 - self.zero - high), float(low)

    def interval(self, judged_together: int = 1) -> tuple[float, float, float]:
        """Median, lower and upper end of the interval of m, given that m is not 0; of |m| if m has no sign.

        If several intervals are judged together, each is wider, so that the probability that all contain their values is that of a single
        interval.
        """
        credible = 1.0 - (1.0 - CREDIBLE) / judged_together
        roots = np.where(self.squares, np.sqrt(np.abs(self.centres) + 1e4 * self.widths), np.abs(self.centres) + 1e4 * self.widths)
        unit, reach = float(np.min(np.where(self.squares, np.sqrt(self.widths), self.widths))), float(np.max(roots))
        outside, other = 0.5 * (1.0 - credible), 1.0 - self.zero
        likeliest = float(self.centres[0])
        near = math.sqrt(max(likeliest, 0.0)) if self.squares[0] else likeliest
        low, median, high = quantiles(self._below, (other * outside, other * 0.5, other * (1.0 - outside)), near, unit, reach)
        if self.has_sign:
            return median, low, high
        # A norm that extrapolates below 0 has a limit above 0, after a minimum at finer steps.
        lower = max(low, -high, 0.0)
        wanted = other * (credible if lower == 0.0 else 1.0 - outside)
        [upper] = quantiles(lambda x: self._below(x) - self._below(-x), (wanted,), abs(near), unit, reach)
        return abs(median), lower, upper

    def _below(self, x: Array) -> Array:
        """The probability that m is not 0 and at most x, at each x."""
        points = np.where(self.squares, np.abs(x[:, None]) * x[:, None], x[:, None])
        return student_t(self.freedom, (points - self.centres) / self.widths) @ self.weights


def extrapolate(
    dts: Array, errors: Array, noise: Array, claimed: float | None = None, *, signed: bool = True, one_start: bool = False
) -> Posterior:
    """The posterior of the asymptotic error.

    Args:
        dts: Time steps [s], shape (n,), n >= 3.
        errors: The error at each.
        noise: Standard deviation of each.
        claimed: The claimed order of the method, which gets half of the weight of all orders.
        signed: Whether the error can be negative.
        one_start: Whether each error may depend on the remainder of a time divided by the step.
    """
    h = dts / np.max(dts)
    forms = _forms(tuple(h), None if claimed is None or not math.isfinite(claimed) else float(claimed), one_start)
    parts = [_fit(forms, errors, noise)]
    if not signed:
        squares = _fit(forms, errors**2, 2.0 * np.abs(errors) * noise + noise**2)
        sizes = np.maximum(np.abs(errors), np.maximum(noise, RELATIVE_ROUNDING * np.max(np.abs(errors))))  # an error may be 0
        log_weights = squares.log_weights + np.sum(np.log(2.0 * sizes))
        log_weights[forms.orders < 2.0 * ORDERS[0], 0] = -np.inf  # the square of an error that vanishes has twice its order
        parts.append(squares._replace(log_weights=log_weights))
    return _posterior(parts, forms, len(h))


@lru_cache(maxsize=64)
def _forms(h: tuple[float, ...], claimed: float | None, one_start: bool) -> _Forms:
    """All forms of a series, at time steps relative to the coarsest."""
    steps = np.array(h)
    weights = EACH_ORDER_FURTHER ** np.abs(ORDERS - 1.0)
    weights /= weights.sum()
    unclaimed = weights
    if claimed is not None:
        nearest = np.argmin(np.abs(ORDERS - claimed))
        weights = 0.5 * weights + 0.5 * (np.arange(len(ORDERS)) == nearest)
    forms = []
    for order, weight, ratio_of_weights in zip(ORDERS, weights, unclaimed / weights, strict=True):
        for terms, observed, chance in _series(steps, float(order), one_start):
            for discrepancy, share in DISCREPANCIES.items():
                covariance = terms.T @ terms + discrepancy**2 * np.eye(len(steps))
                leading = steps**order
                if WIDE * min(h) < max(h):
                    sizes = np.sqrt(np.diag(covariance))
                    covariance, leading = covariance / np.outer(sizes, sizes) + WIDE_DISCREPANCY**2 * np.eye(len(steps)), leading * sizes
                logs = math.log(weight * share * chance), math.log(ratio_of_weights)
                forms.append((covariance, leading, observed, *logs))
    return _Forms(*map(np.array, zip(*forms, strict=True)))


def _series(steps: Array, order: float, one_start: bool) -> Iterator[tuple[Array, float, float]]:
    """The series that have a leading order: terms divided by the leading power, order observed at the finest step, probability."""
    powers = np.arange(4.0)[:, None]
    finest, sizes = float(np.min(steps)), np.where(powers > 0.0, LATER_TERMS, 1.0)
    for ratio in TERM_RATIOS:
        for distance, chance in TERM_DISTANCES.items():
            yield sizes * ratio**powers * steps ** (distance * powers), order, chance / len(TERM_RATIOS)
        logarithms = np.array([np.ones_like(steps), np.log(steps), ratio * steps, ratio * steps * np.log(steps)])
        yield sizes * logarithms, order, LOGARITHM / len(TERM_RATIOS)
    # Where a second order competes, the terms of the series itself are small, or they would be taken for it.
    plain = sizes * (min(TERM_RATIOS) * steps) ** powers
    of_remainder = list(remainders(steps)) if one_start else []
    if order == 1.0:
        for remainder, chance in of_remainder:
            yield np.vstack([plain, remainder]), order, REMAINDER * chance
            yield remainder, order, ALONE * chance
    lower = [order - distance for distance in LOWER_BY if order - distance >= ORDERS[0]]
    for other in lower:
        for crossing in CROSSINGS:
            term, chance = (crossing / steps) ** (order - other), COMPETING / len(lower) / len(CROSSINGS)
            observed = other if crossing > finest else order
            yield np.vstack([plain, term]), observed, chance
            if other == 1.0 and order == 2.0:
                for remainder, chance_of_it in of_remainder:
                    share = REMAINDER * chance_of_it / len(CROSSINGS)
                    yield np.vstack([plain, term * remainder]), observed, 0.5 * share
                    yield np.vstack([plain, term, term * remainder]), observed, 0.5 * share


def remainders(steps: Array) -> Iterator[tuple[Array, float]]:
    """Terms of the remainder of a time divided by each step, which is uniform between 0 and 1, and their probability.

    If the steps have a common divisor u, the time is (i + x) u. All remainders of i, up to the least common multiple of the steps, are
    equally probable; x is uniform between 0 and 1 and the same at all steps. Otherwise the remainders count as independent.
    """
    ratios = steps / np.min(steps)
    for divisor in range(1, LONGEST_PERIOD + 1):  # the finest step divided by u
        multiples = np.round(divisor * ratios).astype(int)
        period = math.lcm(*map(int, multiples))
        if period <= LONGEST_PERIOD and np.allclose(divisor * ratios, multiples, rtol=1e-9, atol=0.0):
            whole, counts = np.unique(np.arange(period)[:, None] % multiples, axis=0, return_counts=True)
            for each, count in zip(whole, counts, strict=True):
                yield np.array([each + 0.5, np.full(len(steps), UNIFORM)]) / multiples, float(count) / period
            return
    yield np.vstack([np.full(len(steps), 0.5), np.eye(len(steps)) * UNIFORM]), 1.0


def _fit(forms: _Forms, e: Array, noise: Array) -> _Fit:
    """The weight of every form at every scale of m, and its Student-t distribution of m."""
    size = float(np.max(np.abs(e)))
    scale = max(float(np.ptp(e)), 1e-9 * size, float(np.min(noise)))
    leading = forms.leading
    relative = (np.hypot(noise, RELATIVE_ROUNDING * size) / scale / leading) ** 2
    covariances = forms.covariances + relative[:, :, None] * np.eye(len(e))
    series, ones = e / scale / leading, 1.0 / leading
    weighted = np.linalg.solve(covariances, np.stack([series, ones], axis=2))
    residual, along = (np.sum(weighted[:, :, 0] * values, axis=1)[:, None] for values in (series, ones))
    information = np.sum(weighted[:, :, 1] * ones, axis=1)[:, None]
    decades = math.log10(LARGEST_SCALE * size / scale / SMALLEST_SCALE)
    scales = np.geomspace(SMALLEST_SCALE, LARGEST_SCALE * size / scale, 1 + max(0, math.ceil(SCALES_PER_DECADE * decades)))
    variances = np.array([0.0, *scales**2])
    chances = np.array([NO_ASYMPTOTIC_ERROR, *np.full(len(scales), (1.0 - NO_ASYMPTOTIC_ERROR) / len(scales))])
    # Sherman and Morrison: m adds variances * 1 1ᵀ to the covariance.
    growth = 1.0 + variances * information
    residuals = np.maximum(residual - variances * along**2 / growth, np.maximum(1e-12 * residual, np.finfo(float).tiny))
    determinants = np.linalg.slogdet(covariances)[1] + 2.0 * np.sum(np.log(leading), axis=1)
    log_weights = (
        forms.log_weights[:, None]
        + np.log(chances)
        - 0.5 * (determinants[:, None] + np.log(growth))
        - 0.5 * len(e) * (np.log(residuals) + 2.0 * math.log(scale))
    )
    shrunk = variances / growth
    return _Fit(log_weights, scale * shrunk * along, scale * np.sqrt(shrunk * residuals / len(e)))


def _posterior(parts: list[_Fit], forms: _Forms, freedom: int) -> Posterior:
    """All forms combined; the parts are the fits of e and, for a metric without a sign, of e²."""
    top = max(float(np.max(part.log_weights)) for part in parts)
    weights = [np.exp(part.log_weights - top) for part in parts]
    zero, total = sum(float(array[:, 0].sum()) for array in weights), sum(float(array.sum()) for array in weights)
    columns = (weights, [part.centres for part in parts], [part.widths for part in parts])
    weight, centre, width = (np.concatenate([array[:, 1:].ravel() for array in column]) for column in columns)
    is_square = np.repeat(np.arange(len(parts)) == 1, [array[:, 1:].size for array in weights])
    likeliest = np.argsort(weight)[::-1]
    kept = likeliest[: 1 + np.searchsorted(np.cumsum(weight[likeliest]), (1.0 - NEGLIGIBLE_WEIGHT) * weight.sum())]
    share = (1.0 - zero / total) / weight[kept].sum()
    # A claim is what the order is judged by, so it does not count for the order's own interval; nor does e², which has another order.
    by_form = np.exp(forms.without_claim) * np.sum(weights[0], axis=1)
    order = _order_interval(by_form, forms.orders)
    return Posterior(zero / total, share * weight[kept], centre[kept], width[kept], is_square[kept], freedom, len(parts) == 1, *order)


def _order_interval(weights: Array, orders: Array) -> tuple[float, float]:
    """The interval of the orders without the least likely ones, extended at each end by half the distance to the next order."""
    each = np.array([weights[orders == order].sum() for order in ORDERS])
    cumulated, outside, half = np.cumsum(each) / each.sum(), 0.5 * (1.0 - CREDIBLE), 0.5 * float(ORDERS[1] - ORDERS[0])
    low, high = ORDERS[np.searchsorted(cumulated, outside)], ORDERS[np.searchsorted(cumulated, 1.0 - outside)]
    return float(low) - half, float(high) + half
