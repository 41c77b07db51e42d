"""The metrics: each takes a motion beside its reference to a number, or to one or two for each flight.

Flights are kept apart so that errors are averaged over start phases before the largest is picked, not after.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from comparisons.measuring import errors_over_time as errors
from comparisons.measuring.comparison import SHORTEST_FLIGHT, Comparison, Unresolved
from comparisons.measuring.motions import Motions, at_rows
from scenarios import Scenario, Trajectory, Truth, truth_for
from scenarios.mechanics import angular_momentum, apex, lowest_height
from scenarios.rotations import angle_between_orientations, length
from scenarios.state import RATES, SPIN

Array = NDArray[np.float64]
NEAR_FLOOR = 0.05  # of the body's size: engines may take what is so near for contact
TURNED = 1e-3  # rad; a body that turns less does not turn
LANDING = 3  # steps, within which every engine is done with an impact
Measure = Callable[[Comparison], float | Array]
AnyMeasure = TypeVar("AnyMeasure", bound=Measure)


@dataclass(frozen=True)
class Metric:
    """One metric.

    Attributes:
        name: As in the results.
        unit: SI; '1' for a ratio.
        kind: What it is held against: the closed-form truth, or a conservation law.
        signed: Whether its sign says something.
        definition: One sentence.
        needs: What a scene must have, in words.
        applies: Whether a scene, with its truth, has that.
        measure: From a comparison to the number, or to those of each flight; raises `Unresolved` where the step is too coarse.
        agreement: Whether two engines are held against each other by it.
        first_flight: Whether it looks no farther than the first impact and the flight after it.
    """

    name: str
    unit: str
    kind: Literal["truth", "invariant"]
    signed: bool
    definition: str
    needs: str
    applies: Callable[[Scenario, Truth | None], bool]
    measure: Measure
    agreement: bool = False
    first_flight: bool = False

    def average(self, cases: Sequence[Comparison]) -> "Average":
        """Over start phases.

        Raises:
            Unresolved: The time step is too coarse to tell.
        """
        measured = [np.atleast_1d(self.measure(case)) for case in cases]
        flights = min(map(len, measured))
        phases = np.array([values[:flights] for values in measured])
        # Each quarter of the phases, evenly spread as all of them are, gives a mean of its own.
        quarters = [phases[first::4].mean(axis=0) for first in range(min(4, len(phases)))]
        resolutions = 0.5 * np.ptp(quarters, axis=0)
        # The phases are even at the first impact only; what they draw at later ones is correlated, hardly better than one draw.
        later = 2 if flights > 1 or self.first_flight or len(cases[0].impacts) < 2 else 0
        resolutions[later:] = phases[:, later:].std(axis=0)
        if len(cases) == 1 and cases[0].has_impact_to_come:
            resolutions = np.abs(phases[0])  # one start may be sampling_noise altogether
        return Average(phases.mean(axis=0), resolutions, np.ptp(phases, axis=0) / len(phases))

    def value_or_nan(self, cases: Sequence[Comparison]) -> float:
        """The average's value; NaN where the time step is too coarse for it."""
        try:
            return self.average(cases).value
        except Unresolved:
            return float("nan")


class Average(NamedTuple):
    """A metric's means over start phases, how finely these phases resolve them, and what one phase may make of them.

    One for each flight, shape (flights,), or for each flight the largest and the least, shape (flights, 2).
    """

    parts: Array
    resolutions: Array
    jumps: Array

    @property
    def jump(self) -> float:
        """How far the value moves at most, if one of the starts falls into the neighbouring step; 0 of one start, which tells nothing."""
        return float(np.max(np.abs(self.parts) + self.jumps)) - abs(self.value)

    @property
    def value(self) -> float:
        """The part of largest size, with its sign."""
        return float(self.parts.flat[np.argmax(np.abs(self.parts))])


METRICS: dict[str, Metric] = {}


def metrics_for(scene: Scenario, truth: Truth | None) -> list[Metric]:
    """The metrics that a scene can be measured by."""
    return [metric for metric in METRICS.values() if metric.applies(scene, truth)]


def _metric(
    unit: str,
    kind: Literal["truth", "invariant"],
    needs: str,
    applies: Callable[[Scenario, Truth | None], bool],
    *,
    signed: bool = False,
    agreement: bool = False,
    first_flight: bool = False,
) -> Callable[[AnyMeasure], AnyMeasure]:
    """Register a function as a metric; its name is the metric's, its docstring the definition."""

    def register(measure: AnyMeasure) -> AnyMeasure:
        name, definition = measure.__name__, " ".join((measure.__doc__ or "").split())
        METRICS[name] = Metric(name, unit, kind, signed, definition, needs, applies, measure, agreement, first_flight)
        return measure

    return register


def _has_truth(scene: Scenario, truth: Truth | None) -> bool:
    return truth is not None


def _spins(scene: Scenario, truth: Truth | None) -> bool:
    if truth is None:
        return False
    sampled = truth(np.linspace(0.0, min(scene.duration, truth.horizon), 9))
    return bool(sampled.angular_velocity.any()) or any(event.after[SPIN].any() for event in truth.events)


def _has_impact(scene: Scenario, truth: Truth | None) -> bool:
    return truth is not None and len(truth.events) > 0 and scene.starts_above_floor


def _lands(scene: Scenario, truth: Truth | None) -> bool:
    return (
        truth is not None
        and not _starts_in_flight(scene)
        and len(truth.events) > 0
        and bool(truth.events[0].time > 0.0 and truth.events[0].before[SPIN].any())
    )


def _comes_to_rest(scene: Scenario, truth: Truth | None) -> bool:
    """Within the first nine tenths, after an impact."""
    if truth is None or truth.horizon < scene.duration or not truth.events or truth.events[0].time == 0.0:
        return False
    return not truth([0.9 * scene.duration]).states[0, RATES].any()


def _goes_on(scene: Scenario, truth: Truth | None) -> bool:
    """Impacts that follow from each other by a law that does not magnify errors, as those of a tumble do."""
    return truth is not None and truth.name in ("bounce-ladder", "rocking") and len(truth.events) > 1


def _has_apex(scene: Scenario, truth: Truth | None) -> bool:
    return _has_impact(scene, truth) and bool(scene.acceleration[1] < 0.0)


def _has_floor(scene: Scenario, truth: Truth | None) -> bool:
    return scene.floor is not None


def _keeps_energy(scene: Scenario, truth: Truth | None) -> bool:
    return scene.damping is None


def _keeps_energy_in_flight(scene: Scenario, truth: Truth | None) -> bool:
    return scene.damping is None and _starts_in_flight(scene)


def _spins_in_flight(scene: Scenario, truth: Truth | None) -> bool:
    return _starts_in_flight(scene) and _spins(scene, truth)


def _starts_in_flight(scene: Scenario) -> bool:
    return scene.floor is None or scene.starts_above_floor


def _keeps_horizontal_momentum(scene: Scenario, truth: Truth | None) -> bool:
    upright = scene.acceleration[0] == 0.0 and scene.acceleration[2] == 0.0
    return upright and scene.damping is None and scene.floor is not None and scene.floor.friction == "none"


@_metric("1", "truth", "a truth", _has_truth, signed=True, agreement=True)
def energy_error(case: Comparison) -> Array:
    """Largest difference of energy from the truth in flight, velocity synchronised with position, over the scene's energy."""
    return _extremes_of_each_flight(errors.energy_error(case), case)


@_metric("1", "truth", "a truth", _has_truth, signed=True)
def energy_error_raw(case: Comparison) -> Array:
    """The same from the state as it stands: what a user sees who does not know that velocity lags by half a step."""
    return _extremes_of_each_flight(errors.energy_error(case, synchronised=False), case)


@_metric("1", "invariant", "no damping, a start in flight", _keeps_energy_in_flight, signed=True, first_flight=True)
def energy_drift(case: Comparison | Motions) -> Array:
    """Change of energy from the start to the end of the first flight, over the scene's energy."""
    return (at_rows(case.energy, case.first_flight_end) - case.energy[..., 0]) / case.energy_scale


@_metric("1", "invariant", "no damping", _keeps_energy)
def energy_gain(case: Comparison | Motions) -> Array:
    """Largest rise of energy above any earlier value, over the scene's energy."""
    return (case.energy - np.minimum.accumulate(case.energy, axis=-1)).max(axis=-1) / case.energy_scale


@_metric("1", "truth", "a truth with an impact, gravity downwards", _has_apex, signed=True, agreement=True, first_flight=True)
def bounce_height_error(case: Comparison) -> float:
    """Apex of the centre of mass after the first impact minus the truth's, over the height of the drop."""
    if len(case.flights) < 2:
        raise Unresolved(f"the flight after the impact is too short for steps of {case.dt:g} s")
    rows = case.flights[1]
    found, exact = (apex(case.scene, motion[rows]) for motion in (case.compared, case.exact))
    return float(np.mean(found - exact)) / case.scene.clearance


@_metric("1", "truth", "a truth with an impact", _has_impact, signed=True, first_flight=True)
def restitution_error(case: Comparison) -> float:
    """Separation over approach speed of the contact point in the first impact, native rows, minus the restitution."""
    assert case.scene.floor is not None
    if not case.impacts or case.impacts[0] > case.motion.t[-1] - 3.0 * case.dt:
        raise Unresolved("the impact falls into the last three steps")
    if case.first_contact is None:
        return float("nan")  # it should have hit the floor
    before, after = case.first_contact
    approach, separation = (case.normal_velocity_of_contact(row, contact_row=before) for row in (before, after))
    height = lowest_height(case.scene, case.motion[np.array([after])])[0]
    at_floor = height <= NEAR_FLOOR * case.scene.body.size + 2.0 * case.dt * abs(approach)
    if not (approach < 0.0 and at_floor):
        return float("nan")  # what changed its velocity was no impact
    meant = 0.0 if -approach < case.scene.floor.rest_speed else case.scene.floor.restitution
    return -separation / approach - meant


@_metric("1", "invariant", "a truth with an impact", _has_impact, first_flight=True)
def contact_momentum_error(case: Comparison) -> float:
    """Jump of angular momentum about the contact point in the first impact, over M times that point's distance times the speed before.

    No impulse at that point has a moment about it; gravity's impulse is left out.
    """
    if case.first_contact is None:
        raise Unresolved("nothing was hit")
    before, after = case.first_contact
    if after >= len(case.motion) - 1:
        raise Unresolved("the contact lasts to the end")
    mass, r = case.scene.body.mass, case.contact_point(before)
    turned = np.diff(angular_momentum(case.scene, case.motion[np.array([before, after])]), axis=0)[0]
    pushed = case.motion.velocity[after] - case.motion.velocity[before] - (after - before) * case.dt * case.scene.acceleration
    scale = mass * float(np.linalg.norm(r) * np.linalg.norm(case.motion.velocity[before]))
    return float(np.linalg.norm(turned - np.cross(r, mass * pushed))) / scale


@_metric("1", "truth", "a truth that comes to rest", _comes_to_rest, signed=True)
def rest_time_error(case: Comparison) -> float:
    """When the speed last exceeded twice what gravity gives in a step, minus when the truth's did, over the latter."""
    found, exact = (last_time_in_motion(case.scene, motion) for motion in (case.compared, case.exact))
    if exact == 0.0:
        raise Unresolved(f"it is never faster than gravity makes it in two steps of {case.dt:g} s")
    return (found - exact) / exact


@_metric("m/s", "truth", "a truth that comes to rest", _comes_to_rest)
def rest_jitter(case: Comparison) -> float:
    """Root mean square of the vertical velocity in the last tenth, in which the truth rests."""
    rows = case.motion.t >= 0.9 * case.motion.t[-1]
    return float(np.sqrt(np.mean(case.motion.velocity[rows, 1] ** 2)))


@_metric("1", "truth", "a truth that turns on the floor before its first impact", _lands, signed=True, first_flight=True)
def landing_error(case: Comparison) -> float:
    """Angular speed three steps after over three steps before the first landing, minus the truth's."""
    edges = [0.0, *case.impacts[:2], case.exact.t[-1]]
    if min(edges[1] - edges[0], edges[2] - edges[1]) < SHORTEST_FLIGHT * case.dt:
        raise Unresolved(f"it falls and rises again within {SHORTEST_FLIGHT} steps of {case.dt:g} s")
    rows = np.searchsorted(case.motion.t, case.impacts[0]) + np.array([-LANDING, LANDING])
    axis = case.exact.angular_velocity[rows[0]]
    found, exact = (motion.angular_velocity[rows] @ axis for motion in (case.compared, case.exact))
    return float(found[1] / found[0] - exact[1] / exact[0])


@_metric("1/s", "truth", "a truth that bounces or rocks more than once", _goes_on)
def desync_rate(case: Comparison) -> float:
    """One over the time at which the body gets out of step with the truth, by half the height of a flight; 0 if it never does."""
    return 1.0 / case.desynchronised_from


@_metric("1", "truth", "a truth with spin", _spins, agreement=True)
def angular_momentum_error(case: Comparison) -> Array:
    """Largest difference of angular momentum from the truth in flight, over the truth's largest."""
    return _largest_of_each_flight(errors.angular_momentum_error(case), case)


@_metric("rad", "truth", "a truth with spin, a start in flight", _spins_in_flight)
def angular_momentum_direction_error(case: Comparison) -> Array:
    """Largest angle in flight between the angular momentum and the truth's."""
    return _largest_of_each_flight(errors.angular_momentum_direction_error(case), case)


@_metric("1", "invariant", "a frictionless floor, gravity straight down, no damping", _keeps_horizontal_momentum)
def horizontal_momentum_error(case: Comparison) -> float:
    """Largest change of the horizontal velocity, over the speed that belongs to the scene's energy."""
    sideways = (case.motion.velocity - np.array(case.scene.start.velocity))[:, [0, 2]]
    speed = np.sqrt(2.0 * case.energy_scale / case.scene.body.mass)
    return float(np.max(length(sideways)) / speed)


@_metric("m", "truth", "a truth", _has_truth)
def position_error(case: Comparison) -> float:
    """Largest distance of the centre of mass from the truth's."""
    return float(np.max(errors.position_error(case)))


@_metric("rad", "truth", "a truth", _has_truth)
def orientation_error(case: Comparison) -> float:
    """Largest angle of the rotation that takes the truth's attitude to the engine's."""
    return float(np.max(errors.orientation_error(case)))


@_metric("m", "invariant", "a floor", _has_floor)
def penetration(case: Comparison | Motions) -> Array:
    """Largest depth of the body's lowest point below the floor."""
    return np.maximum(-case.lowest_height, 0.0).max(axis=-1)


def leading_metric(scene: Scenario) -> str:
    """The metric that a scene with an exact solution is about: bounce height, else attitude if it turns, else position."""
    truth = truth_for(scene)
    assert truth is not None
    names = {metric.name for metric in metrics_for(scene, truth)}
    if "bounce_height_error" in names:
        return "bounce_height_error"
    motion = truth(np.linspace(0.0, min(scene.duration, truth.horizon), 9))
    turned = angle_between_orientations(motion.orientation[:1], motion.orientation)
    return "orientation_error" if turned.max() > TURNED else "position_error"


def last_time_in_motion(scene: Scenario, motion: Trajectory) -> float:
    """The time [s] of `Motions.last_row_in_motion`."""
    return float(motion.t[Motions.of(scene, motion).last_row_in_motion])


def _largest_of_each_flight(values: Array, case: Comparison) -> Array:
    """The largest in each flight of values that are not negative, shape (flights,)."""
    return np.array([values[rows].max() for rows in case.flights])


def _extremes_of_each_flight(values: Array, case: Comparison) -> Array:
    """The largest and the least value in each flight, shape (flights, 2): each of them shrinks with the step by a law of its own."""
    return np.array([(values[rows].max(), values[rows].min()) for rows in case.flights])
