"""Scenes and their exact solutions: the scene model, the catalogue, trajectories and exact solutions (truths)."""

from dropspin.scenarios.ensemble import members
from dropspin.scenarios.errors import DropspinError, SceneError, UnknownName
from dropspin.scenarios.loading import load, names
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.trajectory import Trajectory
from dropspin.scenarios.truths import Truth, truth_for
from dropspin.scenarios.truths.discrete_flight import discrete_flight

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

if __name__ != "dropspin.scenarios":  # in a checkout that is on the path
    raise ImportError("import dropspin.scenarios, not scenarios")
