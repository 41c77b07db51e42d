"""The contacts of a motion, and by how much the forces of the floor violate the laws of contact; no exact solution is needed.

The impulse of the floor in a time step, and its moment about the vertical, follow from the states before and after it:

    J = M (v₁ - v₀ - g dt) = N Y + F        τ = Y·(L₁ - L₀)

The laws of time-stepping methods hold for any number of contact points in the plane of the floor:

    N >= 0                  the floor does not pull (A. Signorini, 1933)
    |F| <= f N              friction is within its cone, because that of each contact is (C. A. Coulomb, 1785)
    F·u + τ ω·Y <= 0        friction opposes the remaining slip (maximal dissipation; J. J. Moreau, 1988)

with the velocity u = v + ω × (-h Y) of the body at the floor, at the distance h below its centre of mass, after the step. The fourth law
is that the floor acts only where it touches (complementarity): the lowest point is on the floor.

A pull has no contact by which to tell it from a wrong acceleration, so `pull` is that of any step; the other laws are those of contacts
(`contact_runs`).

In an impact with friction these laws permit a gain of energy (T. R. Kane, 1984), so that energy is measured separately. Where the slip
reverses within an impact, Coulomb's law at each instant (E. J. Routh, 1860) may leave a slip along F, against the third law.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dropspin.comparisons.measuring.contact_runs import Mask, RowNumbers
from dropspin.comparisons.measuring.motion_quantities import Motions
from dropspin.scenarios import DropspinError, Scenario, Trajectory
from dropspin.scenarios.mechanics import angular_momentum
from dropspin.scenarios.rotations import cross, length
from dropspin.scenarios.state import UP, Array

if TYPE_CHECKING:
    import pandas as pd


RESIDUALS = ("pull", "cone_excess", "push", "gap")
"""The laws of contact, by the name of their violation."""
AT_ONCE = 16_384
"""Time steps of which intermediate results are held in memory at once."""


class ContactResiduals(NamedTuple):
    """The violations of the laws of contact in each time step in which something beside gravity changes the velocity; 0 if a law holds.

    Attributes:
        motion: The number of the motion of each of these time steps, shape (n,).
        steps: The numbers of these time steps, beginning with 0, shape (n,).
        in_contact: Whether each of these time steps belongs to a contact, shape (n,); in all others, only `pull` can differ from 0.
        pull: Impulse with which the floor pulls, divided by M v, shape (n,). M is the mass; v is the speed at which the kinetic energy
            equals the scene's energy.
        cone_excess: Impulse along the floor in excess of the coefficient of friction times the normal impulse, divided by M v, shape (n,);
            NaN if friction is infinite.
        push: Impulse of friction times the slip in its direction, summed over the contacts, divided by the scene's energy, shape (n,).
        gap: Height of the body's lowest point above the floor, before or after the step, whichever is lower [m], shape (n,).
    """

    motion: RowNumbers
    steps: RowNumbers
    in_contact: Mask
    pull: Array
    cone_excess: Array
    push: Array
    gap: Array

    def of_motion(self, number: int) -> "ContactResiduals":
        """The residuals of one of several motions."""
        first, last = np.searchsorted(self.motion, (number, number + 1))
        return ContactResiduals._make(values[first:last] for values in self)


def contact_residuals(scene: Scenario, states: Array, motions: Motions) -> ContactResiduals:
    """The violations of the laws of contact in motions from several starts of a scene.

    Args:
        scene: The scene; it must have a floor and no damping.
        states: Shape (B, n, 13), or (n, 13) of one motion.
        motions: The motions.
    """
    motion, steps = np.nonzero(np.atleast_2d(motions.states.touching))
    blocks = np.array_split(np.arange(len(steps)), 1 + len(steps) // AT_ONCE)
    parts = [_residuals(scene, states, motions, motion[block], steps[block]) for block in blocks]
    return ContactResiduals._make(map(np.concatenate, zip(*parts, strict=True)))


def _residuals(scene: Scenario, states: Array, motions: Motions, motion: RowNumbers, steps: RowNumbers) -> ContactResiduals:
    """The violations in some steps of some motions."""
    assert scene.floor is not None
    in_contact = np.atleast_2d(motions.in_contact)[motion, steps]
    rows, lowest = states.reshape(-1, *states.shape[-2:]), np.atleast_2d(motions.states.lowest_height)
    before, after = (Trajectory.from_states(np.zeros(len(steps)), rows[motion, row]) for row in (steps, steps + 1))
    scale, dt = np.atleast_1d(motions.energy_scale)[motion], np.broadcast_to(motions.dt, len(rows))[motion, np.newaxis]
    energy = np.where(scale == 0.0, 1.0, scale)  # a body at rest without gravity violates nothing
    momentum = scene.body.mass * np.sqrt(2.0 * energy / scene.body.mass)

    impulse = scene.body.mass * (after.velocity - before.velocity - dt * scene.acceleration)
    normal, along = impulse @ UP, impulse - np.outer(impulse @ UP, UP)
    moment = (angular_momentum(scene, after) - angular_momentum(scene, before)) @ UP
    to_floor = (lowest[motion, steps + 1] - after.position[:, 1])[:, np.newaxis] * UP
    slip = after.velocity + cross(after.angular_velocity, to_floor)
    along_slip = np.sum(along * slip, axis=1) + moment * (after.angular_velocity @ UP)
    if np.isinf(scene.floor.coefficient):
        excess = np.full_like(normal, np.nan)
    else:
        excess = in_contact * np.maximum(length(along) - scene.floor.coefficient * np.maximum(normal, 0.0), 0.0)
    return ContactResiduals(
        motion,
        steps,
        in_contact,
        pull=np.maximum(-normal, 0.0) / momentum,
        cone_excess=excess / momentum,
        push=in_contact * np.maximum(along_slip, 0.0) / energy,
        gap=np.where(in_contact, np.maximum(np.minimum(lowest[motion, steps], lowest[motion, steps + 1]), 0.0), 0.0),
    )


def contacts(scene: Scenario, motion: Trajectory) -> "pd.DataFrame":
    """The contacts of a motion, each with the impulse of the floor and the largest violation of each law of contact.

    Args:
        scene: A scene with a floor that does not end, without walls and without damping.
        motion: A motion of the scene, for example from `simulate`.

    Returns:
        One row for each contact, which is a sequence of time steps in which the floor acts (`contact_runs`): `start` and `end` [s], the
        impulse along the normal `impulse` [N s], the change of energy `energy_change` [J], and the largest `pull`, `cone_excess`, `push`
        and `gap` of its steps, as in `ContactResiduals`.

    Raises:
        DropspinError: The scene has no such floor, or it has walls or damping.
    """
    import pandas as pd

    if scene.floor is None or scene.damping is not None or scene.has_edges_or_walls:
        raise DropspinError(
            f"{scene.name}: the forces of the floor need a scene with a floor that does not end, without walls and without damping."
        )
    motions = Motions.of(scene, motion)
    per_step = contact_residuals(scene, motion.states, motions)
    starts, ends = motions.contacts.before, motions.contacts.after
    first = np.cumsum(ends - starts) - (ends - starts)  # the number of the first step of each contact among those in contact
    falling = (motion.t[ends] - motion.t[starts]) * scene.acceleration[1]
    largest = {name: getattr(per_step, name)[per_step.in_contact] for name in RESIDUALS}
    residuals = {name: np.maximum.reduceat(values, first) if len(first) else values for name, values in largest.items()}
    return pd.DataFrame(
        {
            "start": motion.t[starts],
            "end": motion.t[ends],
            "impulse": scene.body.mass * (motion.velocity[ends, 1] - motion.velocity[starts, 1] - falling),
            "energy_change": motions.states.energy[ends] - motions.states.energy[starts],
            **residuals,
        }
    )
