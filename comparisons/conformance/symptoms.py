"""Symptoms of a motion that no known fault explains: what differs from the exact solution, and by how much. What is right is left out."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.conformance.probes import Probe, differences
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.scenarios import Scenario, Trajectory, truth_for
from dropspin.scenarios.state import RATES, SPIN, VELOCITY
from dropspin.scenarios.text import rounded

Array = NDArray[np.float64]

QUANTITIES = (("position", "m"), ("attitude", "rad"), ("velocity", "m/s"), ("angular velocity", "rad/s"))
"""Those of `differences`."""
CLEAR = 1e-3
"""Share of a speed, and ratio of a friction impulse, from which a difference is stated."""
TURNED = math.radians(1.0)
"""Angle from which the direction of friction is stated to be wrong."""


def symptoms(probe: Probe, motion: Trajectory) -> list[str]:
    """What is wrong in an engine's motion of a probe, the most specific first; at least one sentence."""
    rows = motion.states
    if not np.isfinite(rows).all():
        return ["the state is not finite"]
    truth = truth_for(probe.scene)
    assert truth is not None
    exact = truth(probe.times).states
    if probe.scene.floor is not None:
        found = [*_of_first_contact(probe, Comparison.with_truth(probe.scene, motion, truth))]
    elif not np.any(rows[-1, RATES]) and np.any(exact[-1, RATES]):
        return ["the body stops: the engine puts it to sleep"]
    else:
        found = [*_of_flight(probe.scene, rows[-1], exact[-1])] if probe.scene.gravity is None else []
    errors = differences(rows[probe.rows], exact)
    beyond = [
        f"{name} is off by {error:.{min(_digits(error, allowed), 4)}g} {unit} (allowed: {allowed:g} {unit})"
        for (name, unit), error, allowed in zip(QUANTITIES, errors, probe.allowed, strict=True)
        if not error <= allowed
    ]
    return [*found, *beyond]


def _of_flight(scene: Scenario, end: Array, exact: Array) -> Iterator[str]:
    """Speeds at the end of a motion without gravity and floor."""
    for what, unit, part in (("speed", "m/s", VELOCITY), ("angular velocity", "rad/s", SPIN)):
        final, expected = (float(np.linalg.norm(state[part])) for state in (end, exact))
        if abs(final - expected) > CLEAR * expected:
            too_fast, too_slow = "", "damping or a clamp that the scene does not have: "
            if scene.damping is not None:
                too_fast, too_slow = "damping is missing or too weak: ", "damping is too strong, or a clamp: "
            yield f"{too_slow if final < expected else too_fast}the final {what} is {_instead(final, expected, unit)}"


def _of_first_contact(probe: Probe, case: Comparison) -> Iterator[str]:
    """The place of the first contact, and its impulse along the normal and along the floor, over the mass."""
    scene, first = probe.scene, case.first_contact
    assert scene.floor is not None
    if first is None:
        yield "the floor does not change the velocity"
        return
    before, after = first
    allowed_position, _, allowed, _ = probe.allowed
    height = float(case.motion.position[before, 1])
    if case.impacts:
        times, step = case.motion.t, 2.0 * case.dt
        impact = float(np.interp(case.impacts[0], case.exact.t, case.exact.position[:, 1]))
        if abs(height - impact) > allowed_position + step * abs(float(case.motion.velocity[before, 1])):
            yield f"the first contact begins at a height of {_instead(height, impact, 'm')}"
        # The impact of the engine may be a step or two early or late; the next one is another.
        before = min(before, int(np.searchsorted(times, case.impacts[0] - step)))
        end = case.impacts[1] if len(case.impacts) > 1 else times[-1]
        after = min(max(after, int(np.searchsorted(times, case.impacts[0] + step))), int(np.searchsorted(times, end - step)))
    duration = (after - before) * case.dt
    found, exact = (rows.velocity[after] - rows.velocity[before] - duration * scene.acceleration for rows in (case.motion, case.exact))
    if case.impacts and abs(found[1] - exact[1]) > allowed:
        sampled = Comparison(scene, case.exact, case.exact, case.impacts)
        wrong, right = (METRICS["restitution_error"].value_or_nan([one]) for one in (case, sampled))
        if abs(wrong - right) > CLEAR:
            yield f"restitution is {_instead(scene.floor.restitution + wrong - right, scene.floor.restitution)}"
    if float(np.linalg.norm((found - exact)[[0, 2]])) > allowed:
        yield from _of_friction(found, exact)


def _of_friction(found: Array, exact: Array) -> Iterator[str]:
    """The size of the friction impulse over the normal one, and its direction."""
    strength, expected = (float(np.linalg.norm(impulse[[0, 2]]) / impulse[1]) for impulse in (found, exact))
    if abs(strength - expected) > CLEAR:
        yield f"the impulse of friction over that of the normal force is {_instead(strength, expected)}"
    angle = abs(math.remainder(math.atan2(found[0], found[2]) - math.atan2(exact[0], exact[2]), math.tau))
    if strength > CLEAR and expected > CLEAR and angle > TURNED:
        yield f"friction acts {rounded(math.degrees(angle), 2)}° from its exact direction"


def _instead(found: float, expected: float, unit: str = "") -> str:
    """Two numbers with so many digits that they differ, and the difference as a share of the expected one."""
    value = f"{found:.{_digits(found, expected)}g}{f' {unit}' if unit else ''} instead of {rounded(expected, 6)}"
    if expected == 0.0:
        return value
    return f"{value} ({rounded(100.0 * abs(found / expected - 1.0), 2)} % too {'high' if abs(found) > abs(expected) else 'low'})"


def _digits(found: float, expected: float) -> int:
    """Significant digits in which two numbers differ."""
    return 2 + max(0, math.ceil(math.log10(abs(expected / (found - expected))))) if expected and found != expected else 3
