"""The comparison of a motion with its reference: metrics, errors over time, tolerances, predicted errors."""
