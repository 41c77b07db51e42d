"""Random numbers by their number: draw i depends on the seed, on what it is for and on i, not on how many are drawn beside it."""

import hashlib

import numpy as np
from numpy.typing import NDArray

BLOCK = 1024  # draws that are made at a time, whichever of them are asked for


def uniform(seed: int, purpose: str, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
    """The draws of these numbers, each even over [0, 1), shape (len(numbers),).

    By a generator that counts (Philox-4x64; J. K. Salmon et al., SC 2011), so that any draw is reached without those before it.
    """
    key = int.from_bytes(hashlib.sha256(f"{seed} {purpose}".encode()).digest()[:16], "little")
    drawn = np.empty(len(numbers))
    for block in np.unique(numbers // BLOCK):
        counting = np.random.Philox(key=key)
        counting.advance(int(block) * BLOCK // 4)  # four draws to a count
        here = numbers // BLOCK == block
        drawn[here] = np.random.Generator(counting).random(BLOCK)[numbers[here] - block * BLOCK]
    return drawn
