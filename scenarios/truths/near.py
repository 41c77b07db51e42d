"""The time up to which a body stays away from walls and from the end of the floor, so that a solution without them holds."""

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

    Between two samples the body moves by at most the largest speed times the interval: it is away from a plane if the sphere about it that
    contains it is further away than that.

    Args:
        scene: The scene.
        truth: The solution on a floor without an end and, if `walls`, without walls.
        walls: Whether the solution ends near walls; False for a solution that includes impacts with walls.
    """
    end = min(scene.duration, truth.horizon)
    times = np.linspace(0.0, end, SAMPLES)
    states = truth.states(times)
    interval = times[1]
    fastest = float(np.linalg.norm(states[:, VELOCITY], axis=1).max()) * FASTER + float(np.linalg.norm(scene.acceleration)) * interval
    away = _room(scene, states, walls) > fastest * interval
    if away.all():
        return truth
    horizon = float(times[max(int(np.argmin(away)) - 1, 0)])
    if horizon == 0.0:
        return None
    events = tuple(event for event in truth.events if event.time <= horizon)
    return replace(truth, events=events, horizon=horizon, ends="the body comes near a wall or the end of the floor")


def _room(scene: Scenario, states: Array, walls: bool) -> Array:
    """Distance of the sphere about the centre of mass that contains the body from the planes that the body must not touch [m]."""
    assert scene.floor is not None
    position, room = states[:, POSITION], np.full(len(states), np.inf)
    for wall in (scene.wall or ()) if walls else ():
        room = np.minimum(room, (position - wall.point) @ wall.normal)
    if scene.floor.half_extents is not None:
        room = np.minimum(room, (np.array(scene.floor.half_extents) - np.abs(position[:, [0, 2]])).min(axis=1))
    return room - scene.body.size
