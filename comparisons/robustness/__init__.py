"""Robustness: where engines break, along axes such as step, spin, height, inertia, mass, restitution, duration and size."""
