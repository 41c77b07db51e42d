"""The quantities that sources publish, each as the source defines it, of the states that an engine reports.

No state is synchronised: sources take velocities as they are beside positions, although under semi-implicit Euler they lag by half a step.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios import Scenario, Trajectory
from dropspin.scenarios.errors import verify_known
from dropspin.scenarios.mechanics import angular_momentum, energy, kinetic_energy

Array = NDArray[np.float64]
Quantity = Callable[[Scenario, Trajectory], float]
AT = re.compile(r"(height|speed) at ([\d.]+) s")
BALLS = 49
"""Balls of SimBenchmark's bouncing test, which do not touch each other and move alike; their energies add up."""


@dataclass(frozen=True)
class _Run:
    """What quantities are made of; a subscript 0 is the start."""

    scene: Scenario
    motion: Trajectory

    @property
    def momentum(self) -> Array:
        """L [kg m²/s], shape (n, 3)."""
        return angular_momentum(self.scene, self.motion)

    @property
    def momentum_errors(self) -> Array:
        """|L - L₀| [kg m²/s], shape (n,)."""
        momentum = self.momentum
        return np.asarray(np.linalg.norm(momentum - momentum[0], axis=1))

    @property
    def energy(self) -> Array:
        """E [J], kinetic and potential, which is 0 at the initial position, shape (n,)."""
        return energy(self.scene, self.motion, synchronised=False)

    @property
    def kinetic_ratios(self) -> Array:
        """Kinetic energy over that at the start, shape (n,)."""
        kinetic = kinetic_energy(self.scene, self.motion)
        return kinetic / kinetic[0]

    @property
    def from_parabola(self) -> Array:
        """Vectors from the parabola x₀ + v₀ t + g t²/2 [m], shape (n, 3)."""
        t, motion = self.motion.t[:, None], self.motion
        return motion.position - (motion.position[0] + motion.velocity[0] * t + 0.5 * self.scene.acceleration * t**2)


def quantity(name: str) -> Quantity:
    """The quantity of a name; `height at T s` [m] and `speed at T s` [m/s] exist for every time T of a step.

    Raises:
        UnknownName: There is none of that name.
    """
    if at := AT.fullmatch(name):
        return _at(at[1], float(at[2]))
    verify_known("quantity", [name], QUANTITIES)
    return lambda scene, motion: float(QUANTITIES[name](_Run(scene, motion)))


def _at(what: str, time: float) -> Quantity:
    def value(scene: Scenario, motion: Trajectory) -> float:
        row = int(np.argmin(np.abs(motion.t - time)))
        return float(motion.position[row, 1] if what == "height" else np.linalg.norm(motion.velocity[row]))

    return value


def _rebound_height(run: _Run) -> float:
    """The largest height of a ball's lowest point after its first lowest position [m]."""
    height = run.motion.position[:, 1] - run.scene.body.rounding
    turns = np.flatnonzero((height[1:-1] < height[:-2]) & (height[1:-1] <= height[2:]))
    return float(height[turns[0] + 1 :].max()) if len(turns) else math.nan


def _last_rotation(run: _Run) -> float:
    """The angle between the first and the last orientation [rad]."""
    cosine = abs(float(run.motion.orientation[0] @ run.motion.orientation[-1]))
    return 2.0 * math.acos(min(cosine, 1.0))


QUANTITIES: Mapping[str, Callable[[_Run], Any]] = {
    "distance along z [m]": lambda run: run.motion.position[-1, 2] - run.motion.position[0, 2],
    "max |ΔL|/|L₀|": lambda run: run.momentum_errors.max() / np.linalg.norm(run.momentum[0]),
    "max |ΔE|/E₀": lambda run: np.abs(run.energy - run.energy[0]).max() / run.energy[0],
    "max |Δx| [m]": lambda run: np.linalg.norm(run.from_parabola, axis=1).max(),
    "|ΔL|/|L₀| at the end": lambda run: run.momentum_errors[-1] / np.linalg.norm(run.momentum[0]),
    "|ΔL| at the end [kg m²/s]": lambda run: run.momentum_errors[-1],
    "E/E₀ at the end": lambda run: run.kinetic_ratios[-1],
    "max E/E₀": lambda run: run.kinetic_ratios[1:].max(),  # after any step
    "mean (ΔE)² [J²]": lambda run: np.mean((BALLS * run.energy[:-1] - BALLS * run.energy[0]) ** 2),  # of the states before each step
    "rebound height [m]": _rebound_height,
    "rotation [rad]": _last_rotation,
}
