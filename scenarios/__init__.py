"""Scenes and their exact solutions: the scene model, the catalogue, trajectories and exact solutions (truths)."""

from dropspin.scenarios.ensemble import members as members
from dropspin.scenarios.errors import DropspinError as DropspinError
from dropspin.scenarios.errors import SceneError as SceneError
from dropspin.scenarios.errors import UnknownName as UnknownName
from dropspin.scenarios.loading import load as load
from dropspin.scenarios.loading import names as names
from dropspin.scenarios.model import Scenario as Scenario
from dropspin.scenarios.trajectory import Trajectory as Trajectory
from dropspin.scenarios.truths import Truth as Truth
from dropspin.scenarios.truths import reference_for as reference_for
from dropspin.scenarios.truths import truth_for as truth_for
from dropspin.scenarios.truths.discrete_flight import discrete_flight as discrete_flight

if __name__ != "dropspin.scenarios":  # in a checkout that is on the path
    raise ImportError("import dropspin.scenarios, not scenarios")
