"""The starts of an ensemble: their distribution, their reproducibility, and their height above the floor."""

from functools import cache

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from dropspin.scenarios import SceneError, load, members
from dropspin.scenarios.state import ORIENTATION


def scene_with(**ensemble):
    content = load("drop-box-anyhow").model_dump(exclude_none=True, exclude={"expect", "origin"})
    return load(content | {"ensemble": {"size": 4000, "seed": 3} | ensemble})


@cache
def orientations(size, largest):
    """The attitudes of the members."""
    return Rotation.from_quat([member.start.orientation for member in members(scene_with(size=size, turn=largest))])


def turned(size, largest):
    """The rotation vectors from the scene's own attitude to each member's, in the world frame."""
    own = Rotation.from_quat(scene_with().start.orientation)
    return (orientations(size, largest) * own.inv()).as_rotvec()


@pytest.mark.sample(1)
@pytest.mark.parametrize("largest", [np.pi, 1.0, 1e-3])
def test_rotations_are_uniform(largest):
    """Angles have the density 1 - cos θ up to the largest and axes are uniform on the sphere, by Kolmogorov-Smirnov tests at 1 %."""
    vectors = turned(4000, largest)
    angles = np.linalg.norm(vectors, axis=1)

    def below(angle):
        return (angle - np.sin(angle)) / (largest - np.sin(largest)) if largest > 0.1 else (angle / largest) ** 3

    assert angles.max() <= largest * (1 + 1e-12)
    assert stats.kstest(angles, below).pvalue > 0.01
    for component in (vectors / angles[:, None]).T:  # Archimedes: each is uniform in [-1, 1]
        assert stats.kstest(component, stats.uniform(-1, 2).cdf).pvalue > 0.01


def test_default_turn_gives_uniform_attitudes():
    """With the default the scene's own attitude has no influence: each body axis is uniform on the sphere."""
    assert scene_with().ensemble.turn == np.pi
    for axis in np.eye(3):
        ends = orientations(4000, np.pi).apply(axis)
        for component in ends.T:
            assert stats.kstest(component, stats.uniform(-1, 2).cdf).pvalue > 0.01


@pytest.mark.extended
def test_rates_are_uniform_and_clearances_equal():
    """Rates are uniform about the scene's; every member has the scene's clearance; a second call gives the same starts."""
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


@pytest.mark.sample(1)
@pytest.mark.parametrize("largest", [1e-9, 1e-7, 1e-3, 0.099, 0.101])
def test_small_rotations_are_uniform(largest):
    """Where 1 - cos θ is θ²/2 the cube of the angle is uniform."""
    shares = (np.linalg.norm(turned(2000, largest), axis=1) / largest) ** 3
    assert stats.kstest(shares, "uniform").pvalue > 0.01


def test_turn_of_zero_keeps_the_attitude():
    scene = scene_with(size=10, turn=0.0)
    assert {member.start.orientation for member in members(scene)} == {scene.start.orientation}


def test_invalid_ensembles_are_rejected():
    """A scene without an ensemble, an angle beyond half a turn, a negative width."""
    with pytest.raises(ValueError, match="no \\[ensemble\\]"):
        members(load("drop-ball"))
    with pytest.raises(SceneError, match=r"\['ensemble'\]\['turn'\]: got 4.0; must be less than or equal to 3.14"):
        scene_with(turn=4.0)
    with pytest.raises(SceneError, match=r"\['ensemble'\]\['velocity'\]\[1\]: got -1.0"):
        scene_with(velocity=[0.0, -1.0, 0.0])
