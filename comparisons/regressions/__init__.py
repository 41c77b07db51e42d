"""Runs held against earlier ones: accepted figures, what changed between two runs and why, and when figures moved."""
