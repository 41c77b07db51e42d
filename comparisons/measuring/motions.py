"""Quantities of a motion that need no reference solution: first contact, energy scale, rebound height, time to rest.

The same definitions apply to one motion and to many at once. A quantity of a motion has shape (...): () for one motion, (B,) for B motions;
a quantity at each state has shape (..., n).
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.measuring.contact_runs import ContactRuns, contact_runs
from dropspin.scenarios import Scenario, Trajectory
from dropspin.scenarios.mechanics import Components, angular_momentum, energy, energy_origin, kinetic_energy, lowest_height, scalar_product
from dropspin.scenarios.model import TOUCHING

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
RowNumbers = NDArray[np.intp]


class StateQuantities(Protocol):
    """Quantities at each state of a motion; rows after the last one of a shorter motion repeat its last state."""

    @property
    def height(self) -> Array:
        """Height of the centre of mass [m], shape (..., n)."""

    @property
    def vertical_velocity(self) -> Array:
        """Of the centre of mass [m/s], shape (..., n)."""

    @property
    def kinetic_energy(self) -> Array:
        """[J], shape (..., n)."""

    @property
    def energy(self) -> Array:
        """Kinetic plus potential energy, velocity synchronised with position [J], shape (..., n)."""

    @property
    def lowest_height(self) -> Array:
        """Height of the body's lowest point above the floor [m], shape (..., n).

        It may be inf where no point is below the floor, except at the rows of a step in `touching` and of the step before it.
        """

    @property
    def touching(self) -> Mask:
        """For each step, whether the velocity changes otherwise than by gravity and damping (`is_touching`), shape (..., n - 1)."""


@dataclass(frozen=True, eq=False)
class Setup:
    """A body and the forces on it. For many motions, a first axis of length 1 contains values that all motions share.

    Attributes:
        mass: Mass [kg], shape (...).
        inertia: Inertia tensor in the body frame [kg m²], shape (..., 3, 3).
        vertices: Vertices relative to the centre of mass, in the body frame [m], shape (..., m, 3).
        rounding: Radius of the vertices [m], shape (...).
        size: Distance of the farthest point of the body from the centre of mass [m], shape (...).
        origin: Position of zero potential energy [m], shape (..., 3).
        clearance: Height of the lowest point above the floor at the start [m], shape (...).
        gravity: Acceleration of gravity [m/s²], shape (..., 3).
        damping: Decay rate of the velocity [1/s], shape (...); None if damping is not modelled.
        floor: Whether there is a floor.
    """

    mass: Array
    inertia: Array
    vertices: Array
    rounding: Array
    size: Array
    origin: Array
    clearance: Array
    gravity: Array
    damping: Array | None
    floor: bool

    @classmethod
    def of(cls, scene: Scenario) -> "Setup":
        """The setup of one scene."""
        body = scene.body
        return cls(
            mass=np.asarray(body.mass),
            inertia=body.inertia_tensor,
            vertices=body.hull,
            rounding=np.asarray(body.rounding),
            size=np.asarray(body.size),
            origin=energy_origin(scene),
            clearance=np.asarray(scene.clearance),
            gravity=scene.acceleration,
            damping=None if scene.damping is None else np.asarray(scene.damping.linear),
            floor=scene.floor is not None,
        )

    def __getitem__(self, motions: RowNumbers | Mask) -> "Setup":
        """The setups of a selection of the motions."""
        return self._with_arrays(lambda values: values if len(values) == 1 else values[motions])

    def as_batch(self) -> "Setup":
        """The setup of one motion as a batch with one motion."""
        return self._with_arrays(lambda values: values[np.newaxis])

    def _with_arrays(self, change: Callable[[Array], Array]) -> "Setup":
        changed: dict[str, Any] = {field.name: getattr(self, field.name) for field in fields(self)}
        changed.update({name: change(value) for name, value in changed.items() if isinstance(value, np.ndarray)})
        return Setup(**changed)

    @cached_property
    def starts_above_floor(self) -> Mask:
        """Whether the body has to fall to touch the floor, shape (...)."""
        return self.floor & (self.clearance > TOUCHING * self.size)

    @cached_property
    def gravity_strength(self) -> Array:
        """|g| [m/s²], shape (...)."""
        x, y, z = np.moveaxis(self.gravity, -1, 0)
        return np.sqrt(scalar_product((x, y, z), (x, y, z)))

    def damping_share(self, dt: Array) -> Array:
        """The share of the velocity that a body loses by damping in a step, shape (...)."""
        return np.zeros_like(dt) if self.damping is None else dt * self.damping


@dataclass(frozen=True, eq=False)
class Motions:
    """One motion, or many at once.

    Attributes:
        setup: The bodies and the forces on them.
        states: Quantities at each state.
        dt: Time between two rows [s], shape (...).
        last_row: The last row of each motion, shape (...).
    """

    setup: Setup
    states: StateQuantities
    dt: Array
    last_row: RowNumbers

    @classmethod
    def of(cls, scene: Scenario, motion: Trajectory, states: "States | None" = None) -> "Motions":
        """One motion of a scene: at least two rows, equally spaced in time; `states` are its `States`, if there are any yet."""
        one = states or States(scene, motion)
        return cls(Setup.of(scene), one, np.asarray(motion.t[1] - motion.t[0]), np.asarray(len(motion) - 1))

    @property
    def energy(self) -> Array:
        """Kinetic plus potential energy, velocity synchronised with position [J], shape (..., n)."""
        return self.states.energy

    @property
    def lowest_height(self) -> Array:
        """Height of the body's lowest point above the floor [m], shape (..., n)."""
        return self.states.lowest_height

    @cached_property
    def energy_scale(self) -> Array:
        """The scene's energy [J], shape (...): M g H down to the floor or the start's kinetic energy, whichever is larger.

        H is the size of the body if it starts on the floor, or if there is no floor. The scale is 0 if the body does not move and no force
        acts.
        """
        setup = self.setup
        height = np.where(setup.starts_above_floor, setup.clearance, setup.size)
        return np.maximum(setup.mass * setup.gravity_strength * height, self.states.kinetic_energy[..., 0])

    @cached_property
    def fall(self) -> Array:
        """The speed of fall that gravity adds in a time step [m/s], shape (...)."""
        return np.maximum(-self.setup.gravity[..., 1], 0.0) * self.dt

    @cached_property
    def contacts(self) -> ContactRuns:
        """The contacts of all motions; none without a floor."""
        states = self.states
        touching = np.atleast_2d(states.touching & self.setup.floor)
        on_floor = np.atleast_2d(states.lowest_height <= TOUCHING * self.setup.size[..., np.newaxis])
        return contact_runs(touching, np.atleast_2d(states.vertical_velocity), on_floor, np.broadcast_to(self.fall, len(touching)))

    @cached_property
    def in_contact(self) -> Mask:
        """For each step, whether it is in a contact, shape (..., n - 1)."""
        found = np.zeros(np.atleast_2d(self.states.touching).shape, dtype=bool)
        motion, step, _ = self.contacts.steps
        found[motion, step] = True
        return found.reshape(self.states.touching.shape)

    @cached_property
    def first_contact(self) -> tuple[RowNumbers, RowNumbers]:
        """The last row before and the first row after the first contact, each of shape (...); -1 if there is no contact.

        If the contact lasts to the end, the second is the last row.
        """
        before, after = (np.full(self.last_row.shape, -1).reshape(-1) for _ in range(2))
        motions, first = np.unique(self.contacts.motion, return_index=True)
        before[motions], after[motions] = self.contacts.before[first], self.contacts.after[first]
        return before.reshape(self.last_row.shape), after.reshape(self.last_row.shape)

    @cached_property
    def first_flight_end(self) -> RowNumbers:
        """The last row before the first contact, or the last row, shape (...)."""
        before, _ = self.first_contact
        return np.where(before < 0, self.last_row, before)

    @cached_property
    def rebound(self) -> Array:
        """Largest height of the centre of mass after the first contact, over its initial height, shape (...); 0 without a contact."""
        height, (before, after) = self.states.height, self.first_contact
        later = np.where(np.arange(height.shape[-1]) >= after[..., None], height, -np.inf)
        with np.errstate(invalid="ignore", divide="ignore"):  # without a floor a start may have height 0
            return np.where(before < 0, 0.0, later.max(axis=-1) / height[..., 0])

    @cached_property
    def last_row_in_motion(self) -> RowNumbers:
        """The last row in which M v²/2 + ω·L/2 is above M (2 g dt)²/2, and above a millionth of M g times the body's size, shape (...)."""
        setup, g = self.setup, self.setup.gravity_strength
        still = setup.mass * np.maximum(2.0 * (g * self.dt) ** 2, 1e-6 * g * setup.size)
        moves = self.states.kinetic_energy > still[..., None]
        last = moves.shape[-1] - 1 - moves[..., ::-1].argmax(axis=-1)
        return np.where(moves.any(axis=-1), np.minimum(last, self.last_row), 0)


def is_touching(before: Components, after: Components, dt: float, gravity: Components, strength: float, damping_share: float) -> Any:
    """Whether the velocity changes otherwise than by gravity and damping in a step, from the velocities before and after it.

    Without contact, only gravity and damping change the velocity. A remaining change counts if it exceeds 1e-3 of the change by gravity,
    1e-6 of the speed (for engines in single precision) and twice the change by damping (because engines use different laws of damping). The
    arithmetic is plain, as in `dropspin.scenarios.mechanics`, for one step or for arrays of steps.
    """
    x = after[0] - before[0] - dt * gravity[0]
    y = after[1] - before[1] - dt * gravity[1]
    z = after[2] - before[2] - dt * gravity[2]
    allowed = 1e-3 * dt * strength + (1e-6 + 2.0 * damping_share) * np.sqrt(scalar_product(before, before))
    return np.sqrt(scalar_product((x, y, z), (x, y, z))) > allowed


@dataclass(frozen=True, eq=False)
class States:
    """`StateQuantities` of one motion of a scene, each computed once."""

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
    def touching(self) -> Mask:
        """For each step, whether the velocity changes otherwise than by gravity and damping (`is_touching`), shape (n - 1,)."""
        setup, dt = Setup.of(self.scene), np.asarray(self.motion.t[1] - self.motion.t[0])
        before, after = (tuple(self.motion.velocity[rows].T) for rows in (slice(None, -1), slice(1, None)))
        found: Mask = is_touching(
            before, after, float(dt), tuple(setup.gravity), float(setup.gravity_strength), float(setup.damping_share(dt))
        )
        return found


def at_rows(values: Array, rows: RowNumbers | int) -> Array:
    """One value of each motion: values of shape (..., n) at row numbers of shape (...) give shape (...)."""
    return np.take_along_axis(values, np.asarray(rows)[..., None], axis=-1)[..., 0]
