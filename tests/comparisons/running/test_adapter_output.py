"""What an adapter may round: the start, to a few eps; and the verification of a batch as a whole."""

import numpy as np
import pytest
from support import engines as made

from dropspin.comparisons.engines.base import BatchSimulation
from dropspin.comparisons.running.adapter_output import (
    BuildMismatch,
    verified_batch,
    verified_record,
    verify_build,
    verify_start,
    verify_starts,
)
from dropspin.scenarios import load
from dropspin.scenarios.model import initial_states
from dropspin.scenarios.rotations import rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, SPIN, VELOCITY


def test_a_spin_may_be_rotated_to_the_body_s_axes_and_back():
    """By a quaternion of rounded length, as an engine does whose angular velocity is along the body's axes; 1e-13 is too much."""
    ball = load({"duration": 1.0, "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0}})
    random = np.random.default_rng(0)
    largest = 0.0
    for _ in range(1000):
        quaternion = random.normal(size=4)
        start = np.zeros(13)
        start[ORIENTATION] = quaternion / np.linalg.norm(quaternion) * (1.0 + 1.1e-16 * random.integers(-2, 3))
        start[SPIN] = random.normal(size=3)
        scene = ball.starting_at(start)
        state = scene.initial_state
        state[SPIN] = rotate(state[ORIENTATION], unrotate(state[ORIENTATION], start[SPIN]))
        verify_start(made.Exact(), scene, state)
        largest = max(largest, float(np.abs(state[SPIN] - start[SPIN]).max() / np.abs(start[SPIN]).max()))
        state[SPIN] = start[SPIN] * (1.0 + 1e-13)
        with pytest.raises(BuildMismatch, match="angular velocity at the start"):
            verify_start(made.Exact(), scene, state)
    assert largest > 2e-15  # 9 eps and more do occur


def test_a_velocity_that_is_what_rounding_leaves_may_be_rounded_again():
    """At 120 rad/s the points of the ball move at 12 m/s, of which 2e-15 m/s is an eps; a difference of 1e-12 m/s is none."""
    ball = load({"duration": 1.0, "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0}})
    start = ball.initial_state
    start[SPIN], start[VELOCITY] = [0.0, 120.0, 0.0], [1.758e-15, 0.0, 0.0]
    scene = ball.starting_at(start)
    state = scene.initial_state
    state[VELOCITY] = [1.776e-15, 0.0, 0.0]
    verify_start(made.Exact(), scene, state)
    state[VELOCITY] = [1e-12, 0.0, 0.0]
    with pytest.raises(BuildMismatch, match="velocity at the start"):
        verify_start(made.Exact(), scene, state)


def test_a_state_may_be_a_list():
    class Listed(made.ExactSimulation):
        def state(self):
            return super().state().tolist()

    scene = load("spin-principal")
    verify_build(made.Exact(), scene, Listed(scene, 1e-3), 1e-3)


def motions_of_a_batch():
    states = np.zeros((40, 3, 13))
    states[:, :, 6] = 1.0
    return states


@pytest.mark.parametrize("length", [1.0 + 2e-5, 1.0 - 2e-5])
def test_one_wrong_quaternion_in_a_batch_is_found(length):
    states = motions_of_a_batch()
    states[39, 1, 6] = 1.0 + 0.9e-5
    assert len(verified_batch(states, 40, 3)) == 40
    states[39, 1:, 6] = 1.0, length
    with pytest.raises(BuildMismatch, match="quaternion of row 2"):
        verified_batch(states, 40, 3)
    states[39, 2, 7] = np.nan  # a divergence, which has a verdict of its own
    assert np.isnan(verified_batch(states, 40, 3)[39]).any()


def test_record_in_memory_of_the_engine_is_copied():
    """The engine may use it for its next simulation, or free it."""
    states = motions_of_a_batch()
    batch, motion = verified_batch(states, 40, 3), verified_record(states[0], 3)
    states[:] = 2.0
    assert (batch.max(), motion.max()) == (1.0, 1.0)


def test_record_of_single_precision_and_of_a_divergence_are_converted_and_kept():
    states = motions_of_a_batch().astype(np.float32)
    states[7, 2, 3:7] = 0.5, -0.5, 0.5, -0.5
    states[9, 2, 0] = np.inf
    found = verified_batch(states, 40, 3)
    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, states)
    with pytest.raises(BuildMismatch, match="complex numbers"):
        verified_batch(states.astype(complex), 40, 3)
    with pytest.raises(BuildMismatch, match="40 motions were asked for"):
        verified_batch(states[:39], 40, 3)


def test_starts_of_many_scenes_are_those_of_each():
    ball = load({"duration": 1.0, "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0}})
    random = np.random.default_rng(0).normal(size=(5, 13))
    scenes = [ball.starting_at(state) for state in random]
    np.testing.assert_array_equal(initial_states(scenes), [scene.initial_state for scene in scenes])


def test_one_wrong_start_in_a_batch_is_named():
    ball = load({"duration": 1.0, "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0}})
    starts = motions_of_a_batch()[:, 0]
    starts[:, 0] = np.arange(40.0)
    scenes = [ball.starting_at(start) for start in starts]
    starts[5, 3:7] *= -1.0  # the same orientation
    verify_starts(made.Exact(), scenes, starts)
    starts[37, 0] = 38.0
    with pytest.raises(BuildMismatch, match=r"position at the start of simulation 38 of 40 is \[38\. .* the scene has \[37\. "):
        verify_starts(made.Exact(), scenes, starts)


class OfAnotherLibrary:
    """An array that offers one way of reading it."""

    def __init__(self, values, way):
        self._values, self.way = values, way

    def __getattr__(self, name):
        if name not in {self.way, "__dlpack_device__"}:
            raise AttributeError(name)
        return getattr(self._values, name)


@pytest.mark.parametrize("way", ["__array__", "__array_interface__", "__dlpack__"])
@pytest.mark.parametrize("number", [np.float32, np.float64])
def test_states_of_another_library_are_read_in_the_way_that_it_offers(way, number):
    class Elsewhere(made.Together):
        def states(self):
            return OfAnotherLibrary(super().states().astype(number), way)

    scene = load("spin-principal")
    starts = [scene, scene.model_copy(update={"duration": 1.0})]
    found = Elsewhere([made.Exact().prepare(start, 1e-2) for start in starts], None)
    recorded = BatchSimulation.record(found, 4)
    again = made.Exact().prepare(scene, 1e-2)
    expected = again.record(4, 1).astype(number)
    np.testing.assert_array_equal(recorded, [expected, expected])
    np.testing.assert_array_equal(verified_batch(OfAnotherLibrary(recorded, way), 2, 5), recorded)
