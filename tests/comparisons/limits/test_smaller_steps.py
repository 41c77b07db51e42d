"""Smaller time steps, tried where an engine is not sound at the nominal one."""

import numpy as np
import pytest
from support.engines import Crashing, Declining, Exact, ExactSimulation, Frozen, turned_by

from dropspin.comparisons.limits.study import find_limits
from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.scenarios import load

QUICK = ResourceLimits(processor_time=20.0)
SPIN = load("spin-principal")


class Turned(Exact):
    """The exact motion, turned by an angle in proportion to the time step and the time, and by the angle `off`."""

    off = 0.0

    def __init__(self, off):
        super().__init__()
        self.name, self.off = f"turned-{1e3 * off:g}-mrad", off

    def prepare(self, scene, dt):
        spin = np.linalg.norm(scene.start.angular_velocity)

        def distort(state, time):
            return turned_by(0.02 * spin * dt * time + self.off)(state, time)

        return ExactSimulation(scene, dt, distort)


@pytest.mark.extended
def test_smaller_steps_are_tried_where_the_nominal_one_is_not_sound():
    """The attitude error of a spin of 5 rad/s for 10 s is dt s⁻¹: 0.04 rad at 40 ms; a model error of 0.2 rad stays at any step."""
    scene = SPIN.model_copy(update={"duration": 10.0})
    spin = np.linalg.norm(scene.start.angular_velocity)
    within = 0.02 * spin * 10.0 * 0.01 * 1.5  # the error at 15 ms
    found = find_limits(scene, [Turned(0.0), Turned(0.2)], ["spin"], dt=0.04, within=within, resources=QUICK)
    converging, stays = (found.refinements[name] for name in ("turned-0-mrad", "turned-200-mrad"))
    assert [(point.value, point.mode) for point in converging] == [(0.04, "inaccurate"), (0.02, "inaccurate"), (0.01, "sound")]
    assert converging[0].diagnosis.size == pytest.approx(0.02 * spin * 10.0 * 0.04, rel=1e-6)
    assert f"(tolerance {within:g})" in converging[0].diagnosis.message
    assert [point.value for point in stays] == [0.04 / 2**n for n in range(7)]
    assert {point.mode for point in stays} == {"inaccurate"}


def test_smaller_steps_are_part_of_the_scan_of_steps():
    found = find_limits(SPIN, [Turned(0.0)], ["step"], dt=2e-3, within=1.2e-3, resources=QUICK)
    steps = found.steps("turned-0-mrad")
    assert [point.value for point in steps] == sorted(point.value for point in steps)
    assert {point.value for point in found.refinements["turned-0-mrad"]} <= {point.value for point in steps}
    (_, accurate), _ = found.step_ranges("turned-0-mrad")
    assert 1e-3 <= accurate == pytest.approx(1.2e-3, rel=0.03)  # the error is dt s⁻¹


def test_smaller_steps_with_a_floor_are_as_many_as_can_be_recorded():
    """From runs without every step, impacts are not judged, and an engine would be sound by chance."""
    ball = load("drop-ball")
    found = find_limits(ball, [Frozen()], ["restitution"], dt=ball.duration / 8000, resources=QUICK)
    assert [ball.steps(point.value) for point in found.refinements["frozen"]] == [8000, 16000]


@pytest.mark.parametrize("engine_of_it", [Exact(), Crashing(), Declining()])
def test_no_smaller_step_is_tried_of_an_engine_that_is_sound_or_does_not_run(engine_of_it):
    found = find_limits(SPIN, [engine_of_it], ["mass"], resources=QUICK)
    assert [point.value for point in found.refinements[engine_of_it.name]] == [5e-3]
