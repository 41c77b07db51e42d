"""Quantities at each state of a motion: heights, energies, angular momentum, and whether something other than gravity acts."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from dropspin.comparisons.measuring.contact_runs import Mask
from dropspin.scenarios import Scenario, Trajectory
from dropspin.scenarios.mechanics import Components, angular_momentum, energy, kinetic_energy, lowest_height, scalar_product
from dropspin.scenarios.model import TOUCHING
from dropspin.scenarios.rotations import length
from dropspin.scenarios.state import Array


class StatesOfMany(NamedTuple):
    """Quantities at each state of many motions; rows after the last one of a shorter motion repeat its last state.

    Attributes:
        height: Height of the centre of mass [m], shape (B, n).
        vertical_velocity: Of the centre of mass [m/s], shape (B, n).
        kinetic_energy: [J], shape (B, n).
        energy: Kinetic plus potential energy, velocity synchronised with position [J], shape (B, n).
        lowest_height: Height of the body's lowest point above the floor [m], shape (B, n). It may be inf where no point is below the floor,
            except at the rows of a step in `touching` and of the step before it.
        touching: For each step, whether gravity and damping do not explain the change of the velocity (`is_touching`), shape (B, n - 1).
    """

    height: Array
    vertical_velocity: Array
    kinetic_energy: Array
    energy: Array
    lowest_height: Array
    touching: Mask


@dataclass(frozen=True, eq=False)
class States:
    """Quantities at each state of one motion of a scene, each computed once."""

    scene: Scenario
    motion: Trajectory

    @property
    def height(self) -> Array:
        """Height of the centre of mass [m], shape (n,)."""
        return self.motion.position[:, 1]

    @property
    def vertical_velocity(self) -> Array:
        """Of the centre of mass [m/s], shape (n,)."""
        return self.motion.velocity[:, 1]

    @cached_property
    def angular_momentum(self) -> Array:
        """About the centre of mass, world frame [kg m²/s], shape (n, 3)."""
        return angular_momentum(self.scene, self.motion)

    @cached_property
    def largest_angular_momentum(self) -> float:
        """The length of the largest [kg m²/s]."""
        return float(np.max(length(self.angular_momentum)))

    @cached_property
    def kinetic_energy(self) -> Array:
        """[J], shape (n,)."""
        return kinetic_energy(self.scene, self.motion)

    @cached_property
    def energy(self) -> Array:
        """Kinetic plus potential energy, velocity synchronised with position [J], shape (n,)."""
        return energy(self.scene, self.motion, kinetic=self.kinetic_energy)

    @cached_property
    def energy_as_stored(self) -> Array:
        """Kinetic plus potential energy, with velocities as stored [J], shape (n,)."""
        return energy(self.scene, self.motion, synchronised=False, kinetic=self.kinetic_energy)

    @cached_property
    def lowest_height(self) -> Array:
        """Height of the body's lowest point above the floor [m], shape (n,)."""
        return lowest_height(self.scene, self.motion)

    @cached_property
    def near_wall(self) -> Mask:
        """Whether the body may touch a wall within a step before or after a row, shape (n,)."""
        dt, size = self.motion.t[1] - self.motion.t[0], self.scene.body.size
        reach = TOUCHING * size + dt * (length(self.motion.velocity) + size * length(self.motion.angular_velocity))
        near = np.zeros(len(self.motion), dtype=bool)
        for wall in self.scene.wall or ():
            near |= lowest_height(self.scene, Trajectory.from_states(self.motion.t, wall.as_floor(self.motion.states))) <= reach
        return near

    @cached_property
    def touching(self) -> Mask:
        """For each step, whether gravity and damping do not explain the change of the velocity (`is_touching`), shape (n - 1,)."""
        dt, gravity, damping = float(self.motion.t[1] - self.motion.t[0]), tuple(self.scene.acceleration), self.scene.damping
        before, after = (tuple(self.motion.velocity[rows].T) for rows in (slice(None, -1), slice(1, None)))
        strength = float(np.sqrt(scalar_product(gravity, gravity)))
        damping_share = 0.0 if damping is None else max(dt, self.scene.factor_dt) * damping.linear
        return is_touching(before, after, dt, gravity, strength, damping_share)


def is_touching(before: Components, after: Components, dt: float, gravity: Components, strength: float, damping_share: float) -> Any:
    """Whether gravity and damping do not explain the change of the velocity in a step, from the velocities before and after it.

    Without contact, only gravity and damping change the velocity. A remaining change counts if it exceeds 1e-3 of the change by gravity,
    1e-6 of the speed (for engines in single precision) and twice the change by damping (because engines use different laws of damping). The
    arithmetic is plain, as in `dropspin.scenarios.mechanics`, for one step or for arrays of steps.
    """
    x = after[0] - before[0] - dt * gravity[0]
    y = after[1] - before[1] - dt * gravity[1]
    z = after[2] - before[2] - dt * gravity[2]
    allowed = 1e-3 * dt * strength + (1e-6 + 2.0 * damping_share) * np.sqrt(scalar_product(before, before))
    return np.sqrt(scalar_product((x, y, z), (x, y, z))) > allowed
