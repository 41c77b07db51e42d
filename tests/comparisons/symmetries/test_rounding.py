"""Symmetries of engines whose rounding is large, and of engines that do not repeat their motion."""

import numpy as np
import pytest
from support import engines as made

from dropspin.comparisons.measuring.symmetries import AGAIN, HALVES, SYMMETRIES
from dropspin.comparisons.symmetries.study import symmetries
from dropspin.scenarios import load


def statuses(engine, scene, dt=4e-3):
    return {one.symmetry: one for one in symmetries(scene, engine, dt=dt)}


@pytest.mark.parametrize(("drift", "status"), [(0.0, "rounding"), (1e-3, "lost")])
def test_rounding_in_sub_steps_explains_a_difference_far_away(drift, status):
    """A position that is added up in 64 sub-steps of each step is rounded to 1e-10 m in each, a thousand kilometres away."""

    class Adding(made.ExactSimulation):
        def record(self, steps, every=1):
            rows, start = super().record(steps, every), self._start
            steps_of_position = np.tile(start[7:10] * self._dt / 64, (64 * steps, 1))
            rows[1:, :3] = np.cumsum(np.concatenate([start[None, :3], steps_of_position]), axis=0)[64::64]
            rows[:, 0] += drift * self._dt * np.arange(len(rows)) * (abs(start[0]) > 1e5)
            return rows

    engine_ = type("SubSteps", (made.Exact,), {"prepare": lambda self, scene, dt: Adding(scene, dt)})()
    body = {"shape": "sphere", "radius": 0.1, "mass": 1.0}
    scene = load({"duration": 2.0, "body": body, "start": {"velocity": [0.1, 0.07, -0.03], "angular_velocity": [1.0, 2.0, 3.0]}})
    found = statuses(engine_, scene, dt=1e-3)
    assert (found["1000 km away"].status, found["1000 km away"].difference > 1e-5) == (status, True)
    assert found["1 km away"].status in ("kept", "nearly kept")


@pytest.mark.parametrize(("planted", "status"), [(0, "kept"), (9, "rounding"), (11, "lost")])
def test_rounding_far_away_explains_no_difference_of_rotation_in_flight(planted, status):
    """In single precision, an error of 1 % in a velocity or in a spin beyond 5 m; no rounding of a position changes a spin."""

    class Far(made.Exact):
        precision = np.float32

        def prepare(self, scene, dt):
            is_far = np.linalg.norm(scene.start.position) > 5.0
            error = np.ones(13)
            error[planted] += 1e-2 * is_far * (planted > 0)
            return made.ExactSimulation(scene, dt, lambda state, time: state * error if time > 0.5 else state)

    body = {"shape": "box", "half_extents": [0.1, 0.1, 0.1], "mass": 1.0}
    scene = load({"duration": 2.0, "body": body, "start": {"velocity": [0.1, 0.07, -0.3], "angular_velocity": [1.0, 2.0, 3.0]}})
    assert statuses(Far(), scene, dt=1e-3)["10 m away"].status == status


@pytest.mark.parametrize("precision_of_it", [np.float64, np.float32])
def test_engine_that_does_not_repeat_its_motion_says_nothing_of_symmetries(precision_of_it):
    """State that it keeps would be attributed to rounding, of which the effect is measured with the same engine."""

    class Leaking(made.Exact):
        precision, runs = precision_of_it, 0

        def prepare(self, scene, dt):
            type(self).runs += 1
            push = 1e-4 * type(self).runs
            return made.ExactSimulation(scene, dt, lambda state, time: state + push * np.eye(13)[0])

    found = statuses(Leaking(), "fall-spin")
    assert found[AGAIN].status == "lost"
    reasons = {one.reason for name, one in found.items() if name in SYMMETRIES or name == HALVES}
    assert reasons == {"the engine does not repeat its own motion, so that a difference from another one says nothing of a symmetry"}


@pytest.mark.parametrize("first", [0, 1])
def test_engine_that_alternates_between_two_motions_does_not_repeat_its_own(first):
    """Perturbed starts are an even number of runs apart, or an odd one: what alternates would be attributed to rounding."""

    class Alternating(made.Exact):
        compiles, runs = True, first

        def prepare(self, scene, dt):
            type(self).runs += 1
            push = 0.02 * (type(self).runs % 2) * np.eye(13)[1]
            return made.ExactSimulation(scene, dt, lambda state, time: state + push)

    assert statuses(Alternating(), "fall-spin")[AGAIN].status == "lost"


def test_difference_that_a_repeated_run_has_too_is_not_attributed_to_rounding():
    """The fourth and later simulations of a process are displaced by 5e-8, and so are those from perturbed starts."""

    class Counting(made.Exact):
        runs = 0

        def prepare(self, scene, dt):
            type(self).runs += 1
            push = 5e-8 * (type(self).runs > 3) * np.eye(13)[1]
            return made.ExactSimulation(scene, dt, lambda state, time: state + push * (time > 0.1))

    found = statuses(Counting(), "fall-spin")
    assert found[AGAIN].status == "nearly kept"
    assert (found["in grams"].status, found["in grams"].step) == ("nearly kept", found[AGAIN].step)
    assert found["turned by 90°"].status == "kept"  # the second simulation: no difference
