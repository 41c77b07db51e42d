"""The starts of an ensemble: drawn as they should be, the same ones every time, none in the floor."""

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from scenarios import SceneError, load, members
from scenarios.state import ORIENTATION


def scene_with(**ensemble):
    content = load("drop-box-anyhow").model_dump(exclude_none=True, exclude={"expect", "origin"})
    return load(content | {"ensemble": {"size": 4000, "seed": 3} | ensemble})


def turned(scene):
    """The rotation vectors from the scene's own attitude to each member's, in the world frame."""
    own = Rotation.from_quat(scene.start.orientation)
    return (Rotation.from_quat([member.start.orientation for member in members(scene)]) * own.inv()).as_rotvec()


@pytest.mark.parametrize("largest", [np.pi, 1.0, 1e-3])
def test_rotations_are_drawn_evenly(largest):
    """Angles have the density 1 - cos θ up to the largest, axes are even on the sphere: Kolmogorov and Smirnov find nothing at 1 %."""
    vectors = turned(scene_with(turn=largest))
    angles = np.linalg.norm(vectors, axis=1)

    def below(angle):
        return (angle - np.sin(angle)) / (largest - np.sin(largest)) if largest > 0.1 else (angle / largest) ** 3

    assert angles.max() <= largest * (1 + 1e-12)
    assert stats.kstest(angles, below).pvalue > 0.01
    for component in (vectors / angles[:, None]).T:  # Archimedes: each is even in [-1, 1]
        assert stats.kstest(component, stats.uniform(-1, 2).cdf).pvalue > 0.01


def test_any_attitude_is_as_likely_as_any_other():
    """With the default the attitude the scene was written with is forgotten: a body axis points anywhere."""
    scene = scene_with()
    for axis in np.eye(3):
        ends = Rotation.from_quat([member.start.orientation for member in members(scene)]).apply(axis)
        for component in ends.T:
            assert stats.kstest(component, stats.uniform(-1, 2).cdf).pvalue > 0.01


def test_rates_and_heights():
    """Rates even in their ranges about the scene's own; every member as far above the floor as the scene; the same ones again."""
    scene = scene_with(size=1000, velocity=[0.5, 0.0, 0.0], angular_velocity=[0.0, 3.0, 0.0])
    drawn = members(scene)
    states = np.array([member.initial_state for member in drawn])
    assert stats.kstest(states[:, 7], stats.uniform(-0.5, 1.0).cdf).pvalue > 0.01
    assert stats.kstest(states[:, 11], stats.uniform(0.5 - 3.0, 6.0).cdf).pvalue > 0.01
    np.testing.assert_array_equal(states[:, [8, 9, 10, 12]], np.tile(scene.initial_state[[8, 9, 10, 12]], (1000, 1)))
    np.testing.assert_allclose([member.clearance for member in drawn], scene.clearance, atol=1e-15)
    np.testing.assert_array_equal(states, [member.initial_state for member in members(scene)])
    other = members(scene_with(size=1000, seed=4, velocity=[0.5, 0.0, 0.0]))
    assert not np.isclose(states[:, ORIENTATION], [member.initial_state[ORIENTATION] for member in other]).all(axis=1).any()


@pytest.mark.parametrize("largest", [1e-9, 1e-7, 1e-3, 0.099, 0.101])
def test_small_turns_are_drawn_evenly_too(largest):
    """Where 1 - cos θ is θ²/2 the angle is the largest times the cube root of an even draw: so its cubes are even."""
    shares = (np.linalg.norm(turned(scene_with(size=2000, turn=largest)), axis=1) / largest) ** 3
    assert stats.kstest(shares, "uniform").pvalue > 0.01


def test_no_turn():
    """A largest angle of 0 leaves the attitude as it was."""
    scene = scene_with(size=10, turn=0.0)
    assert {member.start.orientation for member in members(scene)} == {scene.start.orientation}


def test_what_is_refused():
    """A scene without an ensemble has no members; an angle beyond half a turn means nothing."""
    with pytest.raises(ValueError, match="no \\[ensemble\\]"):
        members(load("drop-ball"))
    with pytest.raises(SceneError, match=r"ensemble.turn: got 4.0; must be less than or equal to 3.14"):
        scene_with(turn=4.0)
    with pytest.raises(SceneError, match=r"ensemble.velocity\[1\]: got -1.0"):
        scene_with(velocity=[0.0, -1.0, 0.0])
