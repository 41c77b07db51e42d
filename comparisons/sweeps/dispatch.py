"""Consecutive jobs of a sweep: in one batch if the engine can simulate batches, otherwise one after the other."""

import numpy as np

from comparisons.engines.document import Document
from comparisons.sweeps.batch import run_batch
from comparisons.sweeps.jobs import Sweep
from comparisons.sweeps.outcomes import Outcomes, concatenated
from comparisons.sweeps.single import run_single


def run_jobs(sweep: Sweep, first: int, last: int) -> Outcomes:
    """Run the jobs from number `first` up to, not including, `last`; the result of each is independent of the others."""
    found = []
    for jobs in sweep.jobs(first, last):
        outcomes = Outcomes.empty(len(jobs), len(sweep.metrics))
        if isinstance(jobs.engine, Document):
            run_batch(jobs, outcomes, sweep.metrics)
        for index in np.flatnonzero(outcomes.verdict == ""):
            run_single(jobs, int(index), outcomes, sweep.metrics)
        found.append(outcomes)
    return concatenated(found)
