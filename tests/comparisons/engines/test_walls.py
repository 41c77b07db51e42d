"""Walls, and floors that end, in the engines that build them."""

import numpy as np
import pytest

from dropspin.comparisons.engines.registry import engine
from dropspin.scenarios import load, truth_for

ENGINES = ("wang[law=coulomb]", "mujoco", "mujoco[integrator=rk4,spring_steps=40]", "pybullet", "pybullet[coordinates=multibody]")
FLOOR = {"restitution": 0.8, "friction": "none"}
WALL = {"restitution": 0.6, "friction": "none", "point": [0.9, 0.2, 0.0], "normal": [-1.0, 0.1, 0.2]}
BODIES = {
    "ball": {"shape": "sphere", "radius": 0.1, "mass": 2.0},
    "box": {"shape": "box", "half_extents": [0.1, 0.15, 0.2], "mass": 2.0},
    "capsule": {"shape": "capsule", "radius": 0.1, "half_length": 0.2, "mass": 2.0},
    "points": {
        "shape": "vertices",
        "points": [[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)],
        "masses": [0.25] * 8,
    },
}


def scene(body="ball", walls=(WALL,), floor=FLOOR, gravity=-9.8, duration=0.7, **start):
    start = {"position": [0.0, 0.6, 0.0], "velocity": [5.0, 2.0, 0.3]} | start
    acceleration = {"acceleration": [0.0, gravity, 0.0]}
    return load({"duration": duration, "body": BODIES[body], "start": start, "gravity": acceleration, "floor": floor, "wall": list(walls)})


def motion(name, own, dt):
    adapter = engine(name)
    assert adapter.refusal(own) is None
    with adapter.prepare(own, dt) as simulation:
        return simulation.record(own.steps(dt))


@pytest.mark.extended
@pytest.mark.parametrize("name", ENGINES)
def test_ball_between_floor_and_wall_follows_the_exact_solution(name):
    """Each impact is up to a step late (a spring: up to its steps), so that the ball is off by the change of velocity times that."""
    own = scene()
    truth = truth_for(own)
    assert [event.wall for event in truth.events] == [0, None]
    jumps = sum(float(np.linalg.norm(event.after[7:10] - event.before[7:10])) for event in truth.events)
    for dt in (1e-3, 2.5e-4):
        found = motion(name, own, dt)
        exact = truth(dt * np.arange(len(found))).states
        late = (40 if "spring" in name else 1) * dt
        assert np.abs(found[:, :3] - exact[:, :3]).max() < jumps * late + 5.0 * dt
        between = int(0.35 / dt)  # after the wall's impact, before the floor's
        np.testing.assert_allclose(found[between, 7:10], exact[between, 7:10], atol=9.8 * late + 0.04 * dt / 1e-3)


FLAT = [*((name, body) for name in ("wang[law=coulomb]", "mujoco") for body in BODIES), ("pybullet", "box"), ("pybullet", "points")]


@pytest.mark.extended
@pytest.mark.parametrize(("name", "body"), FLAT)
def test_body_that_strikes_a_wall_flat_comes_straight_back(name, body):
    """With the wall's restitution, not the floor's, and without turning."""
    upright = {"point": [0.9, 0.0, 0.0], "normal": [-1.0, 0.0, 0.0]}
    own = scene(body, [WALL | upright], gravity=0.0, velocity=[5.0, 0.0, 0.0])
    last = motion(name, own, 1e-3)[-1]
    np.testing.assert_allclose(last[7:], [-3.0, 0.0, 0.0, 0.0, 0.0, 0.0], atol=2e-3)


@pytest.mark.parametrize("name", ["wang[law=coulomb]", "mujoco", "pybullet"])
def test_friction_is_that_of_the_surface_struck(name):
    """A ball that does not slip at a wall rolls off it with 5/7 of its speed along it, on a floor without friction."""
    rough = WALL | {"point": [0.9, 0.0, 0.0], "normal": [-1.0, 0.0, 0.0], "friction": "infinite"}
    for wall, left in ((rough, 5.0 / 7.0), (rough | {"friction": "none"}, 1.0)):
        own = scene("ball", [wall], FLOOR | {"friction": "none" if left < 1.0 else 0.5}, gravity=0.0, velocity=[5.0, 0.0, 2.0])
        last = motion(name, own, 1e-3)[-1]
        np.testing.assert_allclose(last[7:10], [-3.0, 0.0, 2.0 * left], atol=5e-3)


@pytest.mark.extended
@pytest.mark.parametrize(
    "name", ["wang", "mujoco", "mujoco[profile=default]", "mujoco[floor=mesh]", "pybullet", "pybullet[profile=default]"]
)
def test_body_falls_beside_and_below_a_floor_that_ends(name):
    floor = FLOOR | {"half_extents": [1.0, 0.5], "thickness": 0.2}

    def falls(*position):
        own = scene("ball", (), floor, duration=0.4, position=list(position), velocity=[0.0, -1.0, 0.0])
        return bool(abs(motion(name, own, 1e-3)[-1, 1] - (position[1] - 0.4 - 4.9 * 0.4**2)) < 0.03)  # Bullet's own damping takes 0.024 m

    assert not falls(0.7, 0.3, 0.3)
    assert falls(1.2, 0.3, 0.0)
    assert falls(0.0, 0.3, -0.7)
    assert falls(0.0, -0.35, 0.0)


def test_scenes_that_an_engine_would_build_otherwise_are_declined():
    slow = scene(walls=[WALL | {"rest_speed": 0.1}])
    assert "walls differ" in engine("pybullet").refusal(slow)
    assert "rest_speed" in engine("mujoco").refusal(slow)
    for name in ("mujoco[beside=heavy]", "pybullet[beside=heavy]"):
        assert "may be behind a wall" in engine(name).refusal(scene())
    ends = scene(walls=(), floor=FLOOR | {"half_extents": [1.0, 1.0]})
    assert "as a box" in engine("pybullet[floor=mesh]").refusal(ends)
    assert "caps friction" in engine("pybullet").refusal(scene(walls=[WALL | {"friction": 20.0}]))
