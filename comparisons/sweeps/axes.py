"""The axes of a sweep: each computes its values from their indices, so that an axis of any length takes no memory."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios.drawing import uniform

Indices = NDArray[np.int64]
Spacing = Literal["linear", "log"]


@dataclass(frozen=True)
class SweepAxis:
    """One axis: the dotted name of the field that it sets, and a number of values."""

    name: str

    def __len__(self) -> int:
        raise NotImplementedError

    @property
    def is_numeric(self) -> bool:
        """Whether all values are numbers."""
        return True

    def at(self, indices: Indices) -> NDArray[Any]:
        """The values at some indices: float64, or objects where not all are numbers."""
        raise NotImplementedError

    @property
    def representative_values(self) -> Sequence[Any]:
        """The values that a spec is verified with: every value of a list, or the two ends of a range."""
        raise NotImplementedError


@dataclass(frozen=True)
class Listed(SweepAxis):
    """The values of a list."""

    values: tuple[Any, ...]

    def __len__(self) -> int:
        return len(self.values)

    @property
    def is_numeric(self) -> bool:
        return all(type(value) in (int, float) for value in self.values)

    def at(self, indices: Indices) -> NDArray[Any]:
        if self.is_numeric:
            return np.array(self.values, dtype=float)[indices]
        values = np.empty(len(self.values), dtype=object)
        for index, value in enumerate(self.values):
            values[index] = value
        return values[indices]

    @property
    def representative_values(self) -> Sequence[Any]:
        return self.values


@dataclass(frozen=True)
class _Range(SweepAxis):
    """A number of values between two numbers."""

    first: float
    last: float
    count: int
    spacing: Spacing

    def __len__(self) -> int:
        return self.count

    @property
    def representative_values(self) -> Sequence[Any]:
        return self.first, self.last


@dataclass(frozen=True)
class Spaced(_Range):
    """Evenly spaced values; both ends are included."""

    def at(self, indices: Indices) -> NDArray[Any]:
        values = interpolate(self.first, self.last, self.spacing, indices / (self.count - 1))
        values[indices == self.count - 1] = self.last  # without rounding
        return values


@dataclass(frozen=True)
class Drawn(_Range):
    """Random values: each depends only on the seed, the name of the axis and its index."""

    seed: int

    def at(self, indices: Indices) -> NDArray[Any]:
        return interpolate(self.first, self.last, self.spacing, uniform(self.seed, self.name, indices))


def interpolate(first: float, last: float, spacing: Spacing, fractions: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values at fractions of the distance from the first to the last, or of the distance between their logarithms."""
    if spacing == "linear":
        return first + (last - first) * fractions
    # `math.pow`, because the last bit of NumPy's power may depend on the length of the array.
    return np.array([first * math.pow(last / first, fraction) for fraction in fractions.tolist()])
