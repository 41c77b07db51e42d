"""Drawn scenes: reproducible, each with an exact solution that the default time steps resolve, over the whole stated range."""

import numpy as np
import pytest

from dropspin.scenarios import DropspinError, SceneError, load, truth_for
from dropspin.scenarios.bodies.inertia import is_diagonal
from dropspin.scenarios.draw import draw, drawn_scene
from dropspin.scenarios.random_families import FAMILIES, GRAVITY, LENGTH, MASS, RESTITUTION
from dropspin.scenarios.random_variates import Draws


@pytest.fixture(scope="module")
def drawn():
    """Scenes of every family."""
    return draw(15, 7)


@pytest.mark.extended
def test_a_scene_depends_on_its_seed_and_number_only(drawn):
    """Not on how many are drawn; other seeds and numbers give other scenes."""
    assert draw(3, 7) == drawn[:3]
    assert len({scene.digest for scene in [*drawn, *draw(3, 8)]}) == 18


def test_a_drawn_scene_is_loaded_by_its_name(drawn):
    assert drawn[11].name == drawn[11].origin == "draw-7-1002"
    assert load("draw-7-1002") == drawn[11]
    assert load("draw-7-1") == drawn[0]
    assert load(drawn[11].model_dump(exclude={"origin"}, exclude_none=True)).digest == drawn[11].digest


def test_families_follow_each_other(drawn):
    """Those of round bodies, meshes and walls have numbers of their own, so that the others keep theirs."""
    assert [scene.tags for scene in drawn] == [("drawn", family.__name__.replace("_", "-")) for family in FAMILIES]
    assert [scene.name for scene in drawn[8:12]] == ["draw-7-009", "draw-7-010", "draw-7-1001", "draw-7-1002"]
    assert [scene.name for scene in draw(16, 7)[14:]] == ["draw-7-1005", "draw-7-011"]


@pytest.mark.parametrize("number", range(15))
def test_exact_solution_covers_the_duration_and_is_resolved(drawn, number):
    """Flights of 16 steps of 4 ms and at most 0.1 rad a step, seen in a thousand states; no expectation is fitted to the scene."""
    scene = drawn[number]
    truth = truth_for(scene)
    assert truth.covers_all(scene.duration)
    assert np.diff([0.0, *(event.time for event in truth.events), scene.duration]).min() >= 0.064
    assert np.linalg.norm(truth(np.linspace(0.0, scene.duration, 1000)).angular_velocity, axis=1).max() <= 25.1
    assert scene.expect == ()
    assert (scene.tags[1] in ("ball", "rough-ball", "flat-box", "corner", "edge", "strike", "lying", "mesh", "wall")) == bool(truth.events)


def drawn_contents():
    """Many contents of every family, without the exact solutions that decide whether they are accepted."""
    draws = Draws(np.random.default_rng(0))
    return [family(draws)[0] for family in FAMILIES for _ in range(60)]


def test_draws_span_the_stated_ranges():
    """Nine tenths of each range, in its logarithm, and no value beyond it; gravity of every direction where there is no floor."""
    contents = drawn_contents()
    masses = [body.get("mass", sum(body.get("masses", []))) for body in (one["body"] for one in contents)]
    lengths = [2.0 * half for one in contents for half in one["body"].get("half_extents", [])]
    gravity = [(np.array(one["gravity"]["acceleration"]), "floor" in one) for one in contents if "gravity" in one]
    restitution = [one["floor"]["restitution"] for one in contents if one.get("floor", {}).get("restitution")]
    for found, (low, high) in ((masses, MASS), (lengths, LENGTH), ([np.linalg.norm(g) for g, _ in gravity], GRAVITY)):
        assert low * (1 - 1e-12) <= min(found) < low * (high / low) ** 0.05
        assert low * (high / low) ** 0.95 < max(found) <= high * (1 + 1e-12)
    assert RESTITUTION[0] <= min(restitution) < max(restitution) <= RESTITUTION[1]
    free = np.array([g / np.linalg.norm(g) for g, floor in gravity if not floor])
    assert (free.max(axis=0) > 0.8).all()
    assert (free.min(axis=0) < -0.8).all()
    assert any(g[1] < 0.0 and g[0] and g[2] for g, floor in gravity if floor)


@pytest.mark.extended
def test_full_inertia_tensors_are_drawn_with_a_floor_and_without(drawn):
    corners = [drawn_scene(1, number) for number in range(7, 50, 10)]
    assert any(not is_diagonal(scene.body.inertia_tensor) for scene in corners)
    assert not any(is_diagonal(scene.body.inertia_tensor) for scene in drawn if scene.tags[1] == "free-tensor")


@pytest.mark.parametrize(
    ("count", "seed", "message"),
    [
        (0, 1, "count: got 0; give a whole number from 1 to 1000"),
        (1001, 1, "count: got 1001"),
        (2.0, 1, "count: got 2.0"),
        (True, 1, "count: got True"),
        (1, -1, "seed: got -1; give a whole number from 0 to 18446744073709551615"),
        (1, 2**64, "seed: got 18446744073709551616"),
    ],
)
def test_counts_and_seeds_out_of_range_are_refused(count, seed, message):
    with pytest.raises(DropspinError, match=message):
        draw(count, seed)


@pytest.mark.parametrize("name", ["draw-7-000", "draw-7-2001", "draw-99999999999999999999-001"])
def test_names_of_scenes_that_are_not_drawn_are_refused(name):
    with pytest.raises(SceneError, match="seeds up to 18446744073709551615 and numbers from 1 to 2000"):
        load(name)
