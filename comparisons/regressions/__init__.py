"""Regressions: baselines of accepted results, comparisons of two runs, histories of many."""
