"""What an adapter may round: the start, to a few ulp."""

import numpy as np
import pytest
from support import engines as made

from comparisons.running.verification import BuildMismatch, verify_start
from scenarios import load
from scenarios.rotations import rotate, unrotate
from scenarios.state import ORIENTATION, SPIN


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
    assert largest > 2e-15  # 9 ulp and more do occur
