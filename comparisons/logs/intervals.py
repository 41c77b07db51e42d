"""Bootstrap intervals over tosses that hold their level at ten tosses, and what they do not tell apart.

Sources: T. Hesterberg, The American Statistician 69 (2015), 371, section 5 (percentile intervals are too narrow by √((n-1)/n) and by normal
in place of Student's quantiles); P. Hall, The Bootstrap and Edgeworth Expansion (1992), section 3.3 (studentised intervals);
J. Romano & M. Wolf, J. Am. Stat. Assoc. 100 (2005), 94 (the largest of several studentised values); C. Clopper & E. Pearson, Biometrika 26
(1934), 404 (shares).
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.special import betaincinv, ndtr, stdtrit

from dropspin.scenarios.state import Array

LEVEL = 0.95
RESAMPLES = 1999
SEED = 20150101
FEWEST = 5
"""Tosses of which an interval is given: there are only 126 different resamples of five."""


def resamples(size: int) -> Array:
    """How often each of some tosses is in each resample, shape (RESAMPLES, size)."""
    return np.random.default_rng(SEED).multinomial(size, np.full(size, 1.0 / size), RESAMPLES).astype(float)


def expanded(lower: Array, upper: Array, size: int) -> tuple[float, float]:
    """The interval of an estimate from its values in resamples of tosses, or from bounds of each; the percentile interval, expanded."""
    tail = float(ndtr(stdtrit(size - 1, 0.5 * (1.0 - LEVEL)) * np.sqrt(size / (size - 1))))
    return float(np.quantile(lower, tail)), float(np.quantile(upper, 1.0 - tail))


def intervals_of_means(values: Array, simultaneous: bool = False) -> tuple[Array, Array]:
    """Intervals of the means of columns, NaN left out; or simultaneous ones, over the tosses that have a value in every column.

    Args:
        values: A row for each toss, shape (n, k).
        simultaneous: Whether the intervals hold for all columns at once; each is then symmetric, whatever the sign of its column.

    Returns:
        The lower and the upper ends, shape (k,); NaN for a column of fewer than `FEWEST` values.
    """
    lower, upper = np.full((2, values.shape[1]), np.nan)
    for columns in [list(range(values.shape[1]))] if simultaneous else [[column] for column in range(values.shape[1])]:
        rows = values[np.isfinite(values[:, columns]).all(axis=1)][:, columns]
        if len(rows) < FEWEST:
            continue
        counts, mean, error = resamples(len(rows)), rows.mean(axis=0), rows.std(axis=0, ddof=1) / np.sqrt(len(rows))
        means = counts @ rows / len(rows)
        errors = np.sqrt(np.maximum(counts @ (rows - mean) ** 2 / len(rows) - (means - mean) ** 2, 0.0) / (len(rows) - 1))
        deviations = means - mean
        studentised = np.divide(
            deviations, errors, out=np.copysign(np.where(deviations == 0.0, 0.0, np.inf), deviations), where=errors > 0.0
        )
        tail = 0.5 * (1.0 - LEVEL)
        if simultaneous:
            studentised, tail = np.hstack([studentised, -studentised]), 1.0 - LEVEL
        lower[columns] = mean - np.quantile(studentised.max(axis=1), 1.0 - tail, method="higher") * error
        upper[columns] = mean - np.quantile(studentised.min(axis=1), tail, method="lower") * error
    return lower, upper


def interval_of_share(hits: Array) -> tuple[float, float]:
    """The interval of the mean of values between 0 and 1, most of them 0 or 1, shape (n,); NaN left out."""
    known = hits[np.isfinite(hits)]
    if len(known) < FEWEST:
        return np.nan, np.nan
    tail, yes = 0.5 * (1.0 - LEVEL), known.sum()
    no = len(known) - yes
    return (betaincinv(yes, no + 1.0, tail) if yes > 0.0 else 0.0), (betaincinv(yes + 1.0, no, 1.0 - tail) if no > 0.0 else 1.0)


def groups(names: Sequence[str], apart: set[frozenset[str]]) -> tuple[tuple[str, ...], ...]:
    """The largest groups of which no two members are apart, in the order of the names; a name may be in several groups."""
    found: list[tuple[str, ...]] = []
    for size in range(len(names), 0, -1):
        for some in combinations(names, size):
            if not any(frozenset(pair) in apart for pair in combinations(some, 2)) and not any(set(some) <= set(one) for one in found):
                found.append(some)
    return tuple(sorted(found, key=lambda some: [names.index(name) for name in some]))
