"""The compiled kernels compared with a plain transcription of the lecture note."""

import numpy as np
import pytest
from support.transcription import update

from dropspin import reference_impl
from dropspin.reference_impl import Body, Floor, World
from dropspin.reference_impl.state import ORIENTATION, SPIN, VELOCITY

GRAVITY = np.array([0.0, -9.8, 0.0])
STEPS = 50


def tumbling_box(seed: int):
    """A random box, tilted and spinning, that reaches the floor within a few steps, and its state."""
    rng = np.random.default_rng(seed)
    half = rng.uniform(0.05, 0.6, 3)
    points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    mass = rng.uniform(0.2, 5.0)
    inertia = reference_impl.solid_box_inertia(mass, half)
    q = rng.normal(size=4)
    state = np.concatenate([[0, 0, 0], q / np.linalg.norm(q), rng.normal(size=3) - [0, 3, 0], 3 * rng.normal(size=3)])
    lowest = min((rotated := reference_points(state, points))[:, 1])
    assert len(rotated) == 8
    state[1] = 0.02 - lowest
    return Body(mass, inertia, points), state


def reference_points(state, points):
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(state[ORIENTATION]).apply(points)


@pytest.mark.sample(6)
@pytest.mark.parametrize("sticking", [False, True], ids=["eq15", "eq17"])
@pytest.mark.parametrize("seed", range(12))
def test_fifty_steps_through_contacts_match_the_transcription(seed, sticking):
    """Position, orientation, velocity and spin agree to 1e-12 of each one's scale (measured: up to 6e-14)."""
    body, state = tumbling_box(seed)
    rest_speed = 0.3 if seed % 3 == 0 else 0.0
    rates = (0.4, 0.9) if seed % 2 == 0 else None
    dt = 1 / 240
    world = World(GRAVITY, Floor(0.6, np.inf if sticking else 0.0, rest_speed), rates)
    c = np.exp(-dt * np.array(rates or (0.0, 0.0)))

    found = reference_impl.simulate(state, body, world, dt, STEPS)

    expected = [state]
    hits = 0
    for _ in range(STEPS):
        after = update(expected[-1], body.mass, body.inertia, body.points, dt, GRAVITY, *c, 0.6, sticking, rest_speed)
        hits += not np.allclose(after[VELOCITY], c[0] * (expected[-1][VELOCITY] + dt * GRAVITY), atol=1e-12)
        expected.append(after)
    assert hits >= 1
    expected = np.array(expected)
    for part in (slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13)):
        scale = np.abs(expected[:, part]).max()
        assert np.abs(found[:, part] - expected[:, part]).max() <= 1e-12 * scale


def test_flat_impact_acts_at_the_mean_of_four_corners():
    """A box that falls flat hits with four corners; the impulse acts at their mean (section 3.2)."""
    half = np.array([0.1, 0.2, 0.3])
    points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    body = Body(2.0, reference_impl.solid_box_inertia(2.0, half), points)
    state = np.array([0, 0.2 - 1e-3, 0, 0, 0, 0, 1, 0.3, -2.0, 0.1, 0, 0, 0], dtype=float)

    after = reference_impl.step(state, body, World(GRAVITY, Floor(0.5, 0.0)), 1e-3)

    expected = update(state, 2.0, body.inertia, points, 1e-3, GRAVITY, 1.0, 1.0, 0.5, False, 0.0)
    np.testing.assert_allclose(after, expected, rtol=0, atol=1e-15)
    assert after[8] == pytest.approx(0.5 * (2.0 + 9.8e-3), rel=1e-15)
    np.testing.assert_array_equal(after[SPIN], 0.0)
