"""The metrics: functions from a comparison to one value, or to values for each flight. Docstrings are the definitions."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, Literal, TypeVar

import numpy as np

from dropspin.comparisons.measuring import errors_over_time as errors
from dropspin.comparisons.measuring import requirements
from dropspin.comparisons.measuring.comparison import SHORTEST_FLIGHT, Comparison, Unresolved
from dropspin.comparisons.measuring.metric import Applies, Components, Measure, Metric
from dropspin.comparisons.measuring.motion_quantities import Motions, at_rows
from dropspin.scenarios import Scenario, Trajectory, Truth
from dropspin.scenarios.mechanics import apex
from dropspin.scenarios.rotations import angle_between_orientations, length
from dropspin.scenarios.state import Array
from dropspin.scenarios.truths import exact_solution

TURNED = 1e-3  # rad; a body that turns by less counts as not turning
LANDING = 3  # steps, within which every engine has completed an impact
AnyMeasure = TypeVar("AnyMeasure", bound=Measure)

METRICS: dict[str, Metric] = {}


@lru_cache(maxsize=128)  # every engine at every time step of a scene needs them
def metrics_for(scene: Scenario, truth: Truth | None) -> tuple[Metric, ...]:
    """The metrics that apply to a scene with its exact solution."""
    return tuple(metric for metric in METRICS.values() if metric.applies(scene, truth))


def _metric(unit: str, kind: Literal["truth", "invariant"], applies: Applies, **others: Any) -> Callable[[AnyMeasure], AnyMeasure]:
    """Register a function as a metric: its name, its docstring as the definition, and what a scene needs by that of `applies`."""

    def register(measure: AnyMeasure) -> AnyMeasure:
        name, definition = measure.__name__, " ".join((measure.__doc__ or "").split())
        needed = (applies.__doc__ or "").partition(".")[0]
        METRICS[name] = Metric(name, unit, kind, definition, needed[:1].lower() + needed[1:], applies, measure, **others)
        return measure

    return register


def _at_end_of_each_flight(components: Callable[[Comparison, list[int]], Array]) -> Components:
    """Components at the last row of the middle half of each flight, shape (flights, 3).

    This time is the same at every time step, to within one step, and far from impacts, near which errors are errors in time. The time at
    which an error is largest depends on the time step, so the components at that time do not follow a power of the time step.
    """
    return lambda case: components(case, [int(rows[-1]) for rows in case.flights])


@_metric("1", "truth", requirements.has_truth, signed=True, agreement=True)
def energy_error(case: Comparison) -> Array:
    """Largest difference of the energy from the exact energy in flight, relative to the scene's energy.

    Velocities that lag behind the positions are first shifted to the time of the positions.
    """
    return _extremes_of_each_flight(errors.energy_error(case), case)


@_metric("1", "truth", requirements.has_truth, signed=True)
def energy_error_raw(case: Comparison) -> Array:
    """Like energy_error, but with the velocities that the engine stores, which in some engines lag positions by half a time step."""
    return _extremes_of_each_flight(errors.energy_error(case, synchronised=False), case)


@_metric("1", "invariant", requirements.keeps_energy_in_flight, signed=True, first_flight=True)
def energy_drift(case: Comparison | Motions) -> Array:
    """Change of the energy from the start to the end of the first flight, relative to the scene's energy."""
    energy = case.states.energy
    return (at_rows(energy, case.first_flight_end) - energy[..., 0]) / case.energy_scale


@_metric("1", "invariant", requirements.gains_no_energy)
def energy_gain(case: Comparison | Motions) -> Array:
    """Largest increase of the energy above any earlier value, relative to the scene's energy.

    Energy that a contact may have stored is added to the earlier value; it is at most the contact force times the depth of the lowest
    point. Earlier values at which the body may touch a wall are left out.
    """
    motions = case.motions if isinstance(case, Comparison) else case
    return motions.energy_gained / case.energy_scale


@_metric("1", "truth", requirements.has_apex, signed=True, agreement=True, first_flight=True)
def bounce_height_error(case: Comparison) -> float:
    """Apex height of the centre of mass after the first impact minus the exact apex height, relative to the drop height.

    If the exact body rises by less than 1 % of the drop height, because it rests, slides, rolls or turns on the floor, the apex is the
    greatest height that the body reaches, or would reach in free flight, at any time after its own first contact.
    """
    if (apexes := case.greatest_apexes) is not None:
        return (apexes[0] - apexes[1]) / case.clearance
    rows = case.flights_with_impact[1]
    actual, exact = (apex(case.scene, motion[rows]) for motion in (case.compared, case.exact))
    return float(np.mean(actual - exact)) / case.clearance


@_metric("1", "truth", requirements.has_newton_restitution, signed=True, first_flight=True)
def restitution_error(case: Comparison) -> float:
    """Ratio of separation speed to approach speed of the contact point in the first impact, minus the coefficient of restitution."""
    assert case.scene.floor is not None
    if not case.impacts or case.impacts[0] > case.motion.t[-1] - 3.0 * case.dt:
        raise Unresolved("the impact occurs in the last three time steps")
    if case.first_contact is None:
        return float("nan")  # there was no impact
    approach, separation = map(case.normal_velocity_of_struck_point, case.first_contact)
    if not approach < 0.0:
        return float("nan")  # the change of velocity was not an impact
    expected = 0.0 if -approach < case.scene.floor.rest_speed else case.scene.floor.restitution
    return -separation / approach - expected


@_metric("1", "invariant", requirements.has_impact, components=lambda case: case.moment_in_first_impact[np.newaxis], first_flight=True)
def contact_momentum_error(case: Comparison) -> float:
    """Change of the angular momentum about the contact point in the first impact, relative to M r v.

    M is the mass, r the distance of the contact point from the centre of mass, and v the speed before the impact. The exact change is 0,
    because the impulse acts at the contact point. The effect of gravity is subtracted.
    """
    return float(np.linalg.norm(case.moment_in_first_impact))


@_metric("1", "truth", requirements.comes_to_rest, signed=True)
def rest_time_error(case: Comparison) -> float:
    """Time at which the body comes to rest minus the exact time, relative to the exact time.

    The body counts as moving while its kinetic energy, including rotation, exceeds both M (2 g dt)²/2 and 1e-6 M g R. R is the distance of
    its farthest point from the centre of mass.
    """
    actual, exact = (float(motion.t[Motions.of(case.scene, motion).last_row_in_motion]) for motion in (case.compared, case.exact))
    if exact == 0.0:
        raise Unresolved(f"the body is never faster than 2 g dt, with dt = {case.dt:g} s")
    return (actual - exact) / exact


@_metric("m/s", "truth", requirements.comes_to_rest)
def rest_jitter(case: Comparison) -> float:
    """Root mean square of the vertical velocity in the last tenth of the scene, when the body is at rest in the exact solution."""
    rows = case.motion.t >= 0.9 * case.motion.t[-1]
    return float(np.sqrt(np.mean(case.motion.velocity[rows, 1] ** 2)))


@_metric("1", "truth", requirements.lands, signed=True, first_flight=True)
def landing_error(case: Comparison) -> float:
    """Ratio of the angular speeds three time steps after and three time steps before the first landing, minus the exact ratio."""
    edges = [0.0, *case.impacts[:2], case.exact.t[-1]]
    if min(edges[1] - edges[0], edges[2] - edges[1]) < SHORTEST_FLIGHT * case.dt:
        raise Unresolved(f"the body falls and rises again within {SHORTEST_FLIGHT} steps of {case.dt:g} s")
    rows = np.searchsorted(case.motion.t, case.impacts[0]) + np.array([-LANDING, LANDING])
    axis = case.exact.angular_velocity[rows[0]]
    actual, exact = (motion.angular_velocity[rows] @ axis for motion in (case.compared, case.exact))
    return float(actual[1] / actual[0] - exact[1] / exact[0])


@_metric("1/s", "truth", requirements.repeats_impacts)
def desync_rate(case: Comparison) -> float:
    """Reciprocal of the time at which the height error first reaches half the height of a flight (desynchronised); 0 if it never does."""
    return 1.0 / case.desynchronised_from


@_metric("1", "truth", requirements.spins, components=_at_end_of_each_flight(errors.angular_momentum_difference), agreement=True)
def angular_momentum_error(case: Comparison) -> Array:
    """Largest difference of the angular momentum from the exact angular momentum in flight, relative to the largest exact one."""
    return _largest_of_each_flight(errors.angular_momentum_error(case), case)


@_metric("rad", "truth", requirements.spins_in_flight)
def angular_momentum_direction_error(case: Comparison) -> Array:
    """Largest angle between the angular momentum and the exact angular momentum in flight."""
    return _largest_of_each_flight(errors.angular_momentum_direction_error(case), case)


@_metric("1", "invariant", requirements.keeps_horizontal_momentum)
def horizontal_momentum_error(case: Comparison) -> float:
    """Largest change of the horizontal velocity, relative to the speed at which the kinetic energy equals the scene's energy."""
    sideways = (case.motion.velocity - np.array(case.scene.start.velocity))[:, [0, 2]]
    speed = np.sqrt(2.0 * case.energy_scale / case.scene.body.mass)
    return float(np.max(length(sideways)) / speed)


@_metric("m", "truth", requirements.has_reference, components=_at_end_of_each_flight(errors.position_difference))
def position_error(case: Comparison) -> float:
    """Largest distance between the centre of mass and its exact or measured position."""
    return float(np.max(errors.position_error(case)))


@_metric("rad", "truth", requirements.has_reference, components=_at_end_of_each_flight(errors.orientation_difference))
def orientation_error(case: Comparison) -> float:
    """Largest angle of the rotation between the engine's orientation and the exact or measured orientation."""
    return float(np.max(errors.orientation_error(case)))


@_metric("m", "invariant", requirements.has_floor)
def penetration(case: Comparison | Motions) -> Array:
    """Largest depth of the body's lowest point below the floor."""
    return np.maximum(-case.states.lowest_height, 0.0).max(axis=-1)


@_metric("1", "invariant", requirements.obeys_contact_laws)
def contact_pull(case: Comparison) -> float:
    """Largest impulse with which the floor pulls the body in a time step, relative to M v.

    M is the mass, and v the speed at which the kinetic energy equals the scene's energy.
    """
    return _largest(case.contacts.pull)


@_metric("1", "invariant", requirements.limits_friction)
def friction_cone_excess(case: Comparison) -> float:
    """Largest excess of the impulse along the floor over friction coefficient times normal impulse, in a time step, relative to M v.

    M v is that of contact_pull.
    """
    return _largest(case.contacts.cone_excess)


@_metric("1", "invariant", requirements.opposes_slip_left)
def friction_push(case: Comparison) -> float:
    """Largest product of friction impulse and remaining slip in its direction, in a time step, relative to the scene's energy.

    It includes the product of torsional friction, which is the change of the vertical angular momentum, and the vertical spin.
    """
    return _largest(case.contacts.push)


@_metric("m", "invariant", requirements.obeys_contact_laws)
def contact_gap(case: Comparison) -> float:
    """Largest height of the body's lowest point, at both ends of a time step in a contact.

    A contact is a sequence of time steps in which the floor acts: gravity does not explain the change of velocity, and the lowest point is
    on the floor or the fall gains no speed. A sequence above the floor is a contact if it takes a quarter of the speed of the fall.
    """
    return _largest(case.contacts.gap)


def values_of(scene: Scenario, truth: Truth | None, motion: Trajectory) -> dict[str, float]:
    """Every metric that a scene has, of one motion, by name; NaN where the time step is too coarse."""
    case = Comparison.with_truth(scene, motion, truth)
    return {metric.name: metric.value_or_nan([case]) for metric in metrics_for(scene, truth)}


def leading_metric(scene: Scenario) -> str:
    """The leading metric of a scene with an exact solution: bounce height, else orientation if the body rotates, else position.

    With a recording it is the position.
    """
    if scene.recording is not None:
        return "position_error"
    truth = exact_solution(scene)
    names = {metric.name for metric in metrics_for(scene, truth)}
    if "bounce_height_error" in names:
        return "bounce_height_error"
    motion = truth(np.linspace(0.0, min(scene.duration, truth.horizon), 9))
    turned = angle_between_orientations(motion.orientation[:1], motion.orientation)
    return "orientation_error" if turned.max() > TURNED else "position_error"


def _largest(values: Array) -> float:
    """The largest of values that are not negative; 0 if there are none."""
    return float(values.max(initial=0.0))


def _largest_of_each_flight(values: Array, case: Comparison) -> Array:
    """The largest value in each flight, of values that are not negative, shape (flights,)."""
    return np.array([values[rows].max() for rows in case.flights_with_impact])


def _extremes_of_each_flight(values: Array, case: Comparison) -> Array:
    """The largest and the smallest value in each flight, shape (flights, 2), which may converge with different orders."""
    return np.array([(values[rows].max(), values[rows].min()) for rows in case.flights_with_impact])
