"""Regressions: baselines of accepted results, comparisons of two runs, and histories of several runs."""
