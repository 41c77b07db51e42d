"""A sliding box: uniform deceleration by Coulomb friction, and its range of validity."""

import numpy as np
import pytest

from dropspin.scenarios import load, truth_for


def sliding(friction=0.3, velocity=(3.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0), height=0.1, half=(0.3, 0.1, 0.2), **more):
    return load(
        {
            "name": "sliding",
            "duration": 2.0,
            "body": {"shape": "box", "half_extents": list(half), "mass": 2.0},
            "start": {"position": [1.0, height, 2.0], "velocity": list(velocity), "angular_velocity": list(spin)},
            "gravity": {"acceleration": [0.0, -9.8, 0.0]},
            "floor": {"restitution": 0.0, "friction": friction},
        }
        | more
    )


@pytest.mark.parametrize("velocity", [(3.0, 0.0, 0.0), (0.0, 0.0, -2.0), (-1.2, 0.0, 1.6)])
def test_box_stops_where_friction_has_done_its_work(velocity):
    """After v²/(2 f g), at v/(f g), to 1e-15; on the way kinetic energy and the work of friction add up, to 1e-14."""
    scene = sliding(velocity=velocity)
    truth = truth_for(scene)
    assert truth.name == "coulomb-slide"
    speed = np.linalg.norm(velocity)
    end = truth([speed / (0.3 * 9.8), 2.0])
    way = speed**2 / (2 * 0.3 * 9.8) * np.array(velocity) / speed
    np.testing.assert_allclose(end.position, np.tile(scene.start.position + way, (2, 1)), rtol=0, atol=1e-15 * 4)
    np.testing.assert_allclose(end.velocity, 0.0, atol=1e-15 * speed)
    motion = truth(np.linspace(0, 2, 101))
    gone = np.linalg.norm(motion.position - scene.start.position, axis=1)
    np.testing.assert_allclose(0.5 * np.sum(motion.velocity**2, axis=1) + 0.3 * 9.8 * gone, 0.5 * speed**2, rtol=1e-14)


@pytest.mark.parametrize(
    "scene",
    [
        sliding(friction=3.1),  # tips over its leading edge: f times its height is more than its reach
        sliding(friction="infinite"),
        sliding(friction=0.6, velocity=(3.0, 0.0, 3.0), half=(0.1, 0.5, 1.0), height=0.5),  # over its near edge, askew
        sliding(spin=(0.0, 1.0, 0.0)),
        sliding(height=0.2),
        sliding(velocity=(0.0, 0.0, 0.0)),
        sliding(damping={"linear": 0.1}),
        sliding(gravity={"acceleration": [1.0, 9.8, 0.0]}),
        sliding(velocity=(0.0, 0.0, 0.0), gravity={"acceleration": [0.0, -1.0, 2.01]}, friction=9.0),  # rolls over its lower edge
        sliding(velocity=(1.0, 0.0, 0.0), gravity={"acceleration": [0.0, -1.0, 5.0]}, friction=2.1),  # at its end it would slide that way
    ],
)
def test_slide_is_limited_to_its_range_of_validity(scene):
    """Not with tipping, sticking, spin, a fall, rest on a level floor, damping or gravity away from the floor."""
    truth = truth_for(scene)
    assert truth is None or truth.name != "coulomb-slide"


def test_slide_is_valid_until_the_box_would_tip():
    """The limit is f h = b."""
    assert truth_for(sliding(friction=2.99)).name == "coulomb-slide"
    assert truth_for(sliding(friction=3.01)) is None


def test_body_whose_base_is_not_below_its_centre_of_mass_tips():
    """Three feet ahead of the centre of mass: it falls backwards with any friction."""
    body = {"shape": "vertices", "points": [[0.5, -0.2, 0.3], [0.5, -0.2, -0.3], [0.2, -0.2, 0.0], [-0.9, 0.3, 0.0]]}
    body |= {"masses": [0.1, 0.1, 0.1, 1.0]}
    feet = -load({"name": "feet", "duration": 1.0, "body": body}).body.vertices[:, 1].min()
    truth = truth_for(sliding(body=body, height=float(feet)))
    assert truth is None or truth.name != "coulomb-slide"


@pytest.mark.parametrize("friction", [0.51, "infinite"])
def test_box_stays_on_a_slope_that_is_less_steep_than_its_friction(friction):
    """At any slope up to f, here 1/2, and where its height, 0.1 m, is less than its reach down the slope times 2."""
    scene = sliding(velocity=(0.0, 0.0, 0.0), gravity={"acceleration": [3.0, -10.0, -4.0]}, friction=friction)
    np.testing.assert_array_equal(truth_for(scene)([0.0, 1.0, 2.0]).states, [scene.initial_state] * 3)


def test_box_slides_down_a_steeper_slope():
    """With g_t - f g_n, here 5 - 4 m/s²."""
    scene = sliding(velocity=(0.0, 0.0, 0.0), gravity={"acceleration": [3.0, -10.0, -4.0]}, friction=0.4)
    motion = truth_for(scene)([1.0])
    np.testing.assert_allclose(motion.velocity[0], [0.6, 0.0, -0.8], rtol=1e-15)


def test_box_slides_down_a_slope_without_friction_even_one_on_which_it_could_not_rest():
    """By x = v₀ t + a t²/2; its centre of mass is 1 m high, so that more friction tips it over."""
    given = {"half": (0.2, 1.0, 0.2), "height": 1.0, "gravity": {"acceleration": [3.0, -10.0, -4.0]}}
    for friction, acceleration in (("none", 5.0), (0.1, 4.0), (0.24, 2.6)):
        truth = truth_for(sliding(velocity=(0.0, 0.0, 0.0), friction=friction, **given))
        assert truth.name == "coulomb-slide"
        end = truth([2.0])
        np.testing.assert_allclose(end.velocity[0], 2.0 * acceleration * np.array([0.6, 0.0, -0.8]), rtol=1e-15)
        np.testing.assert_allclose(end.position[0], [1.0, 1.0, 2.0] + 2.0 * acceleration * np.array([0.6, 0.0, -0.8]), rtol=1e-15)
    launched = truth_for(sliding(velocity=(1.0, 0.0, 2.0), friction="none", **given))([2.0])
    np.testing.assert_allclose(launched.position[0], [1.0 + 2.0 + 6.0, 1.0, 2.0 + 4.0 - 8.0], rtol=1e-15)
    for friction in (0.26, 0.6):  # its reach is 0.25 m down this slope, and it would stay from 0.5 on
        assert truth_for(sliding(velocity=(0.0, 0.0, 0.0), friction=friction, **given)) is None


def test_box_pushed_across_a_slope_stops_or_turns_down():
    """It stops after |v₀| (f g_n + g_t cos ψ₀)/((f g_n)² - g_t²); on a steeper slope its velocity turns towards the slope."""
    across = sliding(velocity=(4.0, 0.0, -3.0), gravity={"acceleration": [1.5, -10.0, 2.0]}, friction=0.3)
    stops = 5.0 * 3.0 / (9.0 - 6.25)
    motion = truth_for(across.model_copy(update={"duration": 6.0}))([0.99 * stops, 1.01 * stops])
    assert motion.velocity[0].any()
    assert not motion.velocity[1].any()
    steep = sliding(velocity=(4.0, 0.0, -3.0), gravity={"acceleration": [3.0, -10.0, 4.0]}, friction=0.2)
    end = truth_for(steep.model_copy(update={"duration": 1e4}))([1e4])
    np.testing.assert_allclose(end.velocity[0] / np.linalg.norm(end.velocity), [0.6, 0.0, 0.8], atol=1e-3)
