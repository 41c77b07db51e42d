"""Impacts with Coulomb friction in which the slip turns: the cone law and the integrated law, compared with their definitions."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dropspin.scenarios import load, truth_for
from dropspin.scenarios.mechanics import energy
from dropspin.scenarios.state import VELOCITY
from dropspin.scenarios.trajectory import Trajectory
from dropspin.scenarios.truths.friction_impact import cone_impulse, integrated_impulse

UP = np.array([0.0, 1.0, 0.0])
ENDS = ("newton", "poisson", "energy")


def random_contact(seed):
    """The response of a random body at a point, the velocity of the point, the restitution and the friction."""
    rng = np.random.default_rng(seed)
    arm, root = rng.normal(size=3), rng.normal(size=(3, 3))
    skew = np.array([[0.0, -arm[2], arm[1]], [arm[2], 0.0, -arm[0]], [-arm[1], arm[0], 0.0]])
    response = np.eye(3) - skew @ np.linalg.inv(root @ root.T + 0.3 * np.eye(3)) @ skew
    velocity = rng.normal(size=3)
    velocity[1] = -abs(velocity[1]) - 0.1
    return response, velocity, rng.uniform(0.0, 1.0), rng.uniform(0.05, 1.0)


def test_cone_law_meets_its_definition():
    """Newton's restitution, and an impulse within the cone that sticks, or on it against the remaining slip; to 1e-12."""
    sticks = slips = turns = 0
    for seed in range(400):
        K, u, e, friction = random_contact(seed)
        j = cone_impulse(K, u, e, friction)
        after, tangential = u + K @ j, j * (1.0 - UP)
        slip = after * (1.0 - UP)
        assert after[1] == pytest.approx(-e * u[1], abs=1e-12)
        assert np.linalg.norm(tangential) <= friction * j[1] * (1.0 + 1e-12)
        if np.linalg.norm(slip) < 1e-12:
            sticks += 1
            continue
        slips += 1
        np.testing.assert_allclose(tangential, -friction * j[1] * slip / np.linalg.norm(slip), rtol=0, atol=1e-12 * j[1])
        turns += np.linalg.norm(np.cross(slip, u * (1.0 - UP))) > 0.1 * np.linalg.norm(slip) * np.linalg.norm(u * (1.0 - UP))
    assert min(sticks, slips, turns) > 50


def planar(along, coupling, normal):
    """The response of a body that moves in the x-y plane."""
    return np.array([[along, coupling, 0.0], [coupling, normal, 0.0], [0.0, 0.0, 1.3]])


def routh(K, u, e, friction, restitution):
    """Routh's construction in the plane: straight lines of the velocity over the normal impulse; the final velocity (x, y)."""
    k, c, n = K[0, 0], K[0, 1], K[1, 1]

    def slopes(direction):
        return np.array([c - friction * k * direction, n - friction * c * direction])

    sign, v, p = np.sign(u[0]), u[:2].copy(), 0.0
    stop = -v[0] / slopes(sign)[0] if v[0] * slopes(sign)[0] < 0.0 else np.inf
    sticking = np.array([0.0, n - c * c / k])
    later = sticking if abs(c) <= friction * k else slopes(np.sign(c))
    pieces = [(stop, slopes(sign)), (np.inf, later)]
    work, compressed = 0.0, None
    for longest, slope in pieces:
        span = longest
        while span > 0.0:
            if compressed is None:
                length = -v[1] / slope[1] if slope[1] > 0.0 else np.inf
            elif restitution == "newton":
                length = (-e * u[1] - v[1]) / slope[1]
            elif restitution == "poisson":
                length = (1.0 + e) * compressed[0] - p
            else:  # the work v dp from here is the rest of e² times that of the compression
                rest = (1.0 - e**2) * compressed[1] - work
                length = (-v[1] + np.sqrt(v[1] ** 2 + 2.0 * slope[1] * rest)) / slope[1]
            step = min(length, span)
            work, p, span = work + step * (v[1] + 0.5 * step * slope[1]), p + step, span - step
            v = v + step * slope
            if length <= step and compressed is not None:
                return v
            if length <= step:
                compressed = (p, work)
    raise AssertionError("the impact has no end")


@pytest.mark.parametrize("restitution", ENDS)
@pytest.mark.parametrize(
    ("coupling", "slip", "friction"),
    [
        (0.4, 5.0, 0.2),  # slips on
        (0.4, 0.3, 0.6),  # stops in the compression, and sticks
        (0.9, -0.4, 0.3),  # stops, and slips back
        (-0.7, 0.9, 0.5),
        (0.5, 1.6, 0.9),  # stops in the restitution
    ],
)
def test_integrated_law_in_the_plane_matches_rouths_lines(coupling, slip, friction, restitution):
    """To 1e-10: the integration has a tolerance of 1e-13, and follows the slip to 1e-16 of its initial value."""
    K, u = planar(1.5, coupling, 2.0), np.array([slip, -1.0, 0.0])
    for e in (0.0, 0.3, 0.8):
        after = u + K @ integrated_impulse(K, u, e, friction, restitution)
        np.testing.assert_allclose(after[:2], routh(K, u, e, friction, restitution), rtol=0, atol=1e-10)


def terminal(event):
    event.terminal = True
    return event


def integrated(K, u, e, friction, restitution):
    """The final velocity by an integration over the normal impulse, in Cartesian components; None if the slip nearly stops."""

    def rates(p, y):
        slip = y[:3] * (1.0 - UP)
        return [*(K @ (UP - friction * slip / np.linalg.norm(slip))), y[1]]

    stops = terminal(lambda p, y: np.hypot(y[0], y[2]) - 0.05)
    first = solve_ivp(rates, (0.0, 1e3), [*u, 0.0], rtol=1e-12, atol=1e-14, events=[terminal(lambda p, y: y[1]), stops])
    p, y = first.t[-1], first.y[:, -1]
    end = {
        "newton": lambda q, z: z[1] + e * u[1],
        "poisson": lambda q, z: q - (1.0 + e) * p,
        "energy": lambda q, z: z[3] - (1.0 - e**2) * y[3],
    }[restitution]
    second = solve_ivp(rates, (p, 1e3), y, rtol=1e-12, atol=1e-14, events=[terminal(end), stops])
    return None if len(first.t_events[1]) + len(second.t_events[1]) else second.y[:3, -1]


@pytest.mark.sample(1)
@pytest.mark.parametrize("restitution", ENDS)
def test_integrated_law_matches_an_integration_over_the_normal_impulse(restitution):
    """For impacts whose slip turns and does not stop: to 1e-9."""
    compared = 0
    for seed in range(40):
        K, u, e, friction = random_contact(seed)
        expected = integrated(K, u, e, 0.3 * friction, restitution)
        if expected is not None:
            after = u + K @ integrated_impulse(K, u, e, 0.3 * friction, restitution)
            np.testing.assert_allclose(after, expected, rtol=0, atol=1e-9)
            compared += 1
    assert compared > 10


def test_integrated_law_with_the_restitution_of_energy_never_gains_energy():
    for seed in range(60):
        K, u, e, friction = random_contact(seed)
        after = u + K @ (j := integrated_impulse(K, u, e, friction, "energy"))
        assert 0.5 * j @ (u + after) <= 1e-12  # the work of an impulse


def drop(body, friction, law="cone", restitution=0.4):
    return load(
        {
            "duration": 0.5,
            "body": {"mass": 1.0, **body},
            "start": {
                "position": [0.0, 1.0, 0.0],
                "orientation": [0.3, 0.2, 0.5, 0.8],
                "velocity": [0.8, -2.0, -0.5],
                "angular_velocity": [3.0, -2.0, 4.0],
            },
            "gravity": {"acceleration": [0.0, -9.8, 0.0]},
            "floor": {"restitution": restitution, "friction": friction, "impact_law": law},
        }
    )


def test_laws_agree_for_a_ball_and_differ_for_a_box_whose_slip_turns():
    """The slip of a ball of equal moments keeps its direction."""
    laws = ("cone", "integrated-newton", "integrated-poisson", "integrated-energy")
    ball = [truth_for(drop({"shape": "sphere", "radius": 0.2}, 0.1), law).events[0].after for law in laws]
    for after in ball:
        np.testing.assert_allclose(after, truth_for(drop({"shape": "sphere", "radius": 0.2}, 0.1)).events[0].after, rtol=0, atol=1e-10)
    box = [truth_for(drop({"shape": "box", "half_extents": [0.1, 0.2, 0.3]}, 0.1, law)).events[0].after[VELOCITY] for law in laws]
    assert min(np.abs(box[0] - other).max() for other in box[1:]) > 1e-3


def test_solution_follows_the_law_that_the_scene_names():
    box = {"shape": "box", "half_extents": [0.1, 0.2, 0.3]}
    assert "against the remaining slip" in truth_for(drop(box, 0.1)).statement
    scene = drop(box, 0.1, "integrated-energy")
    truth = truth_for(scene)
    assert "Stronge's restitution" in truth.statement
    [impact, *_] = truth.events
    before, after = (energy(scene, Trajectory.from_states([0.0], state[None]))[0] for state in (impact.before, impact.after))
    assert after < before
