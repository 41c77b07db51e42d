"""From values to verdicts: expectations, error budgets, orders of convergence, agreement between engines."""
