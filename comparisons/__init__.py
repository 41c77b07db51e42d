"""Engines run, measured and judged."""

from comparisons.engines.base import AsBuilt, Diverged, Engine, EngineMissing, Limit, Simulation
from comparisons.engines.registry import engine, engine_names
from comparisons.ensembles import ENSEMBLE_METRICS
from comparisons.extremes import limits
from comparisons.isolation import Limits
from comparisons.metrics import METRICS
from comparisons.regressions.baseline import Baseline, accept, load_baseline, write_baseline
from comparisons.regressions.checking import check
from comparisons.regressions.comparing import compare
from comparisons.regressions.history import history
from comparisons.results import Results
from comparisons.run import DEFAULT_DTS, measure, run
from comparisons.simulating import simulate
from comparisons.tradeoff import tradeoff

__all__ = [
    "DEFAULT_DTS",
    "ENSEMBLE_METRICS",
    "METRICS",
    "AsBuilt",
    "Baseline",
    "Diverged",
    "Engine",
    "EngineMissing",
    "Limit",
    "Limits",
    "Results",
    "Simulation",
    "accept",
    "check",
    "compare",
    "engine",
    "engine_names",
    "history",
    "limits",
    "load_baseline",
    "measure",
    "run",
    "simulate",
    "tradeoff",
    "write_baseline",
]
