"""What a sweep goes through: each axis gives the values of any of its places, and holds no more than was written down."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from scenarios.drawing import uniform

Places = NDArray[np.int64]
Spacing = Literal["linear", "log"]


@dataclass(frozen=True)
class SweepAxis:
    """One axis: the dotted name of what it sets, and how many values it has."""

    name: str

    def __len__(self) -> int:
        raise NotImplementedError

    @property
    def is_of_numbers(self) -> bool:
        """Whether all its values are numbers."""
        return True

    def at(self, places: Places) -> NDArray[Any]:
        """Its values at some places: float64, or objects where not all are numbers."""
        raise NotImplementedError

    @property
    def extremes(self) -> Sequence[Any]:
        """The values that its range can be judged by: each that was listed, else the ends."""
        raise NotImplementedError


@dataclass(frozen=True)
class Listed(SweepAxis):
    """Values as written."""

    values: tuple[Any, ...]

    def __len__(self) -> int:
        return len(self.values)

    @property
    def is_of_numbers(self) -> bool:
        return all(type(value) in (int, float) for value in self.values)

    def at(self, places: Places) -> NDArray[Any]:
        if self.is_of_numbers:
            return np.array(self.values, dtype=float)[places]
        values = np.empty(len(self.values), dtype=object)
        for place, value in enumerate(self.values):
            values[place] = value
        return values[places]

    @property
    def extremes(self) -> Sequence[Any]:
        return self.values


@dataclass(frozen=True)
class _Between(SweepAxis):
    """So many values from one number to another."""

    first: float
    last: float
    count: int
    spacing: Spacing

    def __len__(self) -> int:
        return self.count

    @property
    def extremes(self) -> Sequence[Any]:
        return self.first, self.last


@dataclass(frozen=True)
class Spaced(_Between):
    """Values evenly apart from one end to the other, both among them."""

    def at(self, places: Places) -> NDArray[Any]:
        found = between(self.first, self.last, self.spacing, places / (self.count - 1))
        found[places == self.count - 1] = self.last  # to the last digit
        return found


@dataclass(frozen=True)
class Drawn(_Between):
    """Values drawn at random: each depends on the seed, the axis's name and its own number alone."""

    seed: int

    def at(self, places: Places) -> NDArray[Any]:
        return between(self.first, self.last, self.spacing, uniform(self.seed, self.name, places))


def between(first: float, last: float, spacing: Spacing, shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values at shares of the way from the first to the last, or of the way between their logarithms."""
    if spacing == "linear":
        return first + (last - first) * shares
    # By `math`, whose last bit does not depend on the length of an array as NumPy's may.
    return np.array([first * math.pow(last / first, share) for share in shares.tolist()])
