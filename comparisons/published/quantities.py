"""The quantities that sources publish, each as the source defines it, of the states that an engine reports.

No state is synchronised: sources take velocities as they are beside positions, although under semi-implicit Euler they lag by half a step.
"""

import math
import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from dropspin.scenarios import Scenario, Trajectory
from dropspin.scenarios.errors import verify_known
from dropspin.scenarios.mechanics import angular_momentum, energy, kinetic_energy
from dropspin.scenarios.state import Array

Quantity = Callable[[Scenario, Trajectory], float]
AT = re.compile(r"(height|speed) at ([\d.]+) s")
BALLS = 49
"""Balls of SimBenchmark's bouncing test, which do not touch each other and move alike; their energies add up."""


def quantity(name: str) -> Quantity:
    """The quantity of a name; `height at T s` [m] and `speed at T s` [m/s] exist for every time T of a step.

    Raises:
        UnknownName: There is none of that name.
    """
    if at := AT.fullmatch(name):
        return partial(_at, at[1], float(at[2]))
    verify_known("quantity", [name], QUANTITIES)
    return lambda scene, motion: float(QUANTITIES[name](scene, motion))


def _at(name: str, time: float, _: Scenario, motion: Trajectory) -> float:
    row = int(np.argmin(np.abs(motion.t - time)))
    return float(motion.position[row, 1] if name == "height" else np.linalg.norm(motion.velocity[row]))


def _momentum_errors(scene: Scenario, motion: Trajectory) -> Array:
    """|L - L₀| [kg m²/s], shape (n,)."""
    momentum = angular_momentum(scene, motion)
    return np.asarray(np.linalg.norm(momentum - momentum[0], axis=1))


def _momentum(scene: Scenario, motion: Trajectory) -> Any:
    """|L₀| [kg m²/s]."""
    return np.linalg.norm(angular_momentum(scene, motion)[0])


def _energy(scene: Scenario, motion: Trajectory) -> Array:
    """E [J], kinetic and potential, which is 0 at the initial position, shape (n,)."""
    return energy(scene, motion, synchronised=False)


def _kinetic_ratios(scene: Scenario, motion: Trajectory) -> Array:
    """Kinetic energy over that at the start, shape (n,)."""
    kinetic = kinetic_energy(scene, motion)
    return kinetic / kinetic[0]


def _from_parabola(scene: Scenario, motion: Trajectory) -> Array:
    """Distances from the parabola x₀ + v₀ t + g t²/2 [m], shape (n,)."""
    t, x = motion.t[:, None], motion.position
    return np.asarray(np.linalg.norm(x - (x[0] + motion.velocity[0] * t + 0.5 * scene.acceleration * t**2), axis=1))


def _mean_square_energy_error(scene: Scenario, motion: Trajectory) -> Any:
    """The mean (ΔE)² of the states before each step, of all balls [J²]."""
    total = BALLS * _energy(scene, motion)
    return np.mean((total[:-1] - total[0]) ** 2)


def _rebound_height(scene: Scenario, motion: Trajectory) -> float:
    """The largest height of a ball's lowest point after its first lowest position [m]."""
    height = motion.position[:, 1] - scene.body.resting_height
    turns = np.flatnonzero((height[1:-1] < height[:-2]) & (height[1:-1] <= height[2:]))
    return float(height[turns[0] + 1 :].max()) if len(turns) else math.nan


def _last_rotation(scene: Scenario, motion: Trajectory) -> float:
    """The angle between the first and the last orientation [rad]."""
    return 2.0 * math.acos(min(abs(float(motion.orientation[0] @ motion.orientation[-1])), 1.0))


QUANTITIES: Mapping[str, Callable[[Scenario, Trajectory], Any]] = {
    "distance along z [m]": lambda _, motion: motion.position[-1, 2] - motion.position[0, 2],
    "max |ΔL|/|L₀|": lambda *run: _momentum_errors(*run).max() / _momentum(*run),
    "max |ΔE|/E₀": lambda *run: np.abs(_energy(*run) - _energy(*run)[0]).max() / _energy(*run)[0],
    "max |Δx| [m]": lambda *run: _from_parabola(*run).max(),
    "|ΔL|/|L₀| at the end": lambda *run: _momentum_errors(*run)[-1] / _momentum(*run),
    "|ΔL| at the end [kg m²/s]": lambda *run: _momentum_errors(*run)[-1],
    "E/E₀ at the end": lambda *run: _kinetic_ratios(*run)[-1],
    "max E/E₀": lambda *run: _kinetic_ratios(*run)[1:].max(),  # after any step
    "mean (ΔE)² [J²]": _mean_square_energy_error,
    "rebound height [m]": _rebound_height,
    "rotation [rad]": _last_rotation,
}
