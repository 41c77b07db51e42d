"""Numbered random draws: draw i depends on the seed, on the purpose of the draws and on i, but not on the number of draws."""

import hashlib

import numpy as np
from numpy.typing import NDArray

DRAWS_PER_BLOCK = 1024  # generated together, however many of them are requested


def uniform(seed: int, purpose: str, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
    """The draws with these numbers, uniform over [0, 1), shape (len(numbers),).

    They come from a counter-based generator (Philox-4x64; J. K. Salmon et al., SC 2011), which computes any draw without the previous ones.
    """
    key = int.from_bytes(hashlib.sha256(f"{seed} {purpose}".encode()).digest()[:16], "little")
    drawn = np.empty(len(numbers))
    for block in np.unique(numbers // DRAWS_PER_BLOCK):
        counting = np.random.Philox(key=key)
        counting.advance(int(block) * DRAWS_PER_BLOCK // 4)  # four draws to a count
        here = numbers // DRAWS_PER_BLOCK == block
        drawn[here] = np.random.Generator(counting).random(DRAWS_PER_BLOCK)[numbers[here] - block * DRAWS_PER_BLOCK]
    return drawn
