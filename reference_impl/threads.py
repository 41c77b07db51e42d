"""The number of processors that this process may use, and the distribution of work among threads."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

STEPS_PER_TASK = 3_000_000
"""Number of steps, over all bodies, in one task of a thread, small enough for even distribution of the work and for prompt stops at
Ctrl-C.
"""
MIN_STEPS_FOR_THREADS = 300_000
"""Number of steps, over all bodies, below which starting threads takes longer than it saves."""


def usable_cores() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def share_out(fill: Callable[[int, int], int], count: int, work: int, threads: int | None) -> int:
    """Fill all blocks and add up what the calls return.

    Args:
        fill: A function that fills the blocks from one number up to, but not including, another.
        count: Number of blocks.
        work: Number of steps of all bodies in one block.
        threads: Number of threads. None: the number of processors that this process may use, if there is enough work.
    """
    if count == 1:
        return fill(0, 1)
    threads = threads or (usable_cores() if count * work > MIN_STEPS_FOR_THREADS else 1)
    each = min(max(1, STEPS_PER_TASK // max(work, 1)), -(-count // threads))
    firsts = range(0, count, each)
    lasts = [min(first + each, count) for first in firsts]
    if threads == 1:
        return sum(map(fill, firsts, lasts))
    with ThreadPoolExecutor(threads) as pool:
        return sum(pool.map(fill, firsts, lasts))
