"""What accuracy costs: the error of each engine and method at each time step, against the time it takes per simulated second."""
