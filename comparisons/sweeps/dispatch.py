"""Consecutive jobs of a sweep: in batches if the engine can simulate batches, otherwise one after the other."""

import numpy as np

from dropspin.comparisons.engines.wang import Wang
from dropspin.comparisons.sweeps.any_engine import run_in_batches, run_single
from dropspin.comparisons.sweeps.arrays import run_batch
from dropspin.comparisons.sweeps.jobs import Sweep
from dropspin.comparisons.sweeps.outcomes import Outcomes, concatenated


def run_jobs(sweep: Sweep, first: int, last: int) -> Outcomes:
    """Run the jobs from number `first` up to, not including, `last`; the result of each is independent of the others.

    If an engine compiles, rounding may depend on how many of the jobs it simulates in a batch.
    """
    found = []
    for jobs in sweep.jobs(first, last):
        outcomes = Outcomes.empty(len(jobs), len(sweep.metrics))
        if isinstance(jobs.engine, Wang):
            run_batch(jobs, outcomes, sweep.metrics)
        elif jobs.engine.steps_batches:
            run_in_batches(jobs, outcomes, sweep.metrics)
        for index in np.flatnonzero(outcomes.verdict == ""):
            run_single(jobs, int(index), outcomes, sweep.metrics)
        found.append(outcomes)
    return concatenated(found)
