"""Sweeps: any grid or random sample over scenes, engines, options, steps and starts, one row a job, resumable at any moment."""

from comparisons.sweeps.jobs import Sweep
from comparisons.sweeps.running import count, read, read_parts, run_sweep
from comparisons.sweeps.spec import load_sweep

__all__ = ["Sweep", "count", "load_sweep", "read", "read_parts", "run_sweep"]
