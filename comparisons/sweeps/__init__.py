"""Sweeps: a grid or random sample over scenes, engines, options, time steps and starts; one row for each job, and resumable."""
