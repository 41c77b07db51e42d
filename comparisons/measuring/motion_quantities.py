"""Quantities of a motion that need no reference solution: first contact, energy scale, rebound height, time to rest.

The same definitions apply to one motion and to many at once. A quantity of a motion has shape (...): () for one motion, (B,) for B motions;
a quantity at each state has shape (..., n).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from dropspin.comparisons.measuring.contact_runs import RESOLVED, STEADY, ContactRuns, Mask, RowNumbers, contact_runs
from dropspin.comparisons.measuring.state_quantities import States, StatesOfMany
from dropspin.scenarios import Scenario, Trajectory
from dropspin.scenarios.bodies.surface import clearances
from dropspin.scenarios.mechanics import energy_origin, scalar_product
from dropspin.scenarios.model import TOUCHING, initial_states
from dropspin.scenarios.state import Array


@dataclass(frozen=True, eq=False)
class Setup:
    """A body and the forces on it. For many motions, a first axis of length 1 contains values that all motions share.

    Attributes:
        mass: Mass [kg], shape (...).
        inertia: Inertia tensor in the body frame [kg m²], shape (..., 3, 3).
        vertices: Vertices relative to the centre of mass, in the body frame [m], shape (..., m, 3).
        semi_axes: Of the ellipsoids about the vertices [m], shape (..., 3).
        size: Distance of the farthest point of the body from the centre of mass [m], shape (...).
        origin: Position of zero potential energy [m], shape (..., 3).
        clearance: Height of the lowest point above the floor at the start [m], shape (...).
        gravity: Acceleration of gravity [m/s²], shape (..., 3).
        damping: Decay rate of the velocity [1/s], shape (...); None if damping is not modelled.
        factor_dt: Time step that the factors of damping are meant at, which a step of another size may apply too [s]; 0 for rates.
        floor: Whether there is a floor.
        ends: Whether the floor ends, so that a body below y = 0 may be beside it.
        walls: Whether there are walls, whose contacts are not those of `Motions.contacts`.
    """

    mass: Array
    inertia: Array
    vertices: Array
    semi_axes: Array
    size: Array
    origin: Array
    clearance: Array
    gravity: Array
    damping: Array | None
    factor_dt: float
    floor: bool
    ends: bool = False
    walls: bool = False

    @classmethod
    def of(cls, scene: Scenario) -> "Setup":
        """The setup of one scene."""
        body = scene.body
        return cls(
            mass=np.asarray(body.mass),
            inertia=body.inertia_tensor,
            vertices=body.hull,
            semi_axes=body.semi_axes,
            size=np.asarray(body.size),
            origin=energy_origin(scene),
            clearance=np.asarray(scene.clearance),
            gravity=scene.acceleration,
            damping=None if scene.damping is None else np.asarray(scene.damping.linear),
            factor_dt=scene.factor_dt,
            floor=scene.floor is not None,
            ends=scene.floor is not None and scene.floor.ends,
            walls=scene.wall is not None,
        )

    @classmethod
    def of_starts(cls, scenes: Sequence[Scenario]) -> "Setup":
        """The setups of scenes that differ in their starts alone."""
        setup, body, states = cls.of(scenes[0]), scenes[0].body, initial_states(scenes)
        arrays: dict[str, Any] = {name: value[np.newaxis] for name, value in vars(setup).items() if isinstance(value, np.ndarray)}
        arrays["origin"] = np.array([energy_origin(scene) for scene in scenes])
        arrays["clearance"] = clearances(states, body.vertices, body.semi_axes)
        return replace(setup, **arrays)

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
        """The largest share of the velocity that a body loses by damping in a step, shape (...)."""
        return np.zeros_like(dt) if self.damping is None else np.maximum(dt, self.factor_dt) * self.damping


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
    states: States | StatesOfMany
    dt: Array
    last_row: RowNumbers

    @classmethod
    def of(cls, scene: Scenario, motion: Trajectory) -> "Motions":
        """One motion of a scene: at least two rows, equally spaced in time."""
        return cls(Setup.of(scene), States(scene, motion), np.asarray(motion.t[1] - motion.t[0]), np.asarray(len(motion) - 1))

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
        mask = np.zeros(np.atleast_2d(self.states.touching).shape, dtype=bool)
        motion, step, _ = self.contacts.steps
        mask[motion, step] = True
        return mask.reshape(self.states.touching.shape)

    @cached_property
    def energy_gained(self) -> Array:
        """Largest increase of energy above any earlier value [J], shape (...); energy that a contact may have stored counts as present.

        Of many motions it is not known beside walls.
        """
        return (self.states.energy - np.minimum.accumulate(self._energy_with_stored(), axis=-1)).max(axis=-1)

    def _energy_with_stored(self) -> Array:
        """Energy plus the largest energy that a contact may have stored and give back [J], shape (..., n); unknown, inf, at a wall.

        A force that grows with the depth of the lowest point below its height before the contact stores at most force times depth, and no
        more than the energy that the body lost in the contact. A contact is rigid, and stores none, unless the point moves down against a
        force larger than the weight in two successive time steps.
        """
        runs = self.contacts
        motion, step, number = runs.steps
        energy, lowest, velocity = map(np.atleast_2d, (self.states.energy, self.states.lowest_height, self.states.vertical_velocity))
        fall, dt, mass = (np.broadcast_to(value, len(energy))[motion] for value in (self.fall, self.dt, self.setup.mass))
        rise, sinking = velocity[motion, step + 1] - velocity[motion, step], lowest[motion, step] - lowest[motion, step + 1]
        compressed = (rise > STEADY * fall) & (sinking > RESOLVED * fall * dt)
        again = compressed[1:] & compressed[:-1] & (number[1:] == number[:-1])
        is_soft = np.zeros(len(runs.motion), dtype=bool)
        is_soft[number[1:][again]] = True
        before = runs.before[number]
        level = np.maximum(lowest[motion, np.maximum(before - 1, 0)], 0.0)
        force = np.where(is_soft[number], mass * np.maximum(rise + fall, 0.0) / dt, 0.0)
        total = energy.copy()
        for row in (step, step + 1):
            lost = energy[motion, before] - energy[motion, row]
            stored = np.minimum(force * np.maximum(level - lowest[motion, row], 0.0), lost)
            total[motion, row] = np.maximum(total[motion, row], energy[motion, row] + stored)
        total = total.reshape(self.states.energy.shape)
        if self.setup.walls:
            assert isinstance(self.states, States)
            total[self.states.near_wall] = np.inf
        return total

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
        end = np.where(before < 0, self.last_row, before)
        if self.setup.walls:
            assert isinstance(self.states, States)
            end = np.minimum(end, np.argmax(np.append(self.states.near_wall, True)))
        return end

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

    def of_motion(self, number: int) -> dict[str, Any]:
        """The cached properties of one of many motions, by name."""
        runs = self.contacts
        first, last = np.searchsorted(runs.motion, (number, number + 1))
        return {
            "contacts": ContactRuns(np.zeros(last - first, dtype=np.intp), runs.before[first:last], runs.after[first:last]),
            "in_contact": self.in_contact[number],
            "first_contact": tuple(np.asarray(rows[number]) for rows in self.first_contact),
            "energy_scale": self.energy_scale[number],
        } | ({} if self.setup.walls else {"energy_gained": self.energy_gained[number]})


def at_rows(values: Array, rows: RowNumbers | int) -> Array:
    """One value of each motion: values of shape (..., n) at row numbers of shape (...) give shape (...)."""
    return np.take_along_axis(values, np.asarray(rows)[..., None], axis=-1)[..., 0]
