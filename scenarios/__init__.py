"""Scenes and their exact solutions: the scene model, the catalogue, trajectories and exact solutions (truths)."""

from scenarios.ensemble import members
from scenarios.errors import DropspinError, SceneError, UnknownName
from scenarios.loading import load, names
from scenarios.model import Scenario
from scenarios.trajectory import Trajectory
from scenarios.truths import Truth, truth_for
from scenarios.truths.discrete_flight import discrete_flight

__all__ = [
    "DropspinError",
    "Scenario",
    "SceneError",
    "Trajectory",
    "Truth",
    "UnknownName",
    "discrete_flight",
    "load",
    "members",
    "names",
    "truth_for",
]
