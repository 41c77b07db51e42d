"""Verdicts on measured values: expectations, error budgets, orders of convergence, agreement between engines."""
