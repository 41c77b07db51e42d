"""What is simulated, and what the exact answer is: scenes, their catalogue, trajectories and truths."""

from scenarios.ensemble import members
from scenarios.errors import DropspinError, SceneError, UnknownName
from scenarios.loading import load, names
from scenarios.model import Scenario
from scenarios.trajectory import Trajectory
from scenarios.truths import Truth, truth_for

__all__ = ["DropspinError", "Scenario", "SceneError", "Trajectory", "Truth", "UnknownName", "load", "members", "names", "truth_for"]
