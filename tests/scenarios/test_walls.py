"""Scenes with walls, or with a floor that ends."""

import numpy as np
import pytest

from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.measuring.metrics import metrics_for, values_of
from dropspin.comparisons.measuring.symmetries import SYMMETRIES
from dropspin.reports.stories.scene import modelled
from dropspin.scenarios import SceneError, Trajectory, load, truth_for
from dropspin.scenarios.variations import with_other_numbers

SMOOTH = {"restitution": 0.8, "friction": "none"}
WALL = SMOOTH | {"point": [0.8, 0.0, 0.0], "normal": [-3.0, 0.0, 4.0]}


def scene(wall=(WALL,), floor=SMOOTH, **start):
    """A ball thrown at a wall."""
    return load(
        {
            "duration": 0.5,
            "body": {"shape": "box", "half_extents": [0.1, 0.15, 0.2], "mass": 2.0},
            "start": {"position": [0.0, 0.5, 0.0], "velocity": [4.0, 1.0, 0.0], "angular_velocity": [1.0, 2.0, 3.0]} | start,
            "gravity": {"acceleration": [0.0, -9.8, 0.0]},
            "floor": floor,
            "wall": list(wall),
        }
    )


def test_normal_is_normalised():
    assert scene().wall[0].normal == (-0.6, 0.0, 0.8)


def test_no_wall_is_no_table():
    assert scene(wall=()).wall is None
    assert scene(wall=()).digest == load({key: value for key, value in scene().model_dump().items() if key not in ("wall", "name")}).digest


def test_wall_and_end_of_the_floor_are_part_of_the_digest():
    digests = {
        one.digest for one in (scene(), scene(wall=()), scene([WALL | {"restitution": 0.5}]), scene(floor=SMOOTH | {"thickness": 1.0}))
    }
    assert len(digests) == 4


@pytest.mark.parametrize("position", [[5.0, 0.1, 0.0], [0.0, 0.1, -3.0], [0.0, -1.0, 0.0]])
def test_body_may_start_beside_or_below_a_floor_that_ends(position):
    floor = SMOOTH | {"half_extents": [2.0, 1.0], "thickness": 0.3}
    assert scene((), floor, position=position).has_edges_or_walls
    with pytest.raises(SceneError, match="below the floor; increase its height"):
        scene((), floor, position=[2.1, 0.0, 0.0])


@pytest.mark.parametrize("name", list(SYMMETRIES))
def test_transformed_scene_has_its_walls_transformed(name):
    """Wang's method gives the same motion, to 1e-7 (1e-2 at 1000 km, where a coordinate has 1e-10 m)."""
    symmetry, own, steps = SYMMETRIES[name], scene(), 500
    assert symmetry.applies(own) == (name not in ("moving at 10 m/s", "tilted by 1 rad"))
    if symmetry.applies(own):
        other = symmetry.transformed(own)
        expected, found = (engine("wang").prepare(one, dt).record(steps) for one, dt in ((own, 1e-3), (other, symmetry.time * 1e-3)))
        back = symmetry.back(1e-3 * np.arange(steps + 1.0), found)
        assert expected[-1, 7] < 3.0  # it struck the wall
        np.testing.assert_allclose(back[:, :3], expected[:, :3], atol=1e-2 if "1000" in name else 1e-7)


def test_scene_on_a_floor_that_ends_is_not_moved():
    own = scene((), SMOOTH | {"half_extents": [2.0, 1.0]})
    assert {name for name, symmetry in SYMMETRIES.items() if not symmetry.applies(own)} == {
        "turned by 90°", "turned by 1 rad", "tilted by 1 rad", "10 m away", "1 km away", "1000 km away", "moving at 10 m/s"
    }  # fmt: skip


def test_scene_of_other_numbers_has_the_same_structure():
    own = scene([WALL | {"friction": 0.3}])
    other = with_other_numbers(own, 1.001)
    assert (other.structure, other.wall[0].friction) == (own.structure, 0.3 * 1.001)
    assert own.structure != scene().structure


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ["wang", "wang[contact=sequential,law=normal]"])
def test_batch_of_scenes_with_other_walls_moves_as_each_alone(name):
    floor = SMOOTH | {"half_extents": [2.0, 1.0]}
    behind = WALL | {"point": [-0.5, 0.0, 0.0], "normal": [1.0, 0.0, 0.0]}  # with two walls the kernel is that of other tests
    scenes = [scene([WALL | {"restitution": e, "point": [0.8 + 0.1 * e, 0, 0]}, behind], floor) for e in (0.2, 0.5, 0.9)]
    together = engine(name).prepare_batch(scenes, 1e-3).record(300)
    for one, rows in zip(scenes, together, strict=True):
        np.testing.assert_array_equal(engine(name).prepare(one, 1e-3).record(300), rows)


@pytest.mark.parametrize(("wall", "friction"), [((WALL | {"friction": 0.3},), "wall"), ((WALL,), "floor")])
def test_law_without_friction_names_what_has_it(wall, friction):
    floor = SMOOTH if friction == "wall" else SMOOTH | {"friction": 0.3}
    assert "no Coulomb coefficient (0.3)" in engine("wang").refusal(scene(wall, floor))


def test_other_engines_decline_walls_and_ends():
    wang = engine("wang")
    for one, reason in ((scene(), "builds no walls"), (scene((), SMOOTH | {"thickness": 1.0}), "builds a floor that does not end")):
        assert wang.refusal(one) is None
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(type(wang), "takes_walls", False)
            assert wang.refusal(one) == f"the adapter {reason}"


def test_metrics_of_the_floor_alone_do_not_apply_with_walls():
    names = {metric.name for metric in metrics_for(scene(), truth_for(scene()))}
    assert {"penetration", "energy_gain", "energy_drift"} <= names
    assert not names & {"contact_pull", "friction_push", "contact_gap", "horizontal_momentum_error"}
    ends = scene((), SMOOTH | {"half_extents": [2.0, 1.0]})
    assert "penetration" not in {metric.name for metric in metrics_for(ends, truth_for(ends))}


def thrown_at_a_wall(restitution, stiffness):
    """A ball of 1 kg and 0.1 m that flies at 4 m/s at a wall 1 m away, a spring of that stiffness, and comes back at e times the speed."""
    thrown = load(
        {
            "duration": 0.45,
            "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0},
            "start": {"position": [0.0, 1.1, 0.0], "velocity": [4.0, 0.0, 0.0]},
            "gravity": {"acceleration": [0.0, -9.8, 0.0]},
            "floor": SMOOTH,
            "wall": [WALL | {"point": [1.1, 0.0, 0.0], "normal": [-1.0, 0.0, 0.0]}],
        }
    )
    t, frequency = np.arange(451) * 1e-3, np.sqrt(stiffness)
    states = np.zeros((451, 13))
    states[:, 6] = 1.0
    states[:, 1], states[:, 8] = 1.1 - 4.9 * t**2, -9.8 * t
    within, after = (t - 0.25) * frequency, t - 0.25 - np.pi / frequency
    pressed = (within > 0.0) & (after < 0.0)
    states[:, 0] = np.select([within <= 0.0, pressed], [4.0 * t, 1.0 + 4.0 * np.sin(within) / frequency], 1.0 - 4.0 * restitution * after)
    states[:, 7] = np.select([within <= 0.0, pressed], [4.0, 4.0 * np.cos(within)], -4.0 * restitution)
    return thrown, Trajectory.from_states(t, states)


@pytest.mark.parametrize("stiffness", [1e9, 1e5], ids=["hard", "soft"])
def test_energy_that_a_wall_adds_is_measured_and_what_it_stores_is_not(stiffness):
    """Of the fall's M g H = 9.8 J with H = 1 m and the kinetic energy 8 J: (e² - 1) 8 J/9.8 J; the spring's 8 J of energy come back."""
    thrown, motion = thrown_at_a_wall(1.0, stiffness)
    assert values_of(thrown, None, motion)["energy_gain"] == pytest.approx(0.0, abs=1e-12)
    assert values_of(thrown, None, motion)["energy_drift"] == pytest.approx(0.0, abs=1e-12)
    thrown, motion = thrown_at_a_wall(1.2, stiffness)
    assert values_of(thrown, None, motion)["energy_gain"] == pytest.approx(0.44 * 8.0 / 9.8, rel=1e-12)


def test_description_names_planes_and_ends():
    assert modelled(scene((WALL,), SMOOTH | {"half_extents": [4.0, 2.0], "thickness": 0.1}))[2:] == [
        "a floor up to |x| = 4 m and |z| = 2 m, 0.1 m thick, of restitution 0.8 and no friction",
        "a wall through (0.8, 0, 0) m with the normal (-0.6, 0, 0.8), of restitution 0.8 and no friction",
    ]
