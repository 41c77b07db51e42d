"""The symptoms of a motion that no known fault explains: which quantities differ from the exact solution, and by how much."""

import math
from collections.abc import Iterator

import numpy as np

from dropspin.comparisons.conformance.impacts import turning_impulse
from dropspin.comparisons.conformance.outcomes import digits_that_differ, instead
from dropspin.comparisons.conformance.point_beside_centre import off_centre
from dropspin.comparisons.conformance.probes import Probe, differences
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.scenarios import Trajectory
from dropspin.scenarios.rotations import length, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, RATES, SPIN, VELOCITY, Array
from dropspin.scenarios.text import counted, rounded
from dropspin.scenarios.truths import exact_solution

QUANTITIES = (("position", "m"), ("attitude", "rad"), ("velocity", "m/s"), ("angular velocity", "rad/s"))
"""Those of `differences`."""
CLEAR = 1e-3
"""Share of a speed, and ratio of a friction impulse, from which a difference is stated."""
NONE = 0.05
"""Size of a negative restitution that counts as none: a contact has then nearly ended."""
SLEEPY = 0.1
"""Share of the largest speed of a fall below which an engine may put a body to sleep."""
ALONG = 0.1
"""Change of the direction of an angular momentum, over the fall of its size, from which damping is not the only explanation; and that of an
acceleration from which its size is not all that is wrong.
"""
ELSEWHERE = 0.1
"""Change of angular momentum about the contact point, over M r v, from which it is stated."""
TURNED = math.radians(1.0)
"""Angle from which the direction of friction is stated to be wrong."""


def symptoms(probe: Probe, motion: Trajectory) -> Iterator[str]:
    """What is wrong in an engine's motion of a probe, the most specific first; at least one sentence."""
    rows, exact = motion.states, probe.exact
    if not np.isfinite(rows).all():
        yield "the state is not finite"
        return
    if probe.scene.floor is not None:
        yield from _of_first_contact(probe, Comparison.with_truth(probe.scene, motion, exact_solution(probe.scene)))
    elif off := off_centre(probe.scene, motion, exact_solution(probe.scene)(motion.t).position):
        yield off
        return
    elif not np.any(rows[-1, RATES]) and np.any(exact[-1, RATES]):
        yield "the body stops: the engine puts it to sleep"
        return
    elif probe.scene.gravity is None:
        yield from _of_flight(probe, rows[probe.rows], exact)
    elif probe.scene.damping is None:
        yield from _of_fall(probe, motion)
    for (name, unit), error, allowed in zip(QUANTITIES, differences(rows[probe.rows], exact), probe.allowed, strict=True):
        if not error <= allowed:
            yield f"{name} is off by {error:.{min(digits_that_differ(error, allowed), 4)}g} {unit} (allowed: {allowed:g} {unit})"


def _of_flight(probe: Probe, states: Array, exact_states: Array) -> Iterator[str]:
    """Speeds at the end of a motion without gravity and floor; of unequal moments the angular momentum, as the angular speed varies.

    Velocities that are wrong beside right positions, or angular velocities beside right attitudes, are not due to damping.
    """
    scene, end, exact = probe.scene, states[-1], exact_states[-1]
    (position, attitude, *_), inertia = differences(states, exact_states), scene.body.inertia_tensor
    spin = ("angular velocity", "rad/s", end[SPIN], exact[SPIN])
    if np.ptp(np.linalg.eigvalsh(inertia)) > CLEAR * inertia.max():
        got, right = (rotate(state[ORIENTATION], inertia @ unrotate(state[ORIENTATION], state[SPIN])) for state in (end, exact))
        spin = ("angular momentum", "kg m²/s", got, right)
    speeds = (("speed", "m/s", end[VELOCITY], exact[VELOCITY]), position, VELOCITY), (spin, attitude, SPIN)
    for (quantity, unit, got, right), off, part in speeds:
        final, expected = float(np.linalg.norm(got)), float(np.linalg.norm(right))
        if abs(final - expected) > CLEAR * expected and (expected > 0.0 or final > probe.allowed[2 if part is VELOCITY else 3]):
            too_fast, too_slow = "", "damping or a clamp that the scene does not have: "
            if scene.damping is not None:
                too_fast, too_slow = "damping is missing or too weak: ", "damping is too strong, or a clamp: "
            elif quantity == "angular momentum" and end[SPIN] @ got >= exact[SPIN] @ right:
                too_slow = ""  # damping lowers the energy too
            elif quantity == "angular momentum" and np.linalg.norm(got - right * final / expected) > ALONG * (expected - final):
                too_slow = "damping, a clamp or a wrong gyroscopic term: "  # damping in proportion to the momentum does not turn it
            why, beside = too_slow if final < expected else too_fast, ""
            if off <= CLEAR * float(np.linalg.norm(exact[part])) * scene.duration:
                why, beside = "", f", beside {'positions' if quantity == 'speed' else 'attitudes'} that are right"
            yield f"{why}the final {quantity} is {instead(final, expected, unit)}{beside}"


def _of_fall(probe: Probe, motion: Trajectory) -> Iterator[str]:
    """The acceleration of a fall along gravity, if velocities and positions show the same one, unlike with drag, and it is wrong."""
    right, time, start = probe.scene.acceleration, motion.t[-1], motion.velocity[0]
    size = float(np.linalg.norm(right))
    wrong = (motion.velocity[-1] - start) / time - right
    by_position = 2.0 * (motion.position[-1] - motion.position[0] - time * start) / time**2 - right
    along = float(wrong @ right) / size
    apart = np.linalg.norm(by_position - wrong) + np.linalg.norm(wrong - along * right / size)
    first_order = size * motion.t[1] / time
    if abs(along) * time > probe.allowed[2] and apart <= ALONG * abs(along) + first_order:
        yield f"the acceleration is {instead(size + along, size, 'm/s²')}"


def _of_first_contact(probe: Probe, case: Comparison) -> Iterator[str]:
    """The place of the first contact, and its impulse along the normal and along the floor, over the mass."""
    scene, first = probe.scene, case.first_contact
    assert scene.floor is not None
    allowed_position, _, allowed, _ = probe.allowed
    if first is None:
        stays = scene.starts_above_floor and np.ptp(case.motion.position[:, 1]) <= allowed_position
        held = "the body does not fall: gravity is missing, or the floor supports it from the first step on"
        passes = bool(np.min(case.states.lowest_height) < 0.0)
        above = "the body stays above the floor: the engine puts it to sleep or holds it, or gravity is too weak"
        yield held if stays else "the floor does not change the velocity" if passes else above
        return
    before, after = first
    height, left = float(case.motion.position[before, 1]), float(case.states.lowest_height[after])
    is_slow = length(case.motion.velocity[before]) < SLEEPY * length(case.exact.velocity).max()
    if left > allowed_position and is_slow and not case.motion.velocity[after].any():
        yield f"the body stops {left:.2g} m above the floor: the engine puts it to sleep, or holds it"
        return
    if case.impacts:
        times, step = case.motion.t, 2.0 * case.dt
        impact = float(np.interp(case.impacts[0], case.exact.t, case.exact.position[:, 1]))
        if abs(height - impact) > allowed_position + step * abs(float(case.motion.velocity[before, 1])):
            yield f"the first contact begins at a height of {instead(height, impact, 'm')}"
            if not scene.body.is_ball:  # it touches elsewhere, so that the impulse at the exact contact point says nothing
                return
        # The impact of the engine may be a step or two early or late; the next one is another.
        before = min(before, int(np.searchsorted(times, case.impacts[0] - step)))
        end = case.impacts[1] if len(case.impacts) > 1 else times[-1]
        after = min(max(after, int(np.searchsorted(times, case.impacts[0] + step))), int(np.searchsorted(times, end - step)))
    duration = (after - before) * case.dt
    change, exact = (rows.velocity[after] - rows.velocity[before] - duration * scene.acceleration for rows in (case.motion, case.exact))
    if turning := turning_impulse(scene, case.motion.states[[before, after]]):
        yield turning
        return
    if case.impacts and abs(change[1] - exact[1]) > allowed:
        sampled = Comparison(scene, case.exact, case.exact, case.impacts)
        wrong, right = (METRICS["restitution_error"].value_or_nan([compared]) for compared in (case, sampled))
        # An impact at another phase of the step changes both speeds by as much as gravity does in a step.
        speed, gained = abs(float(case.motion.velocity[before, 1])), case.dt * float(np.linalg.norm(scene.acceleration))
        if abs(wrong - right) * speed > CLEAR * speed + (1.0 + scene.floor.restitution) * gained:
            restitution = scene.floor.restitution + wrong - right
            restitution = 0.0 if -NONE < restitution < 0.0 else restitution
            later = case.motion.velocity[after : after + 2]
            lasts = len(later) > 1 and length(later[1] - later[0] - case.dt * scene.acceleration) > CLEAR * speed
            if restitution < 0.0 and lasts:
                steps = counted(after - before, "step")
                yield f"the first contact has not ended after {steps}, when the body moves down at {-float(later[0, 1]):.2g} m/s"
            else:
                yield f"restitution is {instead(restitution, scene.floor.restitution)}"
    moment = METRICS["contact_momentum_error"]
    if moment.applies(scene, exact_solution(scene)) and (turned := moment.value_or_nan([case])) > ELSEWHERE:
        yield (
            "an impulse at the contact point does not explain the change of the velocities in the first contact: the angular momentum "
            f"about it changes by {turned:.2g} of mass × distance from the centre × speed"
        )
    if float(np.linalg.norm((change - exact)[[0, 2]])) > allowed:
        yield from _of_friction(change, exact)


def _of_friction(change: Array, exact: Array) -> Iterator[str]:
    """The size of the friction impulse over the normal one, and its direction."""
    strength, expected = (float(np.linalg.norm(impulse[[0, 2]]) / impulse[1]) for impulse in (change, exact))
    if abs(strength - expected) > CLEAR:
        yield f"the ratio of the friction impulse to the normal impulse is {instead(strength, expected)}"
    angle = abs(math.remainder(math.atan2(change[0], change[2]) - math.atan2(exact[0], exact[2]), math.tau))
    if strength > CLEAR and expected > CLEAR and angle > TURNED:
        yield f"friction acts {rounded(math.degrees(angle), 2)}° from its exact direction"
