"""Engines run, measured and judged."""

from comparisons.engines.base import AsBuilt, Diverged, Engine, EngineMissing, Limit, Simulation
from comparisons.engines.registry import engine, engine_names
from comparisons.ensembles import ENSEMBLE_METRICS
from comparisons.extremes import limits
from comparisons.isolation import Limits
from comparisons.metrics import METRICS
from comparisons.results import Results
from comparisons.run import DEFAULT_DTS, measure, run
from comparisons.simulating import simulate
from comparisons.tradeoff import tradeoff

__all__ = [
    "DEFAULT_DTS",
    "ENSEMBLE_METRICS",
    "METRICS",
    "AsBuilt",
    "Diverged",
    "Engine",
    "EngineMissing",
    "Limit",
    "Limits",
    "Results",
    "Simulation",
    "engine",
    "engine_names",
    "limits",
    "measure",
    "run",
    "simulate",
    "tradeoff",
]
