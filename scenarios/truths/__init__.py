"""Exact solutions ("truths"). Each file solves one problem and states its formula, its source and its range of validity.

`measured` is not an exact solution. `reference_for` returns it for a scene with a recording; `truth_for` does not.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from dropspin.scenarios.errors import DropspinError
from dropspin.scenarios.model import TOUCHING, Scenario
from dropspin.scenarios.state import VELOCITY
from dropspin.scenarios.surfaces import Floor
from dropspin.scenarios.truths.bounce import bounce_ladder
from dropspin.scenarios.truths.corner_impact import corner_impact
from dropspin.scenarios.truths.coulomb_slide import coulomb_slide
from dropspin.scenarios.truths.coulomb_turn import coulomb_turn
from dropspin.scenarios.truths.flight import flight
from dropspin.scenarios.truths.impact_laws import FRICTION_LAWS, LAWS, Law, law_of
from dropspin.scenarios.truths.measured import measured
from dropspin.scenarios.truths.point_contact import point_contact
from dropspin.scenarios.truths.rocking import rocking
from dropspin.scenarios.truths.rolling import rolling
from dropspin.scenarios.truths.slipping import slipping
from dropspin.scenarios.truths.truth import Impact, Truth
from dropspin.scenarios.truths.until_obstacle import until_near

__all__ = ["LAWS", "Impact", "Law", "Truth", "other_laws", "reference_for", "truth_for"]

Solution = Callable[[Scenario, Floor], Truth | None]
ON_FLOOR: tuple[Solution, ...] = (
    bounce_ladder,
    rocking,
    slipping,
    corner_impact,
    coulomb_slide,
    rolling,
    coulomb_turn,
    point_contact,
)
"""The functions that solve scenes with a floor and without damping. Each returns None for a scene that it does not cover; the first
solution is used.
"""
SAME_IMPULSE = 1e-6
"""Largest difference of two impulses, relative to the momentum, that counts as rounding: 1e-13 in the integration, amplified by impacts."""


@lru_cache(maxsize=128)  # a run, its tables and its plots all need it, and solving a tumbling motion takes a second
def truth_for(scene: Scenario, law: Law | None = None) -> Truth | None:
    """Return the exact motion of a scene, or None if no exact solution is known.

    Args:
        scene: The scene.
        law: An impact law to use instead of that of the floor, for balls and for bodies that strike with a corner or an edge. An engine
            that implements this law converges to the returned solution.

    Returns:
        A function of times [s] that returns a `Trajectory`. Its attribute `events` has the impacts, and `horizon` the time up to which it
        is valid.

    Raises:
        DropspinError: The argument is not a `Scenario`.
    """
    if not isinstance(scene, Scenario):
        raise DropspinError(f"scene: got {scene!r} ({type(scene).__name__}); give a Scenario, as load() returns it.")
    floor = scene.floor
    if floor is None:
        return flight(scene) if law is None else None
    if scene.damping is not None:
        return None
    if law is None and not scene.has_edges_or_walls:
        return next(filter(None, (problem(scene, floor) for problem in ON_FLOOR)), None)
    if scene.has_edges_or_walls and scene.clearance < -TOUCHING * scene.body.size:
        return None  # it starts beside or below the floor
    struck = corner_impact(scene, floor, law)
    if not scene.has_edges_or_walls:
        return struck
    # Of the solution for impacts and those for an endless floor, the one that is valid longest.
    truths = [struck and until_near(scene, struck, walls=False)]
    if law is None:
        others = (problem(scene, floor) for problem in ON_FLOOR if problem is not corner_impact)
        truths += [until_near(scene, other) for other in others if other is not None]
    return max(filter(None, truths), key=lambda truth: truth.horizon, default=None)


def exact_solution(scene: Scenario) -> Truth:
    """The exact solution of a scene that has one."""
    truth = truth_for(scene)
    assert truth is not None, scene.name
    return truth


def reference_for(scene: Scenario) -> Truth | None:
    """Return the motion with which motions of a scene are compared: its exact solution, or the first toss of its recording.

    Returns:
        As `truth_for`; `is_exact` is False for a toss.
    """
    return truth_for(scene) if scene.recording is None else measured(scene.recording, scene.recording.tosses[0])


def other_laws(scene: Scenario) -> dict[Law, Truth]:
    """The exact solutions under the other laws of impacts with friction, if an impact differs from that under the scene's law.

    If the slip turns during an impact, the laws are different models, and their difference is not an error.

    Returns:
        The solutions, by law. Empty if no impact has a coefficient of friction, if the scene has walls, or if the laws agree.
    """
    truth = truth_for(scene)
    if truth is None or not truth.events or scene.wall is not None or (own := law_of(scene)) not in FRICTION_LAWS:
        return {}
    truths = {law: truth_for(scene, law) for law in FRICTION_LAWS if law != own}
    return {law: other for law, other in truths.items() if other is not None and _has_other_impulses(truth, other)}


def _has_other_impulses(truth: Truth, other: Truth) -> bool:
    """Whether two solutions have different impulses in an impact that both have."""
    return any(
        np.linalg.norm(first.after[VELOCITY] - second.after[VELOCITY]) > SAME_IMPULSE * np.linalg.norm(first.before[VELOCITY])
        for first, second in zip(truth.events, other.events, strict=False)
    )
