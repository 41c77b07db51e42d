"""Families of synthetic series of errors, each with a known asymptotic error m; `interval_coverage` judges them."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Series(NamedTuple):
    """Errors at each step, coarsest first; their noise, whether they have a sign, and the asymptotic error.

    Errors of shape (n, 3) are vectors, which are judged by their components; the asymptotic error is that of their length.
    """

    errors: Array
    noise: float
    signed: bool
    asymptotic: float


Vanishing = Callable[[np.random.Generator, Array], Array]
"""The part of an error that vanishes."""
Draw = Callable[[np.random.Generator, Array, float], Series]
"""A series at steps relative to the coarsest; the last argument is the size of the smallest asymptotic error that is not 0."""


def limit(rng: np.random.Generator, least: float) -> float:
    """0 in half of the cases; else of either sign and of any size from the least to three times that of the leading term."""
    return 0.0 if rng.random() < 0.5 else coefficient(rng, least, 3.0)


def coefficient(rng: np.random.Generator, least: float, most: float) -> float:
    """Of either sign, its size log-uniform between two values."""
    return float(rng.choice([-1.0, 1.0]) * math.exp(rng.uniform(math.log(least), math.log(most))))


def powers(first: float, apart: float = 1.0, most: float = 1.0) -> Vanishing:
    """Three powers of the step; the second and third have coefficients of up to `most`, the first of .3 to 3."""

    def vanishing(rng: np.random.Generator, h: Array) -> Array:
        leading = coefficient(rng, 0.3, 3.0) * h**first
        return leading + coefficient(rng, 0.03, most) * h ** (first + apart) + coefficient(rng, 0.03, most) * h ** (first + 2.0 * apart)

    return vanishing


def logarithm(rng: np.random.Generator, h: Array) -> Array:
    """First order times a logarithm, the unit of the step unknown."""
    return coefficient(rng, 0.3, 3.0) * h * np.log(h * math.exp(rng.uniform(-6.0, -1.0)))


def exponential(rng: np.random.Generator, h: Array) -> Array:
    """All powers, as of a method that gains or loses energy at each step."""
    return np.expm1(rng.uniform(-3.0, 3.0) * h)


def fraction(rng: np.random.Generator, h: Array) -> Array:
    """A first-order error that saturates at coarse steps."""
    return h / (1.0 + math.exp(rng.uniform(-2.0, 2.0)) * h)


def sine(rng: np.random.Generator, h: Array) -> Array:
    """A component of a vector that turns by up to 6 rad too far."""
    return np.sin(math.exp(rng.uniform(math.log(0.1), math.log(6.0))) * h ** rng.choice([1.0, 2.0]))


def jitter(rng: np.random.Generator, h: Array) -> Array:
    """A first-order error whose coefficient depends on where an impact falls between two steps."""
    return h * rng.uniform(0.5, 1.0, len(h))


def plain(vanishing: Vanishing) -> Draw:
    """An asymptotic error and one that vanishes."""

    def draw(rng: np.random.Generator, h: Array, least: float) -> Series:
        m = limit(rng, least)
        return Series(m + vanishing(rng, h), 0.0, True, m)

    return draw


def noisy(times: float) -> Draw:
    """A first-order error with sampling noise of 1 to 10 % of its leading coefficient; `times` as large as stated."""

    def draw(rng: np.random.Generator, h: Array, least: float) -> Series:
        m, noise = limit(rng, least), 10.0 ** rng.uniform(-2.0, -1.0)
        return Series(m + powers(1.0)(rng, h) + times * noise * rng.normal(size=len(h)), noise, True, m)

    return draw


def absolute(rng: np.random.Generator, h: Array, least: float) -> Series:
    """The size of an error with a sign."""
    m = limit(rng, least)
    return Series(np.abs(m + powers(float(rng.choice([1.0, 2.0])))(rng, h)), 0.0, False, abs(m))


def norm(rng: np.random.Generator, h: Array, least: float) -> Series:
    """The length of a vector with three components."""
    limits, share = rng.normal(size=3), limit(rng, least)
    m = share * limits / np.linalg.norm(limits)
    return Series(np.linalg.norm([part + powers(1.0)(rng, h) for part in m], axis=0), 0.0, False, abs(share))


def vector(part: Vanishing) -> Draw:
    """A vector with three components, each with an asymptotic error of its own, half of them all 0."""

    def draw(rng: np.random.Generator, h: Array, least: float) -> Series:
        limits, share = rng.normal(size=3), limit(rng, least)
        components = [share * one / np.linalg.norm(limits) + part(rng, h) for one in limits]
        return Series(np.transpose(components), 0.0, True, abs(share))

    return draw


def maximum(rng: np.random.Generator, h: Array, least: float) -> Series:
    """The largest of three errors, each with a limit and an order of its own."""
    limits = [limit(rng, least) if rng.random() < 0.5 else 0.0 for _ in range(3)]
    errors = [np.abs(m + powers(float(rng.choice([1.0, 2.0])))(rng, h)) for m in limits]
    return Series(np.max(errors, axis=0), 0.0, False, float(np.max(np.abs(limits))))


def angle(rng: np.random.Generator, h: Array, least: float) -> Series:
    """The angle of a rotation by m + C hᵖ, which cannot exceed π; angles near π are not usable."""
    m, order = abs(limit(rng, least)), float(rng.choice([1.0, 2.0]))
    turned = m + math.exp(rng.uniform(math.log(0.1), math.log(12.0))) * h**order
    found = np.abs((turned + math.pi) % (2.0 * math.pi) - math.pi)
    return Series(np.where(found > 0.9 * math.pi, math.nan, found), 0.0, False, m)


FAMILIES: dict[str, Draw] = {
    **{f"order {p}": plain(powers(float(p))) for p in (1, 2, 3, 4)},
    "orders 1, 2 and 3 mixed": plain(powers(1.0, most=3.0)),
    "orders 2 and 4": plain(powers(2.0, 2.0)),
    "order 1.5": plain(powers(1.5)),
    "h log h": plain(logarithm),
    "angles that saturate at π": angle,
    "sampling noise": noisy(1.0),
    "absolute values": absolute,
    "norms of vectors": norm,
    "maxima": maximum,
}
PLAIN = tuple(FAMILIES)[:8]
"""Smooth series with a sign and without noise."""


def kinked(rng: np.random.Generator, h: Array) -> Array:
    """First order, with another coefficient above some step."""
    return coefficient(rng, 0.3, 3.0) * h + coefficient(rng, 0.3, 3.0) * np.maximum(h - rng.uniform(0.1, 0.9), 0.0)


def random_powers(rng: np.random.Generator, h: Array) -> Array:
    """Four powers from a random order on, with normal coefficients."""
    powers_of_h = h ** (rng.integers(1, 4) + np.arange(4))[:, None]
    found: Array = rng.normal(size=4) @ powers_of_h
    return found


def bounded(rng: np.random.Generator, h: Array) -> Array:
    """An error that has nearly its largest possible size at coarse steps, as a loss of energy may."""
    size = coefficient(rng, 0.3, 6.0)
    share = abs(size) * h / np.min(h)
    return math.copysign(1.0, size) * (np.tanh(share) if rng.random() < 0.5 else -np.expm1(-share))


OTHERS: dict[str, Draw] = {
    "vectors by their components": vector(lambda rng, h: powers(float(rng.choice([1.0, 2.0])))(rng, h)),
    "vectors with kinks by their components": vector(kinked),
    "order 1/2": plain(powers(0.5, 0.5)),
    "order 0.7": plain(powers(0.7)),
    "order 1, ten times as large powers": plain(powers(1.0, most=10.0)),
    "random powers": plain(random_powers),
    "exponentials": plain(exponential),
    "h / (1 + c h)": plain(fraction),
    "tanh": plain(lambda rng, h: np.tanh(coefficient(rng, 0.1, 7.0) * h)),
    "bounded errors at their bound": plain(bounded),
    "sines of up to 6 rad": plain(sine),
    "kinks": plain(kinked),
    "order 1 with jitter of a half": plain(jitter),
    "noise twice as large as stated": noisy(2.0),
}


def larger_of_two(rng: np.random.Generator, h: Array) -> Array:
    """The larger of two errors with signs, of first and of second order."""
    return np.maximum(powers(1.0)(rng, h), powers(2.0)(rng, h))


def one_of_many(rng: np.random.Generator, h: Array, least: float) -> Series:
    """The largest of six errors, one of which has an asymptotic error."""
    m = limit(rng, least)
    errors = [np.abs(part + powers(float(rng.choice([1.0, 2.0, 3.0])))(rng, h)) for part in (m, 0.0, 0.0, 0.0, 0.0, 0.0)]
    return Series(np.max(errors, axis=0), 0.0, False, abs(m))


def size_of_any_order(rng: np.random.Generator, h: Array, least: float) -> Series:
    """The size of an error with a sign, of order 1.5, 3 or 4."""
    m = limit(rng, least)
    return Series(np.abs(m + powers(float(rng.choice([1.5, 3.0, 4.0])))(rng, h)), 0.0, False, abs(m))


HELD_OUT: dict[str, Draw] = {
    "order 1.25": plain(powers(1.25)),
    "order 2.5": plain(powers(2.5)),
    "order 5": plain(powers(5.0)),
    "orders 1 and 3": plain(powers(1.0, 2.0)),
    "orders 2, 3 and 4 mixed": plain(powers(2.0, most=3.0)),
    "h² log h": plain(lambda rng, h: h * logarithm(rng, h)),
    "1 - exp(-c h)": plain(lambda rng, h: -np.expm1(-coefficient(rng, 0.1, 7.0) * h)),
    "larger of two with signs": plain(larger_of_two),
    "order 2 with jitter of a half": plain(lambda rng, h: h * jitter(rng, h)),
    "order 1 and additional jitter": plain(
        lambda rng, h: powers(1.0)(rng, h) + coefficient(rng, 0.03, 0.3) * h * rng.uniform(-1.0, 1.0, len(h))
    ),
    "absolute values, orders 1.5 to 4": size_of_any_order,
    "largest of six": one_of_many,
}
"""Families that were not looked at until all constants had been chosen."""
