"""The cost of accuracy: the error of each engine and method at each time step, and its wall time per simulated second."""
