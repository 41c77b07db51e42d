"""The time steps that a scene may be run with."""

import re

import pytest

from dropspin.comparisons.running.arguments import FEWEST_STEPS, MOST_STEPS, verify_time_step
from dropspin.scenarios import DropspinError, load

BODY = {"shape": "sphere", "radius": 0.1, "mass": 1.0}


@pytest.mark.parametrize(("engines", "most"), [(0, MOST_STEPS), (1, 400_000), (3, 333_333)])
@pytest.mark.parametrize("duration", [2000.0, 600.0, 1.0 / 3.0, 0.7, 1e-3])
def test_bounds_of_the_message_are_time_steps_that_are_accepted(duration, engines, most):
    """The message of a step that is too long or too short names the bound that it passes; so many steps are accepted, exactly."""
    scene = load({"duration": duration, "body": BODY})
    for dt in (duration / most, duration / FEWEST_STEPS):
        verify_time_step(scene, dt, engines)
    for dt in (duration / (most + 2), duration / (FEWEST_STEPS - 1), 1e-310):
        with pytest.raises(DropspinError) as caught:
            verify_time_step(scene, dt, engines)
        [(word, bound)] = re.findall(r"at (least|most) ([\d.e-]+) s", str(caught.value))
        assert word == ("least" if dt < duration / most else "most")
        verify_time_step(scene, float(bound), engines)
