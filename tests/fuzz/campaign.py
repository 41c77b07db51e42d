"""The number of cases of each test, and their seed: the same cases in every run with the same `FUZZ_CASES` and `FUZZ_SEED`."""

import os
from collections.abc import Callable
from typing import Any

from hypothesis import HealthCheck, Phase, seed, settings

CASES = int(os.environ.get("FUZZ_CASES", "60"))
SEED = int(os.environ.get("FUZZ_SEED", "0"))
IN_ALL = 2000
"""The campaign's number of cases, of which each test states its own."""


def cases(of_all: int) -> Callable[[Any], Any]:
    """Run a test of hypothesis with this many cases of the 2,000, or with its share of fewer or more."""
    count = max(1, round(of_all * CASES / IN_ALL))
    # Without shrinking: cases are small, and a command takes up to seconds.
    chosen = settings(max_examples=count, phases=[Phase.generate], database=None, suppress_health_check=list(HealthCheck))
    return lambda test: seed(SEED)(chosen(test))
