"""The quantities that sources publish, each as the source defines it, of the states that an engine reports.

No state is synchronised: sources take velocities as they are beside positions, although under semi-implicit Euler they lag by half a step.
"""

import math
import re
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios import Scenario, Trajectory
from dropspin.scenarios.errors import UnknownName
from dropspin.scenarios.mechanics import angular_momentum, energy, kinetic_energy

Array = NDArray[np.float64]
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
        return _at(at[1], float(at[2]))
    if name not in QUANTITIES:
        raise UnknownName("quantity", name, QUANTITIES)
    return QUANTITIES[name]


def _at(what: str, time: float) -> Quantity:
    def value(scene: Scenario, motion: Trajectory) -> float:
        row = int(np.argmin(np.abs(motion.t - time)))
        return float(motion.position[row, 1] if what == "height" else np.linalg.norm(motion.velocity[row]))

    return value


def _momentum_errors(scene: Scenario, motion: Trajectory) -> Array:
    """|L - L₀| [kg m²/s], shape (n,)."""
    momentum = angular_momentum(scene, motion)
    errors: Array = np.linalg.norm(momentum - momentum[0], axis=1)
    return errors


def largest_momentum_error(scene: Scenario, motion: Trajectory) -> float:
    """The largest |L - L₀|/|L₀|."""
    return float(_momentum_errors(scene, motion).max() / np.linalg.norm(angular_momentum(scene, motion[:1])))


def last_momentum_error(scene: Scenario, motion: Trajectory) -> float:
    """|L - L₀|/|L₀| at the end."""
    return float(_momentum_errors(scene, motion)[-1] / np.linalg.norm(angular_momentum(scene, motion[:1])))


def last_momentum_change(scene: Scenario, motion: Trajectory) -> float:
    """|L - L₀| at the end [kg m²/s]."""
    return float(_momentum_errors(scene, motion)[-1])


def largest_energy_error(scene: Scenario, motion: Trajectory) -> float:
    """The largest |E - E₀|/E₀ of kinetic and potential energy, which is 0 at the initial position."""
    total = energy(scene, motion, synchronised=False)
    return float(np.abs(total - total[0]).max() / total[0])


def largest_position_error(scene: Scenario, motion: Trajectory) -> float:
    """The largest distance from the parabola x₀ + v₀ t + g t²/2 [m]."""
    t = motion.t[:, None]
    parabola = motion.position[0] + motion.velocity[0] * t + 0.5 * scene.acceleration * t**2
    return float(np.linalg.norm(motion.position - parabola, axis=1).max())


def last_energy_ratio(scene: Scenario, motion: Trajectory) -> float:
    """Kinetic energy at the end over that at the start."""
    kinetic = kinetic_energy(scene, motion)
    return float(kinetic[-1] / kinetic[0])


def largest_energy_ratio(scene: Scenario, motion: Trajectory) -> float:
    """The largest kinetic energy after any step over that at the start."""
    kinetic = kinetic_energy(scene, motion)
    return float(kinetic[1:].max() / kinetic[0])


def mean_square_energy_error(scene: Scenario, motion: Trajectory) -> float:
    """The mean of (E - E₀)² over the states before each step [J²], E the energy of all balls."""
    total = BALLS * energy(scene, motion, synchronised=False)
    return float(np.mean((total[:-1] - total[0]) ** 2))


def rebound_height(scene: Scenario, motion: Trajectory) -> float:
    """The largest height of a ball's lowest point after its first lowest position [m]."""
    height = motion.position[:, 1] - scene.body.rounding
    turns = np.flatnonzero((height[1:-1] < height[:-2]) & (height[1:-1] <= height[2:]))
    return float(height[turns[0] + 1 :].max()) if len(turns) else math.nan


def distance_along_z(scene: Scenario, motion: Trajectory) -> float:
    """The distance moved along z [m]."""
    return float(motion.position[-1, 2] - motion.position[0, 2])


def last_rotation(scene: Scenario, motion: Trajectory) -> float:
    """The angle between the first and the last orientation [rad]."""
    cosine = abs(float(motion.orientation[0] @ motion.orientation[-1]))
    return 2.0 * math.acos(min(cosine, 1.0))


QUANTITIES: Mapping[str, Quantity] = {
    "distance along z [m]": distance_along_z,
    "max |ΔL|/|L₀|": largest_momentum_error,
    "max |ΔE|/E₀": largest_energy_error,
    "max |Δx| [m]": largest_position_error,
    "|ΔL|/|L₀| at the end": last_momentum_error,
    "|ΔL| at the end [kg m²/s]": last_momentum_change,
    "E/E₀ at the end": last_energy_ratio,
    "max E/E₀": largest_energy_ratio,
    "mean (ΔE)² [J²]": mean_square_energy_error,
    "rebound height [m]": rebound_height,
    "rotation [rad]": last_rotation,
}
