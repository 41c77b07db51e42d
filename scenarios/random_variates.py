"""Random variates of which random scenes are made."""

import numpy as np

from dropspin.scenarios.state import Array


class Draws:
    """Random draws for one scene, all from uniform or normal variates of one generator."""

    def __init__(self, generator: np.random.Generator) -> None:
        self._generator = generator

    def uniform(self, low: float, high: float) -> float:
        """A number of U(low, high)."""
        return low + (high - low) * float(self._generator.random())

    def log_uniform(self, low: float, high: float) -> float:
        """A number of LU(low, high)."""
        return low * (high / low) ** float(self._generator.random())

    def happens(self, probability: float) -> bool:
        """Whether an event of this probability occurs."""
        return float(self._generator.random()) < probability

    def one_of(self, count: int) -> int:
        """A number below `count`."""
        return int(count * float(self._generator.random()))

    def direction(self, dimensions: int = 3) -> Array:
        """A unit vector; of four dimensions, an orientation."""
        vector = self._generator.normal(size=dimensions)
        return vector / np.linalg.norm(vector)

    def heading(self) -> Array:
        """A horizontal unit vector."""
        x, z = self.direction(2)
        return np.array([x, 0.0, z])

    def normal(self, rows: int) -> Array:
        """Standard normal variates, shape (rows, 3)."""
        return self._generator.normal(size=(rows, 3))
