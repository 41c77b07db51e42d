"""The random initial states of an ensemble, for scenes whose single trajectories are too sensitive to be compared."""

import hashlib
import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios.bodies.surface import clearances
from dropspin.scenarios.field_types import unit
from dropspin.scenarios.model import Ensemble, Scenario
from dropspin.scenarios.rotations import about, multiply
from dropspin.scenarios.state import ORIENTATION, RATES, Array

DRAWS_PER_BLOCK = 1024  # generated together, however many of them are requested
GRID_SIZE = 4001  # angles at which the distribution is tabulated
SERIES_BELOW = 0.1  # rad; below it θ - sin θ is computed by its series
RATE_DRAWS = tuple(f"{kind} {axis}" for kind in ("velocity", "angular velocity") for axis in "xyz")


def members(scene: Scenario) -> list[Scenario]:
    """The scene with each initial state of its ensemble; the initial states are the same for every engine and time step.

    Rotations up to the angle `turn` are uniform in the Haar measure: the axis is uniform on the sphere and the angle has the density
    1 - cos θ (R. E. Miles, Biometrika 52 (1965), 636).

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
    starts[:, RATES] += rates
    for start, axis, angle in zip(starts, axes, angles, strict=True):
        start[ORIENTATION] = multiply(about(axis / np.linalg.norm(axis), np.array(angle)), start[ORIENTATION])
        if scene.floor is not None:
            start[1] += scene.clearance - scene.starting_at(start).clearance
    return [scene.starting_at(start) for start in starts]


def spread_start(scene: Scenario, number: int) -> Array:
    """The initial state with a given number from the distribution of a scene's ensemble, shape (13,).

    The distribution is that of `members`, but an initial state depends only on its number, not on the number of initial states.

    Raises:
        ValueError: The scene has no ensemble.
    """
    if scene.ensemble is None:
        raise ValueError(f"scene {scene.name!r} has no [ensemble]")
    body, has_floor = scene.body, scene.floor is not None
    states, numbers = scene.initial_state[np.newaxis], np.array([number])
    return spread_starts(states, scene.ensemble, numbers, body.vertices, body.semi_axes, has_floor)[0]


def spread_starts(states: Array, spread: Ensemble, numbers: NDArray[np.int64], vertices: Array, semi_axes: Array, floor: bool) -> Array:
    """The initial states that `spread_start` returns, for many scenes that share an ensemble.

    Args:
        states: The initial states of the scenes, shape (B, 13).
        spread: The ensemble.
        numbers: The number of each initial state, shape (B,).
        vertices: Vertices of one body, shape (n, 3), or of each, shape (B, n, 3) [m].
        semi_axes: Semi-axes about the vertices of one body, shape (3,), or of each, shape (B, 3) [m].
        floor: Whether there is a floor; if so, each initial state has the clearance of its scene.
    """
    height, around, share, *sideways = (uniform(spread.seed, name, numbers) for name in ("axis height", "axis angle", "share", *RATE_DRAWS))
    starts = states.copy()
    starts[:, RATES] += (2.0 * np.stack(sideways, axis=1) - 1.0) * np.array([*spread.velocity, *spread.angular_velocity])
    if spread.turn > 0.0:
        # By `math`, because the last bit of NumPy's functions may depend on the length of the array.
        draws = zip(height.tolist(), around.tolist(), _angles(share, spread.turn).tolist(), strict=True)
        turns = np.array([_turn(*draw) for draw in draws])
        starts[:, ORIENTATION] = [unit(tuple(q)) for q in multiply(turns, states[:, ORIENTATION]).tolist()]
    if floor:
        starts[:, 1] += clearances(states, vertices, semi_axes) - clearances(starts, vertices, semi_axes)
    return starts


def _turn(height: float, around: float, angle: float) -> list[float]:
    """The rotation by an angle [rad] about a uniformly distributed axis, from two uniform draws (the height of the axis is uniform)."""
    up = 2.0 * height - 1.0
    sideways, half = math.sqrt(1.0 - up * up), 0.5 * angle
    axis = sideways * math.cos(2.0 * math.pi * around), up, sideways * math.sin(2.0 * math.pi * around)
    return [*(math.sin(half) * component for component in axis), math.cos(half)]


def _angles(shares: Array, largest: float) -> Array:
    """Quantiles of the angle [rad] of uniform rotations by at most the largest angle, for probabilities in [0, 1]."""
    if largest == 0.0:
        return np.zeros_like(shares)
    shares_below, grid = _shares(largest)
    return np.interp(np.cbrt(shares), shares_below, grid)


@cache
def _shares(largest: float) -> tuple[Array, Array]:
    """Cube roots of the cumulative distribution, and the angles; the cube root is nearly linear in θ."""
    grid = largest * np.linspace(0.0, 1.0, GRID_SIZE)
    below = np.array([_angle_minus_sine(angle, largest) if largest < SERIES_BELOW else angle - math.sin(angle) for angle in grid])
    return np.cbrt(below / below[-1]), grid


def _angle_minus_sine(angle: float, unit: float) -> float:
    """Θ - sin θ in units of unit³/6, by its series, because the difference would lose all digits."""
    return (angle / unit) ** 3 * (1.0 - angle**2 / 20.0 * (1.0 - angle**2 / 42.0 * (1.0 - angle**2 / 72.0)))


def uniform(seed: int, purpose: str, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
    """The draws with these numbers, uniform over [0, 1), shape (len(numbers),).

    A draw depends on the seed, on the purpose of the draws and on its number, but not on how many there are. They come from a counter-based
    generator (Philox-4x64; J. K. Salmon et al., SC 2011), which computes any draw without the previous ones.
    """
    key = int.from_bytes(hashlib.sha256(f"{seed} {purpose}".encode()).digest()[:16], "little")
    drawn = np.empty(len(numbers))
    for block in np.unique(numbers // DRAWS_PER_BLOCK):
        counting = np.random.Philox(key=key)
        counting.advance(int(block) * DRAWS_PER_BLOCK // 4)  # four draws to a count
        here = numbers // DRAWS_PER_BLOCK == block
        drawn[here] = np.random.Generator(counting).random(DRAWS_PER_BLOCK)[numbers[here] - block * DRAWS_PER_BLOCK]
    return drawn
