"""Families of series that mislead an extrapolation: competing orders, close time steps, plateaus of a tolerance, remainders of a time.

The sizes of the parts are those of an error with a coefficient of .3 to 3 at the coarsest time step.
"""

import math

import numpy as np

from support.error_series import Array, Draw, Series, Vanishing, coefficient, limit, plain, powers

STEPS: dict[str, Array] = {
    **{str(count): 0.5 ** np.arange(count) for count in (3, 5, 6, 7)},
    "3 uneven": np.array([1.0, 0.6, 0.25]),
    "5 uneven": np.array([1.0, 0.5, 0.3, 0.15, 0.0625]),
    "9, ratio 1.2": 1.2 ** -np.arange(9.0),
    "7, ratio 1.3": 1.3 ** -np.arange(7.0),
    "6, ratio 1.4": 1.4 ** -np.arange(6.0),
    "6, ratio 1.5": 1.5 ** -np.arange(6.0),
    "7, ratio 1.5": 1.5 ** -np.arange(7.0),
    "7, most of them close": np.array([4.0, 2.0, 1.2, 1.15, 1.1, 1.05, 1.0]) / 4.0,
    "5 with a common divisor": np.array([20.0, 10.0, 5.0, 4.0, 2.0]) / 20.0,
    "5, no multiples": np.array([1.0, 0.53, 0.29, 0.137, 0.0613]),
}
"""Time steps relative to the coarsest, by how many they are; halved ones have no further name."""
CLOSE = tuple(name for name in STEPS if "," in name)


def competing(high: float, low: float, least: float = 1e-3, most: float = 10.0**-2.25) -> Vanishing:
    """Two orders, the lower with a small coefficient, of a size between these two."""
    return lambda rng, h: coefficient(rng, 0.3, 3.0) * h**high + coefficient(rng, least, most) * h**low


def any_two(rng: np.random.Generator, h: Array) -> Array:
    """A leading order of 2 to 4 and any lower whole one, of up to a tenth of it; the next higher order too."""
    high = float(rng.integers(2, 5))
    return competing(high, float(rng.integers(1, high)), 1e-4, 0.1)(rng, h) + coefficient(rng, 0.03, 1.0) * h ** (high + 1.0)


def remainder(rng: np.random.Generator, h: Array) -> Array:
    """The remainder of a time divided by the time step, relative to the step; the time is 50 to 1000 coarsest steps."""
    return np.mod(rng.uniform(50.0, 1000.0) / h, 1.0)


def with_remainder(rng: np.random.Generator, h: Array) -> Array:
    """First order, of which up to a half depends on the remainder."""
    return coefficient(rng, 0.3, 3.0) * h * (1.0 + coefficient(rng, 0.03, 0.5) * (remainder(rng, h) - 0.5))


def dominated_by_remainder(rng: np.random.Generator, h: Array) -> Array:
    """First order, of which from a tenth to ten times the rest depends on the remainder."""
    return coefficient(rng, 0.3, 3.0) * h + coefficient(rng, 0.3, 3.0) * h * remainder(rng, h)


def remainder_alone(rng: np.random.Generator, h: Array) -> Array:
    """First order, proportional to the remainder."""
    return coefficient(rng, 0.3, 3.0) * h * remainder(rng, h)


def second_order_with_remainder(rng: np.random.Generator, h: Array) -> Array:
    """Second order, and a smaller part of first order that depends on the remainder."""
    return coefficient(rng, 0.3, 3.0) * h**2 + coefficient(rng, 0.01, 0.3) * h * (remainder(rng, h) - 0.5)


def plateau(rng: np.random.Generator, h: Array) -> tuple[float, Array]:
    """The error of an iteration's tolerance, and one of order 1, 2 or 4 beside it."""
    return math.exp(rng.uniform(math.log(1e-6), math.log(0.1))), powers(float(rng.choice([1.0, 2.0, 4.0])))(rng, h)


def added_plateau(rng: np.random.Generator, h: Array, _least: float) -> Series:
    """A plateau with a sign."""
    m, rest = plateau(rng, h)
    return Series(m + rest, 0.0, True, m)


def root_of_squares(rng: np.random.Generator, h: Array, _least: float) -> Series:
    """A plateau at a right angle to the rest."""
    m, rest = plateau(rng, h)
    return Series(np.hypot(m, rest), 0.0, False, m)


def larger_of_plateau(rng: np.random.Generator, h: Array, _least: float) -> Series:
    """The larger of a plateau and the rest."""
    m, rest = plateau(rng, h)
    return Series(np.maximum(m, np.abs(rest)), 0.0, False, m)


def chance_plateau(rng: np.random.Generator, h: Array, _least: float) -> Series:
    """An iteration that stops by chance between 80 and 120 % of its tolerance, the mean of which is the asymptotic error."""
    m, rest = plateau(rng, h)
    return Series(np.abs(rest) + m * rng.uniform(0.8, 1.2, len(h)), 0.0, False, m)


def before_impact(rng: np.random.Generator, h: Array) -> Array:
    """First and second order, and what is left of a step after the remainder."""
    return powers(1.0)(rng, h) + coefficient(rng, 0.03, 1.0) * h * (1.0 - remainder(rng, h))


def as_large_as_second_order(rng: np.random.Generator, h: Array) -> Array:
    """Second order, and the step times the remainder, of the same size at the coarsest step."""
    return coefficient(rng, 0.3, 3.0) * h**2 + coefficient(rng, 0.3, 3.0) * h * remainder(rng, h)


def size_with_remainder(rng: np.random.Generator, h: Array, least: float) -> Series:
    """The size of an error of first order with a remainder."""
    m = limit(rng, least)
    return Series(np.abs(m + with_remainder(rng, h)), 0.0, False, abs(m))


KINDS: dict[str, Draw] = {
    "order 2, a little of order 1": plain(competing(2.0, 1.0)),
    "order 3, a little of order 2": plain(competing(3.0, 2.0)),
    "order 4, a little of order 1": plain(competing(4.0, 1.0)),
    "order 2, a little of order 1/2": plain(competing(2.0, 0.5)),
    "two of the orders 1 to 4": plain(any_two),
    "orders 1 to 3, close steps": plain(lambda rng, h: powers(float(rng.integers(1, 4)))(rng, h)),
    "orders 1, 2 and 3 mixed, close steps": plain(powers(1.0, most=3.0)),
    "plateau of a tolerance, added": added_plateau,
    "plateau of a tolerance, at a right angle": root_of_squares,
    "plateau of a tolerance, the larger": larger_of_plateau,
    "plateau of a tolerance, by chance": chance_plateau,
    "order 1 with a remainder of a time": plain(with_remainder),
    "order 2 with a remainder of a time": plain(second_order_with_remainder),
    "order 1 beside a remainder of a time": plain(dominated_by_remainder),
    "remainder of a time alone": plain(remainder_alone),
    "orders 1 to 3 before a remainder of a time": plain(before_impact),
    "order 2 beside a remainder of a time": plain(as_large_as_second_order),
    "absolute values with a remainder of a time": size_with_remainder,
}


def of_cosine(rng: np.random.Generator, h: Array) -> Array:
    """First order, modulated by a smooth periodic function of the remainder."""
    return coefficient(rng, 0.3, 3.0) * h * (1.0 + coefficient(rng, 0.03, 0.5) * np.cos(2.0 * math.pi * remainder(rng, h)))


def growing_plateau(rng: np.random.Generator, h: Array, _least: float) -> Series:
    """A plateau whose height changes by a fifth while another error vanishes."""
    m, rest = plateau(rng, h)
    return Series(m * (1.0 - 0.2 * h) + rest, 0.0, True, m)


def opposite(rng: np.random.Generator, h: Array) -> Array:
    """First order, and third of the other sign and of .3 to 100 times its size at the coarsest step."""
    first = coefficient(rng, 0.3, 3.0)
    return first * h - first * math.exp(rng.uniform(math.log(0.3), math.log(100.0))) * h**3


def size_of_opposite(rng: np.random.Generator, h: Array, least: float) -> Series:
    """The size of such an error, which does not show its change of sign."""
    m = limit(rng, least)
    return Series(np.abs(m + opposite(rng, h)), 0.0, False, abs(m))


HELD_OUT_KINDS: dict[str, Draw] = {
    "order 2.5, a little of order 1.25": plain(competing(2.5, 1.25)),
    "order 3, a little of order 1, then of 2": plain(lambda rng, h: competing(3.0, 1.0)(rng, h) + coefficient(rng, 1e-3, 1e-2) * h**2),
    "h² log h, a little of order 1": plain(
        lambda rng, h: coefficient(rng, 0.3, 3.0) * h**2 * np.log(h / 20.0) + coefficient(rng, 1e-3, 1e-2) * h
    ),
    "order 1.5, close steps": plain(powers(1.5, 0.5)),
    "plateau that is approached from below": growing_plateau,
    "order 1 with a cosine of a remainder": plain(of_cosine),
    "orders 1 and 3 of opposite signs": plain(opposite),
    "absolute values of orders 1 and 3 of opposite signs": size_of_opposite,
}
"""Families that were not looked at until all constants had been chosen."""


def steps_of(name: str) -> tuple[str, ...]:
    """The time steps at which a family is judged."""
    if "close" in name:
        return (*(each for each in CLOSE if each != "5, no multiples"), "6", "7")
    if "remainder" in name:
        return "3", "5", "5 with a common divisor", "5, no multiples"
    return "3", "5"
