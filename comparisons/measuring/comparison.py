"""The comparison of a motion with its reference, which is the input of every metric.

If the exact solution has impacts, velocities are compared in the middle half of each of its flights, after a much longer flight in its
third quarter. Near an impact, velocities differ for a step or two because the impact occurs slightly early or late. This is an error in
time, which `position_error` measures. A body that does not bounce at all still fails, because the flights are those of the exact solution.
From the third flight on, the comparison ends where the body is desynchronised, because the flights no longer correspond. It also ends
before the first flight that is much shorter than the longest, so that few impacts amplify earlier errors, and every engine and time step
that resolves the flights is compared in the same ones.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from dropspin.comparisons.measuring.contact_laws import ContactResiduals, contact_residuals
from dropspin.comparisons.measuring.contact_runs import Mask, RowNumbers
from dropspin.comparisons.measuring.motion_quantities import Motions
from dropspin.comparisons.measuring.state_quantities import States
from dropspin.scenarios import Scenario, Trajectory, Truth
from dropspin.scenarios.mechanics import angular_momentum, apex
from dropspin.scenarios.model import TOUCHING
from dropspin.scenarios.rotations import cross, length
from dropspin.scenarios.state import ORIENTATION, Array

SHORTEST_FLIGHT = 16  # steps; a shorter flight is not resolved, and not judged
SHORT = 0.2
"""A flight is much shorter than the longest if it lasts less than this share of it; its apex is then 25 times lower."""
OF_EACH_STATE = ("kinetic_energy", "energy", "angular_momentum")
"""Quantities of a motion that are reused where it is the reference of another engine."""
LOW = 0.01
"""A body that rises after an impact by less than this share of its drop stays down: its flight is shorter than `SHORT` of its fall."""


class Unresolved(Exception):
    """The time step is too coarse for a metric; the message gives the reason."""


class BeyondHorizon(Unresolved):
    """The exact solution ends too early for a comparison."""


def at_times(motion: Trajectory, times: Array) -> Trajectory:
    """A motion with equal steps at times [s] that need not be those of its rows, on the chords between these."""
    steps = times / (motion.t[1] - motion.t[0])
    before = np.minimum(steps.astype(np.intp), len(motion) - 2)
    share, states = (steps - before)[:, np.newaxis], motion.states
    mixed = (1.0 - share) * states[before] + share * states[before + 1]
    mixed[:, ORIENTATION] /= length(mixed[:, ORIENTATION])[:, np.newaxis]
    return Trajectory.from_states(times, mixed, motion.velocity_lag)


def exactly(truth: Truth, times: Array) -> Trajectory:
    """The exact solution at those of the given times at which it is known."""
    return truth(times[truth.covers(times)])


@dataclass(frozen=True, eq=False)
class Comparison:
    """A motion and the reference with which it is compared.

    Attributes:
        scene: The scene that was run.
        motion: The engine's motion: at least two rows, equally spaced in time.
        reference: The exact solution or the motion of another engine, at the same times, up to its end; None if there is neither.
        impacts: Times of the exact impacts [s]; empty if they are not known.
        measured: The measured motion in the frames of its recording; None if there is none. Only positions and orientations are compared
            with it.
    """

    scene: Scenario
    motion: Trajectory
    reference: Trajectory | None = None
    impacts: tuple[float, ...] = ()
    measured: Trajectory | None = None

    @classmethod
    def with_truth(cls, scene: Scenario, motion: Trajectory, truth: Truth | None, exact: Trajectory | None = None) -> "Comparison":
        """Compare a motion with the exact solution, up to its end; `exact` is the result of `exactly` if it was already computed.

        A measured motion is compared in its frames.
        """
        if truth is None:
            return cls(scene, motion)
        if truth.frames is not None:
            return cls(scene, motion, measured=truth(truth.frames[truth.frames <= motion.t[-1]]))
        return cls(scene, motion, exactly(truth, motion.t) if exact is None else exact, tuple(event.time for event in truth.events))

    @classmethod
    def between(cls, first: "Comparison", second: "Comparison", until: int) -> "Comparison":
        """Compare the motions of two engines over `until` rows; what was already computed of them is reused."""
        case = cls(first.scene, first.motion, second.motion[:until], first.impacts)
        vars(case)["motions"] = first.motions
        vars(case.exact_states).update({name: vars(second.states)[name][:until] for name in OF_EACH_STATE if name in vars(second.states)})
        return case

    @cached_property
    def clearance(self) -> float:
        """Height of the body's lowest point at the start [m]."""
        return self.scene.clearance

    @cached_property
    def exact(self) -> Trajectory:
        """The reference; metrics that need a reference apply only if there is one.

        Raises:
            BeyondHorizon: The reference ends after too few steps.
        """
        if self.measured is not None:
            return self.measured
        assert self.reference is not None
        if len(self.reference) < min(SHORTEST_FLIGHT, len(self.motion) - 1):
            raise BeyondHorizon(f"the exact solution is known for {len(self.reference) - 1} steps of {self.dt:g} s only")
        return self.reference

    @cached_property
    def compared(self) -> Trajectory:
        """The motion at the reference's times."""
        if self.measured is not None:
            return at_times(self.motion, self.measured.t)
        return self.motion[: len(self.exact)]

    @cached_property
    def motions(self) -> Motions:
        """The motion as the input of metrics that need no reference."""
        return Motions.of(self.scene, self.motion)

    @property
    def states(self) -> States:
        """Quantities at each state of the motion."""
        assert isinstance(self.motions.states, States)
        return self.motions.states

    @cached_property
    def exact_states(self) -> States:
        """Quantities at each state of the reference."""
        assert self.reference is not None
        return States(self.scene, self.reference)

    @property
    def angular_momentum(self) -> Array:
        """Angular momentum of the motion at the reference's times [kg m²/s], shape (m, 3)."""
        return self.states.angular_momentum[: len(self.exact)]

    @cached_property
    def dt(self) -> float:
        """Time between two rows [s]."""
        return float(self.motion.t[1] - self.motion.t[0])

    @cached_property
    def contacts(self) -> ContactResiduals:
        """The violations of the laws of contact at each step in which the floor acts."""
        return contact_residuals(self.scene, self.motion.states, self.motions)

    @cached_property
    def flights(self) -> list[RowNumbers]:
        """Rows in the middle half of each flight; the first flight begins at the start, and the last one ends at the end of the motion.

        Without a reference, only the motion up to the first contact is a flight.
        """
        rows = np.arange(len(self.motion if self.reference is None else self.reference))
        times = self.motion.t[rows]
        if not self.impacts and self.reference is None:
            return [rows[: int(self.motions.first_flight_end) + 1]]
        edges = [0.0, *self.impacts, times[-1]]
        # After the last impact the body may lie on the floor, so the time until the end is not the length of a flight.
        lengths = np.diff(edges)
        shortest = max(SHORTEST_FLIGHT * self.dt, SHORT * float(np.max(lengths[:-1], initial=0.0)))
        inner = []
        ends_at_an_impact = self.reference is not None and len(self.motion) - len(self.reference) > 1  # whose outcome is not known
        for number, (start, end) in enumerate(pairwise(edges)):
            is_cut = number == len(self.impacts) and not ends_at_an_impact  # by the end of the scene, and may be short
            # The uncertainty of an impact scales with the flight before; of a whole flight at least a quarter is compared.
            before = 0.0 if number == 0 else 0.25 * max(end - start, start - edges[number - 1])
            before, after = (before, 0.0) if is_cut else (min(before, 0.5 * (end - start)), 0.25 * (end - start))
            held = rows[(times >= start + before) & (times <= end - after)]
            if number > 0 and (end - start < shortest or not len(held)):
                break
            if number > 1 and self._is_desynchronised(held, (times >= start) & (times <= end)):
                break
            inner.append(held)
        return inner

    @property
    def flights_with_impact(self) -> list[RowNumbers]:
        """The flights, among them the one after the first impact if there is an impact.

        Raises:
            Unresolved: That flight is too short.
        """
        if self.impacts and len(self.flights) < 2:
            raise Unresolved(f"the flight after the impact lasts less than {SHORTEST_FLIGHT} steps of {self.dt:g} s or a fifth of the fall")
        return self.flights

    @cached_property
    def greatest_apexes(self) -> tuple[float, float] | None:
        """The greatest apex height of the motion after its first contact, and that of the exact body after its first impact [m].

        None if the exact body rises after its first impact by more than `LOW` of the drop.

        Raises:
            Unresolved: The first contact begins after the end of the exact solution.
        """
        fallen = self.exact[self.exact.t > self.impacts[0]] if self.impacts else self.exact[:0]
        exact = apex(self.scene, fallen)
        if not len(fallen) or exact.max() - fallen.position[0, 1] > LOW * self.clearance:
            return None
        last = len(self.compared) - 1
        before, after = self.first_contact or (0, last + 1 - len(fallen))
        if before >= last:
            raise Unresolved("the first contact begins after the end of the exact solution")
        first = min(after, last)  # a body that stays in contact rises no more at the end
        return float(apex(self.scene, self.compared[first:]).max()), float(exact.max())

    @cached_property
    def desynchronised_from(self) -> float:
        """Time at which the flight begins in which the body is desynchronised [s]; infinite if there is no such flight."""
        times = self.motion.t[: len(self.exact)]
        for start, end in pairwise([*self.impacts, times[-1]]):
            within = 0.25 * (end - start)
            held = np.flatnonzero((times >= start + within) & (times <= end - within))
            if end - start >= SHORTEST_FLIGHT * self.dt and self._is_desynchronised(held, (times >= start) & (times <= end)):
                return start
        return np.inf

    def _is_desynchronised(self, rows: RowNumbers, flight: Mask) -> bool:
        """Whether the height is wrong by half the height of the flight, so that the body may be in another flight."""
        heights = self.exact.position[flight, 1]
        high = float(np.ptp(heights)) if len(heights) else 0.0
        difference = np.abs(self.compared.position[rows, 1] - self.exact.position[rows, 1]).max(initial=0.0)
        return high > TOUCHING * self.scene.body.size and bool(difference > 0.5 * high)

    @property
    def first_flight_end(self) -> int:
        """The last row of the first flight that is compared."""
        return int(self.flights[0][-1])

    @cached_property
    def energy_scale(self) -> float:
        """The scene's energy [J]: `Motions.energy_scale`; without a floor, the reference's largest kinetic energy.

        Raises:
            Unresolved: The scene has no energy.
        """
        if self.scene.floor is None and self.reference is not None:
            scale = float(self.exact_states.kinetic_energy.max())
        else:
            scale = float(self.motions.energy_scale)
        if scale == 0.0:
            raise Unresolved("the body does not move and no force acts, so there is no energy scale")
        return scale

    @cached_property
    def first_contact(self) -> tuple[int, int] | None:
        """The last row before and the first row after the first contact; None without a contact."""
        before, after = self.motions.first_contact
        return None if before < 0 else (int(before), int(after))

    def contact_point(self, row: int) -> Array:
        """The vector from the centre of mass to the lowest point at a row [m], shape (3,); the mean if several points are equally low."""
        return self.scene.body.lowest(self.motion.orientation[row], 1e-6).mean(axis=0)

    @cached_property
    def struck_point(self) -> Array:
        """The vector from the centre of mass to the contact point at the last row before the first contact [m], shape (3,).

        Raises:
            Unresolved: There is no contact.
        """
        if self.first_contact is None:
            raise Unresolved("no impact was detected")
        return self.contact_point(self.first_contact[0])

    def normal_velocity_of_struck_point(self, row: int) -> float:
        """Vertical velocity at a row of the point at `struck_point` [m/s]."""
        return float((self.motion.velocity[row] + cross(self.motion.angular_velocity[row], self.struck_point))[1])

    @cached_property
    def moment_in_first_impact(self) -> Array:
        """Change of angular momentum about the struck point in the first impact, relative to M r v, shape (3,).

        The metric `contact_momentum_error` is its length.

        Raises:
            Unresolved: There is no contact, or it lasts to the end, or the body is at rest before it.
        """
        mass, r = self.scene.body.mass, self.struck_point
        before, after = self.motions.first_contact
        if after >= len(self.motion) - 1:
            raise Unresolved("the contact lasts to the end")
        turned = np.diff(angular_momentum(self.scene, self.motion[np.array([before, after])]), axis=0)[0]
        pushed = self.motion.velocity[after] - self.motion.velocity[before] - (after - before) * self.dt * self.scene.acceleration
        scale = mass * float(np.linalg.norm(r) * np.linalg.norm(self.motion.velocity[before]))
        if scale == 0.0:
            raise Unresolved("the body is at rest before the impact")
        return (turned - cross(r, mass * pushed)) / scale
