"""Symmetries of the motion and repeatability: what must hold in every scene, whether or not its exact solution is known."""
