"""The time up to which a body stays away from walls and from the end of the floor, so that a solution without them holds."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from dropspin.scenarios.model import Scenario
from dropspin.scenarios.state import POSITION, VELOCITY, Array
from dropspin.scenarios.truths.truth import Truth

SAMPLES = 2001
FASTER = 2.0
"""Speeds between the samples are at most this multiple of the largest one at a sample, plus what gravity adds in between."""


def until_near(scene: Scenario, truth: Truth, *, walls: bool = True) -> Truth | None:
    """A solution up to the time at which the body may touch a wall, or may reach the end of the floor; None if it may do so at the start.

    Between two samples the body moves along the normal of a plane by at most the largest speed along it times the interval: it is away from
    the plane if the sphere about it that contains it is further away than that.

    Args:
        scene: The scene.
        truth: The solution on a floor without an end and, if `walls`, without walls.
        walls: Whether the solution ends near walls; False for a solution that includes impacts with walls.
    """
    end = min(scene.duration, truth.horizon)
    times = np.linspace(0.0, end, SAMPLES)
    states = truth.states(times)
    interval = times[1]
    struck = [state[VELOCITY] for event in truth.events for state in (event.before, event.after)]
    velocities, away = np.vstack([states[:, VELOCITY], *struck]), np.full(SAMPLES, True)
    for point, normal in _planes(scene, walls):
        fastest = FASTER * float(np.abs(velocities @ normal).max()) + abs(float(scene.acceleration @ normal)) * interval
        away &= (states[:, POSITION] - point) @ normal - scene.body.size > fastest * interval
    if away.all():
        return truth
    horizon = float(times[max(int(np.argmin(away)) - 1, 0)])
    if horizon == 0.0:
        return None
    events = tuple(event for event in truth.events if event.time <= horizon)
    return replace(truth, events=events, horizon=horizon, ends="the body comes near a wall or the end of the floor")


def _planes(scene: Scenario, walls: bool) -> Iterator[tuple[Array, Array]]:
    """A point and the normal of each plane that the body must not touch; above the end of the floor these are vertical."""
    assert scene.floor is not None
    for wall in (scene.wall or ()) if walls else ():
        yield np.array(wall.point), np.array(wall.normal)
    for extent, axis in zip(scene.floor.half_extents or (), np.eye(3)[[0, 2]], strict=False):
        yield from ((extent * outward, -outward) for outward in (axis, -axis))
