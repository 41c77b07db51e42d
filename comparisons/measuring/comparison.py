"""A motion beside the one it should have been: what every metric looks at.

Where the truth has impacts, velocities are compared in the inner half of each of the truth's flights: near an impact they
differ for a step or two because the impact comes a little early or late, which is an error of time and is judged as one
(`position_error`). A body that does not bounce at all still fails, because the truth's flights say where to look. After the second
flight they end where the body is out of step with them: late flights of many would be compared with others than their own.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from comparisons.measuring.motions import Motions
from scenarios import Scenario, Trajectory, Truth
from scenarios.mechanics import angular_momentum, energy, kinetic_energy
from scenarios.model import TOUCHING
from scenarios.rotations import rotate

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

SHORTEST_FLIGHT = 16  # steps; a flight of fewer is not resolved, and not judged


class Unresolved(Exception):
    """The time step is too coarse for a metric; the text says why."""


def exactly(truth: Truth, times: Array) -> Trajectory:
    """The truth at those of some times that it covers."""
    return truth(times[truth.covers(times)])


@dataclass(frozen=True, eq=False)
class Comparison:
    """One motion beside another of the same scene.

    Attributes:
        scene: The scene that was run.
        motion: What the engine did; at least two rows, equally far apart in time.
        reference: What it is held against, at the same times as far as it goes: the truth, or another engine's motion.
            None where there is neither.
        impacts: When the body hits the floor, by the truth [s]; empty where that is not known.
    """

    scene: Scenario
    motion: Trajectory
    reference: Trajectory | None = None
    impacts: tuple[float, ...] = ()

    @classmethod
    def with_truth(cls, scene: Scenario, motion: Trajectory, truth: Truth | None, exact: Trajectory | None = None) -> "Comparison":
        """Hold a motion against the truth, as far as the truth goes; `exact` is what `exactly` gave for its times, if that is at hand."""
        if truth is None:
            return cls(scene, motion)
        return cls(scene, motion, exactly(truth, motion.t) if exact is None else exact, tuple(event.time for event in truth.events))

    @classmethod
    def between(cls, one: "Comparison", other: "Comparison", until: int) -> "Comparison":
        """Hold one engine's motion against another's, for so many rows; what both have computed beside the truth is not computed again."""
        case = cls(one.scene, one.motion, other.motion[:until], one.impacts)
        vars(case).update(energy=one.energy, exact_energy=other.energy[:until])
        return case

    @cached_property
    def exact(self) -> Trajectory:
        """The reference; metrics that need one are asked only where there is one.

        Raises:
            Unresolved: It ends after so few steps that they say nothing.
        """
        assert self.reference is not None
        if len(self.reference) < min(SHORTEST_FLIGHT, len(self.motion) - 1):
            raise Unresolved(f"the truth is known for {len(self.reference) - 1} steps of {self.dt:g} s only")
        return self.reference

    @property
    def ends_at_an_impact(self) -> bool:
        """Whether the reference ends before the motion does, because what comes then is not known: something strikes the floor."""
        return self.reference is not None and len(self.motion) - len(self.reference) > 1

    @cached_property
    def compared(self) -> Trajectory:
        """The motion at the reference's times."""
        return self.motion[: len(self.exact)]

    @cached_property
    def motions(self) -> Motions:
        """The motion, for what is measured without a reference."""
        return Motions.of(self.scene, self.motion)

    @cached_property
    def energy(self) -> Array:
        """Of the motion, velocity synchronised with position [J], shape (n,)."""
        return self.motions.energy

    @property
    def lowest_height(self) -> Array:
        """Of the body's lowest point above the floor [m], shape (n,)."""
        return self.motions.lowest_height

    @cached_property
    def exact_energy(self) -> Array:
        """Of the reference [J], shape (m,)."""
        return energy(self.scene, self.exact)

    @cached_property
    def angular_momentum(self) -> Array:
        """Of the motion at the reference's times [kg m²/s], shape (m, 3)."""
        return angular_momentum(self.scene, self.compared)

    @cached_property
    def exact_angular_momentum(self) -> Array:
        """Of the reference [kg m²/s], shape (m, 3)."""
        return angular_momentum(self.scene, self.exact)

    @cached_property
    def dt(self) -> float:
        """Time between two rows [s]."""
        return float(self.motion.t[1] - self.motion.t[0])

    @property
    def has_impact_to_come(self) -> bool:
        """Whether the first impact is after the first step, so that where in a step it falls matters."""
        return bool(self.impacts) and self.impacts[0] > self.dt

    @cached_property
    def flights(self) -> list[Rows]:
        """Rows in the inner half of each flight; the first one counts from the start, the last one to the end.

        Without a reference only the flight up to the first contact is one.
        """
        rows = np.arange(len(self.motion if self.reference is None else self.reference))
        times = self.motion.t[rows]
        if not self.impacts and self.reference is None:
            contact = self.first_contact
            return [rows if contact is None else rows[: contact[0] + 1]]
        edges = [0.0, *self.impacts, times[-1]]
        inner = []
        for number, (start, end) in enumerate(pairwise(edges)):
            # The last flight may be cut short by the scene's end; its impact is as uncertain as the flight before is long.
            before = 0.0 if number == 0 else 0.25 * max(end - start, start - edges[number - 1])
            after = 0.0 if number == len(self.impacts) and not self.ends_at_an_impact else 0.25 * (end - start)
            held = rows[(times >= start + before) & (times <= end - after)]
            if number > 1 and self._is_desynchronised(held, (times >= start) & (times <= end)):
                break
            if number == 0 or (end - start >= SHORTEST_FLIGHT * self.dt and len(held)):
                inner.append(held)
        return inner

    @cached_property
    def desynchronised_from(self) -> float:
        """When the flight begins in which the body is out of step with the reference [s]; infinite if it is in step to the end."""
        times = self.motion.t[: len(self.exact)]
        for start, end in pairwise([*self.impacts, times[-1]]):
            within = 0.25 * (end - start)
            held = np.flatnonzero((times >= start + within) & (times <= end - within))
            if end - start >= SHORTEST_FLIGHT * self.dt and self._is_desynchronised(held, (times >= start) & (times <= end)):
                return start
        return np.inf

    def _is_desynchronised(self, rows: Rows, flight: NDArray[np.bool_]) -> bool:
        """Whether a body's height is off by half of how high the flight is, so that it may be in another flight by then."""
        heights = self.exact.position[flight, 1]
        high = float(np.ptp(heights)) if len(heights) else 0.0
        apart = np.abs(self.compared.position[rows, 1] - self.exact.position[rows, 1]).max(initial=0.0)
        return high > TOUCHING * self.scene.body.size and bool(apart > 0.5 * high)

    @property
    def first_flight_end(self) -> int:
        """The last row of the first flight that is compared."""
        return int(self.flights[0][-1])

    @cached_property
    def energy_scale(self) -> float:
        """The scene's energy [J]: `Motions.energy_scale`; without a floor, the reference's largest kinetic energy.

        Raises:
            Unresolved: There is no energy at all.
        """
        if self.scene.floor is None and self.reference is not None:
            scale = float(kinetic_energy(self.scene, self.reference).max())
        else:
            scale = float(self.motions.energy_scale)
        if scale == 0.0:
            raise Unresolved("nothing moves and nothing pulls: there is no energy to measure by")
        return scale

    @cached_property
    def first_contact(self) -> tuple[int, int] | None:
        """The rows just before and just after the floor first changes the velocity, or None."""
        before, after = self.motions.first_contact
        return None if before < 0 else (int(before), int(after))

    @property
    def touching(self) -> NDArray[np.bool_]:
        """In which steps the floor changes the velocity, shape (n - 1,)."""
        return self.motions.states.touching

    def contact_point(self, row: int) -> Array:
        """From the centre of mass to the point that is lowest at a row [m], shape (3,); the middle of several that are."""
        offsets = rotate(self.motion.orientation[row], self.scene.body.vertices)
        lowest = offsets[:, 1] <= offsets[:, 1].min() + 1e-6 * self.scene.body.size
        point: Array = offsets[lowest].mean(axis=0) - np.array([0.0, self.scene.body.rounding, 0.0])
        return point

    def normal_velocity_of_contact(self, row: int, contact_row: int) -> float:
        """Vertical velocity [m/s] at one row of the point that is lowest at another."""
        arm = self.contact_point(contact_row)
        return float((self.motion.velocity[row] + np.cross(self.motion.angular_velocity[row], arm))[1])
