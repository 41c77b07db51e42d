"""Impacts of a ball: closed forms with and without friction, and ever shorter flights."""

import numpy as np
import pytest

from dropspin.scenarios import load, truth_for
from dropspin.scenarios.mechanics import lowest_height
from dropspin.scenarios.state import RATES, SPIN, VELOCITY


def ball_with_spin(friction, inertia="solid"):
    return load(
        {
            "name": "backspin",
            "duration": 0.5,
            "body": {"shape": "sphere", "radius": 0.1, "mass": 1.5, "inertia": inertia},
            "start": {"position": [0, 0.5, 0], "velocity": [2, -3, 0.5], "angular_velocity": [1.0, 7.0, 40.0]},
            "floor": {"restitution": 0.8, "friction": friction},
        }
    )


@pytest.mark.parametrize("beta", [0.4, 2 / 3])
def test_sticking_ball_rebounds_without_slip(beta):
    """v_x+ = v_x - β (v_x + R ω_z)/(1 + β), ω_z+ = -v_x+/R: the contact point stops, also along z. To 1e-14."""
    moment = beta * 1.5 * 0.1**2
    truth = truth_for(ball_with_spin("infinite", [moment] * 3))
    [impact] = truth.events
    after = impact.after
    assert impact.time == pytest.approx(0.4 / 3, abs=1e-15)
    vx, vz = 2 - beta * (2 + 0.1 * 40) / (1 + beta), 0.5 - beta * (0.5 - 0.1 * 1) / (1 + beta)
    np.testing.assert_allclose(after[VELOCITY], [vx, 2.4, vz], rtol=0, atol=1e-14 * 3)
    np.testing.assert_allclose(after[SPIN], [vz / 0.1, 7.0, -vx / 0.1], rtol=0, atol=1e-13 * 40)
    assert truth.horizon == 0.5


def test_ball_on_a_frictionless_floor_keeps_its_spin():
    """Only the normal velocity is reversed."""
    scene = ball_with_spin("none")
    after = truth_for(scene)([0.5]).states[0]
    np.testing.assert_allclose(after[RATES], [2, 2.4, 0.5, 1, 7, 40], rtol=0, atol=1e-13)


@pytest.mark.sample(2)
@pytest.mark.parametrize("restitution", [0.1, 0.3, 0.5, 0.9])
@pytest.mark.parametrize("duration", [1.5, 10.0])
def test_short_flights_are_found(restitution, duration):
    """A sticking ball that bounces lower and lower: it never sinks into the floor, and its impacts are those of the ladder, to 1e-11."""
    scene = load(
        {
            "name": "rolling",
            "duration": duration,
            "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0},
            "start": {"position": [0.0, 0.6, 0.0], "velocity": [1.0, 0.0, 0.0], "angular_velocity": [0.0, 0.0, 1.0]},
            "gravity": {"acceleration": [0.0, -9.8, 0.0]},
            "floor": {"restitution": restitution, "friction": "infinite"},
        }
    )
    truth = truth_for(scene)
    motion = truth(np.linspace(0.0, min(duration, truth.horizon), 20_000))
    assert lowest_height(scene, motion).min() >= -1e-12
    u = np.sqrt(2 * 9.8 * 0.5)
    flights = np.append(u / 9.8, 2 * u / 9.8 * restitution ** np.arange(1, 100))
    ladder = np.cumsum(flights)
    times = [event.time for event in truth.events]
    assert len(times) == min(100, np.sum(flights >= 1e-7 * flights.max()), np.sum(ladder <= duration))
    np.testing.assert_allclose(times, ladder[: len(times)], rtol=0, atol=1e-11)


def test_ball_of_unequal_moments_follows_the_cone_law_and_a_ball_of_equal_ones_coulombs_formula():
    """The slip of the former may turn during the impact."""
    content = ball_with_spin(0.1, [0.001, 0.004, 0.004]).model_dump(exclude_none=True)
    assert "against the remaining slip" in truth_for(load(content)).statement
    assert truth_for(load(content | {"body": content["body"] | {"inertia": "solid"}})).statement.endswith("(Coulomb friction)")


@pytest.mark.parametrize("friction", [0.2, 0.5, "infinite"])
def test_ball_that_stays_on_the_floor_slides_and_rolls_on(friction):
    """A solid ball loses min(f u, 2 s/7) of its slip s per 2/7 in the impact and f g in every second after it; it rolls at v - 2 s/7."""
    scene = load(
        {
            "name": "landing",
            "duration": 3.0,
            "body": {"shape": "sphere", "radius": 0.1, "mass": 2.0},
            "start": {"position": [0.0, 0.6, 0.0], "velocity": [3.0, 0.0, 1.0], "angular_velocity": [5.0, 2.0, 7.0]},
            "gravity": {"acceleration": [0.0, -9.8, 0.0]},
            "floor": {"restitution": 0.0, "friction": friction},
        }
    )
    truth = truth_for(scene)
    assert (truth.horizon, len(truth.events)) == (3.0, 1)
    f, u, lands = np.inf if friction == "infinite" else friction, np.sqrt(2 * 9.8 * 0.5), np.sqrt(2 * 0.5 / 9.8)
    velocity, slip = np.array([3.0, 0.0, 1.0]), np.array([3.0 + 0.7, 0.0, 1.0 - 0.5])
    size = np.linalg.norm(slip)
    lost = min(f * u, 2 / 7 * size)
    slides = (2 / 7 * size - lost) / (f * 9.8)  # for so long
    after, rolls = velocity - lost * slip / size, velocity - 2 / 7 * slip
    np.testing.assert_allclose(truth.events[0].after[VELOCITY], after, rtol=0, atol=1e-14 * 4)
    end = truth([lands + slides + 1e-9, 3.0])
    np.testing.assert_allclose(end.velocity, [rolls] * 2, rtol=0, atol=1e-14 * 4)
    np.testing.assert_allclose(end.angular_velocity, [[rolls[2] / 0.1, 2.0, -rolls[0] / 0.1]] * 2, rtol=0, atol=1e-12)
    where = [0.0, 0.1, 0.0] + velocity * lands + 0.5 * (after + rolls) * slides + rolls * (3.0 - lands - slides)
    np.testing.assert_allclose(end.position[1], where, rtol=0, atol=1e-13 * 7)
