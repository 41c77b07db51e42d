"""Motions of two runs compared bit for bit."""

import itertools

import numpy as np
import pytest
from support import engines as made

from dropspin.comparisons.regressions.changes import EqualMotions, equal_motions
from dropspin.comparisons.regressions.comparing import compare
from dropspin.comparisons.running.run import run

DT = 4e-3


def same(state, time):
    return state


def one_ulp_after_a_tenth_of_a_second(state, time):
    state = state.copy()
    state[1] = np.nextafter(state[1], np.inf) if time > 0.1 else state[1]
    return state


@pytest.mark.extended
@pytest.mark.parametrize("engine", ["wang", "mujoco"])
def test_repeated_run_has_equal_motions(engine):
    """Two runs, in processes of their own."""
    found = compare(*(run(["drop-box-anyhow", "spin-asymmetric"], [engine], DT) for _ in range(2)))
    assert found.motions == [EqualMotions(engine, 2, 2)]


def test_noise_of_one_ulp_is_found_in_its_first_step():
    """The time first exceeds 0.1 s after step 26 of 4 ms."""
    before, after = (
        run(["drop-ball", "spin-asymmetric"], [made.engine_with("engine", distort), "wang"], DT)
        for distort in (same, one_ulp_after_a_tenth_of_a_second)
    )
    assert compare(before, after).motions == [EqualMotions("engine", 0, 2, "drop-ball", DT, 26), EqualMotions("wang", 2, 2)]


@pytest.mark.extended
def test_dependence_on_the_order_of_scenes_is_found():
    """A state that outlives a simulation: the second scene of a run starts from another one."""

    class Counting(made.Exact):
        name = "counting"
        prepared = itertools.count()

        def prepare(self, scene, dt):
            number = next(self.prepared)
            damping = 1e-12 * number
            return made.ExactSimulation(scene, dt, lambda state, time: state * np.array([1.0 - damping * time, *np.ones(12)]))

    scenes = ["drop-ball-backspin", "fall-spin"]
    first, second = (run(order, [Counting()], DT, jobs=1) for order in (scenes, scenes[::-1]))
    [found] = equal_motions(first, second)
    assert found.equal < found.compared == 2


def test_nan_equals_itself():
    """A motion that diverged in the same way is the same motion."""
    before, after = (run("drop-ball", [made.engine_with("nan", made.nan_after_half_a_second)], DT) for _ in range(2))
    assert all(one.equal == one.compared for one in equal_motions(before, after))
