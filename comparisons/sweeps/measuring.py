"""A run of consecutive jobs, measured."""

import numpy as np

from comparisons.engines.document import Document
from comparisons.sweeps.jobs import Sweep
from comparisons.sweeps.outcomes import Outcomes, joined
from comparisons.sweeps.side_by_side import run_side_by_side
from comparisons.sweeps.singly import run_singly


def measured(sweep: Sweep, first: int, last: int) -> Outcomes:
    """The jobs from number `first` up to, not including, `last`; each as if it were alone."""
    lots = []
    for jobs in sweep.jobs(first, last):
        found = Outcomes.blank(len(jobs), len(sweep.metrics))
        if isinstance(jobs.engine, Document):
            run_side_by_side(jobs, found, sweep.metrics)
        for place in np.flatnonzero(found.verdict == ""):
            run_singly(jobs, int(place), found, sweep.metrics)
        lots.append(found)
    return joined(lots)
