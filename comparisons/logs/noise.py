"""Errors of a recording: white noise and slow errors, and regressions over many flights that estimate both.

    value(t_i) = own_i β + shared_i θ + w(t_i) + e_i

β is of one flight and θ of all; e is white, and the second derivative of w is: errors of tracking that drift, and small forces. With s ≤ t,

    cov(w(s), w(t)) = slow² (s³/3 + s² (t - s)/2),    cov(w'(s), w(t)) = slow² min(s, t) (t - min(s, t)/2),    cov(w'(t), w'(t)) = slow² t

w counts as motion of the body: the state at the end of a flight contains it.

Source: G. Wahba, J. R. Stat. Soc. B 40 (1978), 364 (the integrated Wiener process); D. A. Harville, J. Am. Stat. Assoc. 72 (1977), 320
(restricted likelihood, which leaves out β and θ); K. L. Lange, R. J. A. Little & J. M. G. Taylor, J. Am. Stat. Assoc. 84 (1989), 881
(weights of a t distribution); J. T. Kent, D. E. Tyler & Y. Vardi, Commun. Stat. Simul. 23 (1994), 441 (their iteration).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dropspin.scenarios.state import Array

TAILS = 4.0
"""Degrees of freedom of the t distribution of a flight's errors; Lange, Little & Taylor use 4."""
ROUNDS = 4
"""Rounds of weights and noise; further ones change θ by less than a hundredth of its interval."""
SLOWEST, FASTEST = -2.0, 4.0
"""Range of log10 of the slow error at the end of the median flight over the white noise."""


class Noise(NamedTuple):
    """Standard deviations: of the white noise in the unit of the values, and of w'' in that unit / s^1.5."""

    white: float
    slow: float

    def of_weight(self, weight: float) -> "Noise":
        """The noise of a flight whose variances are this factor smaller."""
        return Noise(self.white / np.sqrt(weight), self.slow / np.sqrt(weight))

    def covariance(self, t: Array) -> Array:
        """Of the errors at times from the first one on [s], shape (n,): (n, n)."""
        early, late = np.minimum.outer(t, t), np.maximum.outer(t, t)
        return self.slow**2 * early**2 * (late / 2.0 - early / 6.0) + self.white**2 * np.eye(len(t))


@dataclass(frozen=True, eq=False)
class Samples:
    """Vectors that are measured during one flight.

    Attributes:
        t: Times from the first one on [s], shape (n,).
        values: Shape (n, 3).
        own: Derivatives by the parameters of the flight, shape (n, 3, k).
        shared: Derivatives by those that all flights share, shape (n, 3, m).
    """

    t: Array
    values: Array
    own: Array
    shared: Array

    def spectrum(self) -> tuple[Array, Array]:
        """Eigenvalues of the covariance of w for slow = 1, shape (n,), and the products of all columns in each.

        The products have shape (n, k + m + 1, k + m + 1). The columns are own, shared and values, the latter two less what the own ones
        fit, so that squares keep the digits of the noise.
        """
        eigenvalues, modes = np.linalg.eigh(Noise(0.0, 1.0).covariance(self.t))
        own = self.own.reshape(self.values.size, -1)
        rest = np.concatenate([self.shared, self.values[..., np.newaxis]], axis=2).reshape(self.values.size, -1)
        rest = rest - own @ np.linalg.lstsq(own, rest, rcond=None)[0]
        columns = np.concatenate([own, rest], axis=1).reshape(len(self.t), -1)
        by_mode = (modes.T @ columns).reshape(len(self.t), 3, -1)
        return np.maximum(eigenvalues, 0.0), by_mode.transpose(0, 2, 1) @ by_mode

    @property
    def freedom(self) -> int:
        """How many numbers are left beside the flight's own parameters."""
        return self.values.size - self.own.shape[2]


@dataclass(frozen=True, eq=False)
class Regression:
    """Parameters that flights share.

    Attributes:
        values: θ, shape (m,).
        noise: The noise of a flight of weight 1.
        weights: Of each flight, shape (flights,): its noise has this factor in 1 / variance.
        information: Of each flight, shape (flights, m, m).
        scores: Derivatives of each flight's log likelihood at θ, shape (flights, m).
        freedom: How many numbers are left beside all parameters.
    """

    values: Array
    noise: Noise
    weights: Array
    information: Array
    scores: Array
    freedom: int

    @cached_property
    def covariance(self) -> Array:
        """Of θ, shape (m, m): by leaving out one flight at a time, but not below that of the noise."""
        whole = self.information.sum(axis=0)
        by_noise = np.linalg.pinv(whole, hermitian=True)
        if len(self.weights) < FEWEST:
            return by_noise
        each = zip(self.information, self.scores, strict=True)
        without = np.array([-np.linalg.pinv(whole - own, hermitian=True) @ score for own, score in each])
        moved = without - without.mean(axis=0)
        found = (len(moved) - 1) / len(moved) * moved.T @ moved
        wider = np.sqrt(np.maximum(np.diag(by_noise) / np.maximum(np.diag(found), np.finfo(float).tiny), 1.0))
        return found * np.outer(wider, wider)

    def half_widths(self, outside: float = 0.05) -> Array:
        """Of intervals that θ is outside of with a probability, shape (m,): quantiles of Student's t.

        Its degrees of freedom are the number of flights minus 1; with few flights, the number of values minus that of the parameters.
        The interval of a parameter that the flights do not determine is infinite.
        """
        from scipy.special import stdtrit

        freedom = len(self.weights) - 1 if len(self.weights) >= FEWEST else self.freedom
        widths = float(stdtrit(freedom, 1.0 - outside / 2.0)) * np.sqrt(np.diag(self.covariance))
        whole = self.information.sum(axis=0)
        determined = np.diag(np.linalg.pinv(whole, hermitian=True) @ whole)  # of a projection: 1 if so
        return np.where(determined > DETERMINED, widths, np.inf)


ROUNDING = 1e-9
"""Smallest noise, as a share of the largest value: a recording that shows less is that of a simulator, which has errors of its own."""
DETERMINED = 0.99
"""Share of a parameter's direction that the flights determine, from which on they determine the parameter."""
FEWEST = 5
"""Flights from which on their differences give the interval; with fewer, the noise does."""


def regression(flights: Sequence[Samples]) -> Regression:
    """θ, the noise and the weights of flights, by restricted likelihood with the weights of a t distribution."""
    from scipy.optimize import minimize_scalar

    typical = float(np.median([samples.t[-1] for samples in flights]))
    unit = np.sqrt(3.0 / typical**3)
    freedom = np.array([samples.freedom for samples in flights])
    rounding = ROUNDING * (max(float(np.abs(samples.values).max()) for samples in flights) or 1.0)  # a body that does not turn has 0
    weights, shared = np.ones(len(flights)), flights[0].shared.shape[2]

    eigenvalues, spectra = _padded([samples.spectrum() for samples in flights])
    own = flights[0].own.shape[2]

    def parts(log_ratio: float) -> tuple[Array, Array, float]:
        variances = 1.0 + (unit * 10.0**log_ratio) ** 2 * eigenvalues
        products, determinants = _without_own(variances, spectra, own)
        return products, _solution(products, weights, shared), float(determinants.sum())

    def left_over(products: Array, theta: Array) -> Array:
        residual = np.append(theta, -1.0)
        return np.maximum(np.einsum("i,kij,j->k", residual, products, residual), freedom * rounding**2)

    def deviance(log_ratio: float) -> float:
        products, theta, determinant = parts(log_ratio)
        squares = float(weights @ left_over(products, theta))
        left = int(freedom.sum()) - shared
        values = np.linalg.eigvalsh(np.tensordot(weights, products, axes=1)[:shared, :shared])
        return determinant + left * np.log(squares) + float(np.log(np.maximum(values, np.finfo(float).tiny)).sum())

    for _ in range(ROUNDS):
        ratio = float(minimize_scalar(deviance, bounds=(SLOWEST, FASTEST), method="bounded", options={"xatol": 0.02}).x)
        products, theta, _ = parts(ratio)
        squares = left_over(products, theta)
        # Over the sum of the weights: the faster iteration of Kent, Tyler & Vardi, with the same limit.
        variance = float(weights @ squares) / (float(weights @ freedom) - shared)
        weights = (TAILS + freedom) / (TAILS + squares / variance)
        theta = _solution(products, weights, shared)
    noise = Noise(np.sqrt(variance), np.sqrt(variance) * unit * 10.0**ratio)
    scale = weights / variance
    information = scale[:, np.newaxis, np.newaxis] * products[:, :shared, :shared]
    scores = scale[:, np.newaxis] * (products[:, :shared, shared] - products[:, :shared, :shared] @ theta)
    return Regression(theta, noise, weights, information, scores, int(freedom.sum()) - shared)


def _padded(spectra: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Spectra of flights as arrays, in which those of shorter flights end with zeros."""
    longest, columns = max(len(values) for values, _ in spectra), spectra[0][1].shape[1]
    eigenvalues, products = np.zeros((len(spectra), longest)), np.zeros((len(spectra), longest, columns, columns))
    for row, (values, of_flight) in enumerate(spectra):
        eigenvalues[row, : len(values)], products[row, : len(values)] = values, of_flight
    return eigenvalues, products


def _without_own(variances: Array, spectra: Array, own: int) -> tuple[Array, Array]:
    """Weighted products of shared and values, perpendicular to own, shape (flights, m + 1, m + 1), and log determinants of likelihoods."""
    flights, count, columns, _ = spectra.shape
    whole = ((1.0 / variances)[:, np.newaxis] @ spectra.reshape(flights, count, -1)).reshape(flights, columns, columns)
    root = np.linalg.cholesky(whole[:, :own, :own])
    across = np.linalg.solve(root, whole[:, :own, own:])
    determinants = 3.0 * np.log(variances).sum(axis=1) + 2.0 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    return whole[:, own:, own:] - across.transpose(0, 2, 1) @ across, determinants


def _solution(products: Array, weights: Array, shared: int) -> Array:
    whole = np.tensordot(weights, products, axes=1)
    return np.asarray(np.linalg.lstsq(whole[:shared, :shared], whole[:shared, shared], rcond=None)[0], float)


def end_of(samples: Samples, own_rates: Array, noise: Noise) -> tuple[Array, Array]:
    """The value and its rate at the last time of a flight, w included, from all of the flight.

    Args:
        samples: The flight; its `shared` columns are not used.
        own_rates: Derivatives of the rate at the last time by the flight's parameters, shape (3, k).
        noise: The noise of this flight.

    Returns:
        Value and rate, shape (6,), and their covariance, shape (6, 6).
    """
    t, own, end = samples.t, samples.own, samples.t[-1]
    covariance, k = noise.covariance(t), own.shape[2]
    with_end = np.stack([noise.slow**2 * t**2 * (end / 2.0 - t / 6.0), noise.slow**2 * t**2 / 2.0])
    of_end = noise.slow**2 * np.array([[end**3 / 3.0, end**2 / 2.0], [end**2 / 2.0, end]])
    gain = np.linalg.solve(covariance, with_end.T).T
    weighted = np.linalg.solve(covariance, own.reshape(len(t), -1)).reshape(own.shape)
    normal = np.linalg.inv(np.einsum("tik,til->kl", own, weighted))
    beta = normal @ np.einsum("tik,ti->k", weighted, samples.values)
    left = samples.values - own @ beta
    columns = np.stack([own[-1], own_rates]) - np.tensordot(gain, own, axes=1)
    spread = columns.reshape(6, k)
    value = np.stack([own[-1] @ beta, own_rates @ beta]) + gain @ left
    return value.ravel(), np.kron(of_end - gain @ with_end.T, np.eye(3)) + spread @ normal @ spread.T
