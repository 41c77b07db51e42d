"""A motion compared with its reference: metrics, errors over time, tolerances, predicted errors."""
