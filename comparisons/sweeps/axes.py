"""The axes of a sweep, which give the values of fields of a scene."""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios.ensemble import uniform
from dropspin.scenarios.state import Array

Indices = NDArray[np.int64]
Spacing = Literal["linear", "log"]


@dataclass(frozen=True)
class Listed:
    """An axis with the values of a list.

    Attributes:
        name: The dotted name of the field that it sets.
        values: The values.
    """

    name: str
    values: tuple[Any, ...]

    def __len__(self) -> int:
        return len(self.values)

    @property
    def is_numeric(self) -> bool:
        """Whether all values are numbers."""
        return all(type(value) in (int, float) for value in self.values)

    def at(self, indices: Indices) -> NDArray[Any]:
        """The values at some indices: float64, or objects where not all are numbers."""
        return np.fromiter(self.values, float if self.is_numeric else object, len(self))[indices]


@dataclass(frozen=True)
class Spaced:
    """An axis with evenly spaced values, both ends included, computed from their indices, so that any number of them takes no memory."""

    name: str
    first: float
    last: float
    count: int
    spacing: Spacing
    is_numeric = True

    def __len__(self) -> int:
        return self.count

    @property
    def values(self) -> tuple[Any, ...]:
        """The values with which a spec is verified: the two ends."""
        return self.first, self.last

    def at(self, indices: Indices) -> NDArray[Any]:
        """The values at some indices."""
        values = self._between(indices / (self.count - 1))
        values[indices == self.count - 1] = self.last  # without rounding
        return values

    def _between(self, fractions: Array) -> Array:
        """The values at fractions of the distance from the first to the last, or of the distance between their logarithms."""
        if self.spacing == "linear":
            return self.first + (self.last - self.first) * fractions
        # `math.pow`, because the last bit of NumPy's power may depend on the length of the array.
        return np.array([self.first * math.pow(self.last / self.first, fraction) for fraction in fractions.tolist()])


@dataclass(frozen=True)
class Drawn(Spaced):
    """An axis with random values: each depends only on the seed, the name of the axis and its index."""

    seed: int

    def at(self, indices: Indices) -> NDArray[Any]:
        return self._between(uniform(self.seed, self.name, indices))


SweepAxis = Listed | Spaced
