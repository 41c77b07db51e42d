"""Exact solutions ("truths"). Each file solves one problem and states its formula, its source and its range of validity."""

from functools import lru_cache

from dropspin.scenarios.errors import DropspinError
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.truths.bounce import bounce_ladder
from dropspin.scenarios.truths.corner_impact import corner_impact
from dropspin.scenarios.truths.coulomb_slide import coulomb_slide
from dropspin.scenarios.truths.coulomb_turn import coulomb_turn
from dropspin.scenarios.truths.flight import flight
from dropspin.scenarios.truths.impact_laws import LAWS, Law
from dropspin.scenarios.truths.rocking import rocking
from dropspin.scenarios.truths.rolling import rolling
from dropspin.scenarios.truths.slipping import slipping
from dropspin.scenarios.truths.top import top
from dropspin.scenarios.truths.truth import Impact, Truth

__all__ = ["LAWS", "Impact", "Law", "Truth", "truth_for"]


@lru_cache(maxsize=128)  # a run, its tables and its plots all need it, and the solution of a tumble takes a second
def truth_for(scene: Scenario, law: Law | None = None) -> Truth | None:
    """Return the exact motion of a scene, or None if no exact solution is known.

    Args:
        scene: The scene.
        law: An impact law to use instead of that of the floor, for balls and for bodies that strike with a corner or an edge. An engine
            that implements
            this law must converge to this solution.

    Returns:
        A callable of times [s] that returns a `Trajectory`, with the impacts in `events` and the end of its validity in `horizon`.

    Raises:
        DropspinError: The argument is not a `Scenario`.
    """
    if not isinstance(scene, Scenario):
        raise DropspinError(f"scene: got {scene!r} ({type(scene).__name__}); give a Scenario, as load() returns it.")
    if law is not None:
        return corner_impact(scene, law)
    for problem in (flight, bounce_ladder, rocking, slipping, top, corner_impact, coulomb_slide, rolling, coulomb_turn):
        truth = problem(scene)
        if truth is not None:
            return truth
    return None
