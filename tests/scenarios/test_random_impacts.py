"""Exact solutions of random bodies on floors of low restitution, compared with an event-driven integration by another route.

Impacts follow one another ever faster there, so that flights become as short as rounding.
"""

from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest
from support.event_driven import integrate

from dropspin.scenarios import load, truth_for
from dropspin.scenarios.mechanics import lowest_height
from dropspin.scenarios.rotations import angle_between_orientations
from dropspin.scenarios.state import ORIENTATION, POSITION, RATES

SHORT = 1e-6  # of the first flight: impacts up to the first flight that is shorter must be in the solution
PULLS = "the impact law would have the floor pull"


def random_drop(seed, largest_restitution=0.3):
    """A box, a tetrahedron or a prism, in a random attitude, dropped or thrown, that rotates slowly or fast."""
    rng = np.random.default_rng(seed)
    if (kind := rng.integers(3)) == 0:
        body = {"shape": "box", "half_extents": rng.uniform(0.1, 0.4, 3)}
    elif kind == 1:
        body = {"shape": "vertices", "inertia": "vertices", "points": rng.normal(size=(4, 3)) * 0.3}
    else:
        angles, radius, half = 2.0 * np.pi * np.arange(n := rng.integers(3, 9)) / n, rng.uniform(0.1, 0.3), rng.uniform(0.05, 0.4)
        ring = np.column_stack([radius * np.cos(angles), np.full(n, half), radius * np.sin(angles)])
        body = {"shape": "vertices", "inertia": "vertices", "points": np.vstack([ring, ring * [1.0, -1.0, 1.0]])}
    return load(
        {
            "duration": 2.0,
            "body": {"mass": 1.0, **body},
            "start": {
                "position": [0.0, rng.uniform(1.0, 2.0), 0.0],
                "orientation": rng.normal(size=4),
                "velocity": rng.normal(size=3) * rng.integers(2),
                "angular_velocity": rng.normal(size=3) * rng.choice([0.3, 3.0]),
            },
            "gravity": {"acceleration": [0.0, -rng.uniform(1.6, 12.0), 0.0]},
            "floor": {
                "restitution": rng.uniform(0.0, largest_restitution) * (rng.random() > 0.05),
                "friction": ["none", "infinite", rng.uniform(0.05, 1.0)][rng.integers(3)],
            },
        }
    )


def verify_solution(scene):
    """Compare the solution with the integration, and return it with the number of impacts that it should have.

    The impacts of both are equal within 1e-9 of times and speeds of about 1; none is missing before the horizon.
    """
    truth, events = truth_for(scene), integrate(scene)
    flights = events.flights
    short = np.flatnonzero(flights < SHORT * flights[0]) if len(flights) else []
    expected = int(short[0]) if len(short) else len(flights)
    if truth is None:  # no solution: the first impact is of another kind
        return truth, expected
    count = min(len(truth.events), len(flights))
    times, after = np.array([event.time for event in truth.events]), np.array([event.after for event in truth.events]).reshape(-1, 13)
    np.testing.assert_allclose(times[:count], events.times[:count], rtol=0, atol=1e-9)
    np.testing.assert_allclose(after[:count, RATES], events.after[:count, RATES], rtol=0, atol=1e-9)
    np.testing.assert_allclose(after[:count, POSITION], events.after[:count, POSITION], rtol=0, atol=1e-9)
    turned = angle_between_orientations(after[:count, ORIENTATION], events.after[:count, ORIENTATION])
    np.testing.assert_allclose(turned, 0.0, rtol=0, atol=1e-9)
    later = events.times[count:]
    assert not np.any(later < min(truth.horizon, scene.duration) - 1e-9)
    assert truth.horizon >= 0.0
    assert truth.horizon == scene.duration or (truth.horizon < scene.duration and truth.ends)
    motion = truth(np.linspace(0.0, truth.horizon, 500))
    assert lowest_height(scene, motion).min() >= -1e-12
    return truth, expected


def verify_solutions(seeds):
    """Verify the solutions of many scenes.

    Returns:
        How many do not end where the floor would pull; how many of these lack an impact before the first short flight.
    """
    lacking = total = 0
    for seed in seeds:
        truth, expected = verify_solution(random_drop(seed))
        truth_for.cache_clear()
        if truth is None or truth.ends == PULLS:
            continue
        total, lacking = total + 1, lacking + (len(truth.events) < expected)
    return total, lacking


@pytest.mark.extended
def test_solutions_match_an_event_driven_integration_up_to_their_horizon():
    """Of 11 bodies: every kind with every friction. The slow test has ten thousand."""
    total, lacking = verify_solutions([0, 1, 2, 3, 4, 6, 9, 11, 14, 25, 35])
    assert total > 8
    assert lacking == 0


@pytest.mark.slow
def test_ten_thousand_solutions_match_an_event_driven_integration_up_to_their_horizon():
    """99 in 100 contain every impact before the first short flight."""
    parts = [range(1000 + 500 * part, 1500 + 500 * part) for part in range(20)]
    with ProcessPoolExecutor() as pool:
        totals, lacking = zip(*pool.map(verify_solutions, parts), strict=True)
    assert sum(totals) > 9000
    assert sum(lacking) <= 0.01 * sum(totals)
