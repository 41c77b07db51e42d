"""The next contact of a free flight: no dip into the floor is missed, however short, and none is invented."""

import numpy as np
import pytest

from dropspin.scenarios import load, truth_for
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.truths.contact_search import ContactSearch
from dropspin.scenarios.truths.flight import flight_states


def floating_ball(height, **start):
    """A ball that gravity pulls upwards at 1 m/s², with the start's other values."""
    return load(
        {
            "duration": 2000.0,
            "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0},
            "start": {"position": [0.0, 0.1 + height, 0.0], **start},
            "gravity": {"acceleration": [0.3, 1.0, 0.0]},
            "floor": {"restitution": 0.5, "friction": "none"},
        }
    )


@pytest.mark.parametrize("spin", [(0.0, 0.0, 0.0), (0.0, 40.0, 3.0)])
@pytest.mark.parametrize("depth", [1e-2, 1e-4])
def test_short_dip_of_a_long_scene_is_an_impact(depth, spin):
    """The ball at y(t) = H - 40 t + t²/2 dips to -depth at t = 40 s: it strikes √(2 depth) before, to 1e-9 s."""
    scene = floating_ball(800.0 - depth, velocity=(1.0, -40.0, 0.0), angular_velocity=spin)
    truth = truth_for(scene)
    assert truth.events[0].time == pytest.approx(40.0 - np.sqrt(2.0 * depth), abs=1e-9)
    assert truth.horizon == 2000.0


def test_flight_that_misses_the_floor_narrowly_has_no_impact():
    """The same ball, 10 nm higher than the floor at its lowest."""
    truth = truth_for(floating_ball(800.0 + 1e-8, velocity=(1.0, -40.0, 0.0)))
    assert (truth.name, truth.events, truth.horizon) == ("flight", (), 2000.0)


def test_solution_ends_where_rounding_decides_whether_the_body_touches():
    """The same ball, exactly at the floor at its lowest."""
    truth = truth_for(floating_ball(800.0, velocity=(1.0, -40.0, 0.0)))
    assert truth.events == ()
    assert truth.horizon == pytest.approx(40.0, abs=1e-5)


def drawn_flight(seed, gravity):
    """A tumbling body of random points, thrown downwards where gravity pulls it up: its corners, state, inertia, and how long it flies."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(rng.integers(4, 12), 3)) * 10.0 ** rng.uniform(-2, 0) * rng.uniform(0.1, 1.0, 3)
    body = load({"duration": 1.0, "body": {"shape": "vertices", "mass": 1.0, "points": points.tolist()}}).body
    spin, attitude = rng.normal(size=3) * 10.0 ** rng.uniform(-1, 2), rng.normal(size=4)
    state = np.concatenate([np.zeros(3), attitude / np.linalg.norm(attitude), [1.0, -2.0 * np.sign(gravity), 0.0], spin])
    return body.hull, state, body.inertia_tensor, min(5.0, 60.0 / np.linalg.norm(spin))


@pytest.mark.sample(5)
@pytest.mark.parametrize("gravity", [0.0, 1.6])
@pytest.mark.parametrize("seed", range(12))
def test_deepest_dip_of_a_tumbling_body_is_found_and_a_miss_is_none(seed, gravity):
    """Raised so that its lowest corner dips by 1e-6 of its size, at its lowest in 40,000 samples: the search finds the first one below."""
    corners, state, inertia, duration = drawn_flight(seed, gravity)
    pull = np.array([0.0, gravity, 0.0])

    def lowest(state, times):
        states = flight_states(state, inertia, pull)(times)
        return (states[:, 1:2] + rotate(states[:, None, 3:7], corners)[..., 1]).min(axis=1)

    times = np.linspace(0.0, duration, 40_001)
    heights = lowest(state, times)
    n = np.clip(np.argmin(heights), 1, len(times) - 2)
    bottom = lowest(state, np.linspace(times[n - 1], times[n + 1], 2001)).min()
    dip = 1e-6 * np.linalg.norm(corners, axis=1).max()
    found = []
    for rise in (-bottom + dip, -bottom - dip):
        start = state + rise * np.eye(13)[1]
        found.append(ContactSearch(flight_states(start, inertia, pull), corners, np.zeros(3)).next_contact(duration))
        if rise < -bottom and heights[0] + rise > dip:
            below = times[heights + rise < 0.0]
            assert found[-1].is_decided
            assert found[-1].time <= min([*below, times[n + 1]])
            assert lowest(start, np.array([found[-1].time]))[0] == pytest.approx(0.0, abs=1e-13 * max(1.0, -bottom))
            assert not np.any(below < found[-1].time)
    assert found[0] is None


def test_search_is_as_long_as_the_motion_not_as_the_scene():
    """A body that tumbles ten radians within reach of the floor in a thousand seconds needs few states."""
    count = 0

    class Counted(ContactSearch):
        def _vertical_motion(self, times):
            nonlocal count
            count += len(times)
            return super()._vertical_motion(times)

    corners, state, inertia, _ = drawn_flight(0, 1.6)
    state[1], state[8], state[10:13] = 1000.0, 0.0, state[10:13] / np.linalg.norm(state[10:13])
    flight = flight_states(state, inertia, np.array([0.0, -1.6, 0.0]))
    assert Counted(flight, corners, np.zeros(3)).next_contact(1000.0).time == pytest.approx(np.sqrt(2 * 1000.0 / 1.6), abs=1.0)
    assert count < 500


@pytest.mark.parametrize("is_steady", [False, True])
def test_no_corner_accelerates_more_than_the_bound_of_the_search(is_steady):
    """Differences of the corners' speeds over 2e-5 rad, right to 1e-5: at most the bound, and at least half of it for some body."""
    shares = []
    for seed in range(40):
        corners, state, inertia, _ = drawn_flight(seed, 1.6)
        flight = flight_states(state, np.eye(3) if is_steady else inertia, np.array([0.0, 1.6, 0.0]))
        search = ContactSearch(flight, corners, np.zeros(3))
        times = np.linspace(1.0, 40.0, 2000) / flight.rotor.largest_spin
        ahead = 1e-5 / flight.rotor.largest_spin
        accelerations = (search._corners(times + ahead)[1] - search._corners(times - ahead)[1]) / (2.0 * ahead)
        shares.append((np.abs(accelerations - 1.6) / search._curvature).max())
    assert 0.5 < max(shares) <= 1.0 + 1e-4


def test_excluded_intervals_contain_no_contact():
    """Intervals of 0.02 to 3 rad of bodies near the floor, each sampled 50 times; about half of those without a contact are excluded.

    Half of the bodies spin steadily about a horizontal axis, where the bound of the acceleration is reached.
    """
    free = excluded = 0
    for seed in range(40):
        corners, state, inertia, _ = drawn_flight(seed, 1.6)
        rng = np.random.default_rng(seed)
        if seed % 2:
            corners, inertia, state[10:13] = corners[:1], np.eye(3), [0.0, 0.0, 5.0]
        state[1], state[8] = np.linalg.norm(corners, axis=1).max() * rng.uniform(0.3, 1.0), 0.0
        search = ContactSearch(flight_states(state, inertia, np.zeros(3)), corners, np.zeros(3))
        begins, widths = rng.uniform(0.0, 20.0, 100), 10.0 ** rng.uniform(-1.7, 0.5, 100)
        begins, widths = begins / search.flight.rotor.largest_spin, widths / search.flight.rotor.largest_spin
        times = begins[:, None] + widths[:, None] * np.linspace(0.0, 1.0, 51)
        touches = (search._corners(times.ravel())[0].min(axis=1) <= 0.0).reshape(times.shape).any(axis=1)
        is_clear = search._excluded(begins, begins + widths)[0]
        assert not np.any(is_clear & touches)
        free, excluded = free + np.sum(~touches), excluded + np.sum(is_clear)
    assert excluded > 0.5 * free > 500
