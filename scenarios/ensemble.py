"""The starts of an ensemble: what is compared where single trajectories are too sensitive to be."""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from scenarios.drawing import uniform
from scenarios.model import Ensemble, Scenario, unit
from scenarios.rotations import about, multiply, rotate

Array = NDArray[np.float64]

GRID = 4001
SMALL_TURN = 0.1  # rad


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


def spread_start(scene: Scenario, number: int) -> Array:
    """One of endlessly many starts from the spread of a scene's ensemble, by its number, shape (13,).

    Drawn as those of `members` are, but each for itself: what it is does not depend on how many there are.

    Raises:
        ValueError: The scene has no ensemble.
    """
    if scene.ensemble is None:
        raise ValueError(f"scene {scene.name!r} has no [ensemble]")
    body = scene.body
    return spread_starts(
        scene.initial_state[np.newaxis], scene.ensemble, np.array([number]), body.vertices, body.rounding, scene.floor is not None
    )[0]


def spread_starts(
    states: Array, spread: Ensemble, numbers: NDArray[np.int64], vertices: Array, rounding: float | Array, floor: bool
) -> Array:
    """The same for many scenes at once that share their ensemble.

    Args:
        states: The scenes' own starts, shape (B, 13).
        spread: Their ensemble.
        numbers: The number of each's start, shape (B,).
        vertices: Of one body, shape (n, 3), or of each, shape (B, n, 3) [m].
        rounding: Of its vertices [m], or of each body's, shape (B,).
        floor: Whether there is one; a start is then as far above it as the scene's own.
    """
    height, around, share, *sideways = (uniform(spread.seed, name, numbers) for name in ("axis height", "axis angle", "share", *RATES))
    found = states.copy()
    found[:, 7:13] += (2.0 * np.stack(sideways, axis=1) - 1.0) * np.array([*spread.velocity, *spread.angular_velocity])
    if spread.turn > 0.0:
        # By `math`, whose last bit does not depend on the length of an array as NumPy's may.
        draws = zip(height.tolist(), around.tolist(), _angles(share, spread.turn).tolist(), strict=True)
        turns = np.array([_turn(*draw) for draw in draws])
        found[:, 3:7] = [unit(tuple(q)) for q in multiply(turns, states[:, 3:7]).tolist()]
    if floor:
        found[:, 1] += clearances(states, vertices, rounding) - clearances(found, vertices, rounding)
    return found


RATES = tuple(f"{kind} {axis}" for kind in ("velocity", "angular velocity") for axis in "xyz")


def _turn(height: float, around: float, angle: float) -> list[float]:
    """The rotation by an angle [rad] about an axis that two draws put anywhere on the sphere (Archimedes: its height is even)."""
    up = 2.0 * height - 1.0
    sideways, half = math.sqrt(1.0 - up * up), 0.5 * angle
    axis = sideways * math.cos(2.0 * math.pi * around), up, sideways * math.sin(2.0 * math.pi * around)
    return [*(math.sin(half) * component for component in axis), math.cos(half)]


def clearances(states: Array, vertices: Array, rounding: float | Array) -> Array:
    """Heights of the bodies' lowest points [m], shape (B,); the arguments of `spread_starts`."""
    heights = rotate(states[:, np.newaxis, 3:7], vertices)[..., 1]
    return states[:, 1] + heights.min(axis=1) - rounding


def _angles(shares: Array, largest: float) -> Array:
    """The angles [rad] below which so large a share of the rotations by up to the largest lies."""
    if largest == 0.0:
        return np.zeros_like(shares)
    shares_below, grid = _shares(largest)
    return np.interp(np.cbrt(shares), shares_below, grid)


@cache
def _shares(largest: float) -> tuple[Array, Array]:
    """The cube roots of shares, and the angles they belong to; even in the cube root, because the share rises as θ³ from 0."""
    grid = largest * np.linspace(0.0, 1.0, GRID)
    below = np.array([_angle_minus_sine(angle, largest) if largest < SMALL_TURN else angle - math.sin(angle) for angle in grid])
    return np.cbrt(below / below[-1]), grid


def _angle_minus_sine(angle: float, unit: float) -> float:
    """In units of unit³/6, by the series: the difference would lose all digits."""
    return (angle / unit) ** 3 * (1.0 - angle**2 / 20.0 * (1.0 - angle**2 / 42.0 * (1.0 - angle**2 / 72.0)))


def _as_high(member: Scenario, scene: Scenario) -> Array:
    """The member's start, lifted or lowered until it is as far above the floor as the scene's own."""
    start = member.initial_state
    start[1] += scene.clearance - member.clearance
    return start
