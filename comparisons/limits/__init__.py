"""Limits: the failure modes of engines along axes such as step, spin, height, inertia, mass, restitution, duration and size."""
