"""The starts of an ensemble: what is compared where single trajectories are too sensitive to be."""

import math

import numpy as np
from numpy.typing import NDArray

from scenarios.model import Scenario
from scenarios.rotations import about, multiply

Array = NDArray[np.float64]

GRID = 4001


def members(scene: Scenario) -> list[Scenario]:
    """The scene from each start of its ensemble: the same ones for every engine and step.

    Rotations by up to the angle a are drawn evenly: the axis anywhere on the sphere, the angle with density 1 - cos θ, as the rotations'
    own measure has it (R. E. Miles, Biometrika 52 (1965), 636).

    Raises:
        ValueError: The scene has no ensemble.
    """
    if scene.ensemble is None:
        raise ValueError(f"scene {scene.name!r} has no [ensemble]")
    spread, random = scene.ensemble, np.random.default_rng(scene.ensemble.seed)
    axes = random.normal(size=(spread.size, 3))
    angles = _angles(random.random(spread.size), spread.turn)
    rates = random.uniform(-1.0, 1.0, size=(spread.size, 6)) * np.array([*spread.velocity, *spread.angular_velocity])
    starts = np.tile(scene.initial_state, (spread.size, 1))
    for start, axis, angle in zip(starts, axes, angles, strict=True):
        start[3:7] = multiply(about(axis / np.linalg.norm(axis), np.array(angle)), start[3:7])
    starts[:, 7:13] += rates
    drawn = [scene.starting_at(start) for start in starts]
    return [member.starting_at(_as_high(member, scene)) for member in drawn] if scene.floor is not None else drawn


def _angles(shares: Array, largest: float) -> Array:
    """The angles [rad] below which so large a share of the rotations by up to the largest lies."""
    if largest == 0.0:
        return np.zeros_like(shares)
    # Even in the cube root, because the share rises as θ³ from 0.
    grid = largest * np.linspace(0.0, 1.0, GRID)
    below = np.array([angle - math.sin(angle) for angle in grid])
    return np.interp(np.cbrt(shares), np.cbrt(below / below[-1]), grid)


def _as_high(member: Scenario, scene: Scenario) -> Array:
    """The member's start, lifted or lowered until it is as far above the floor as the scene's own."""
    start = member.initial_state
    start[1] += scene.clearance - member.clearance
    return start
