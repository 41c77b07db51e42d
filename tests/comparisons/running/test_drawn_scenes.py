"""Drawn scenes as a test of engines: an exact engine raises no alarm, and engines that fit one table of scenes are caught."""

import numpy as np
import pytest
from support import engines as made

import dropspin as ds
from dropspin.scenarios import variations
from dropspin.scenarios.bodies import SHAPES

pytestmark = pytest.mark.usefixtures("few_start_phases")


@pytest.fixture(scope="module")
def drawn():
    """Scenes of every family."""
    return ds.draw(15, 1)


class Exact(made.Exact):
    """Exact in every scene."""

    shapes, takes_walls = SHAPES, True


class Changed(Exact):
    """Exact, but of another scene than the one that it was given."""

    name = "changed"

    def prepare(self, scene, dt):
        return made.ExactSimulation(self.change(scene), dt)

    @staticmethod
    def change(scene):
        raise NotImplementedError


def changed(change):
    return type("ChangedScene", (Changed,), {"change": staticmethod(change), "__doc__": "changed"})()


def with_body(scene, **values):
    return scene.model_copy(update={"body": scene.body.model_copy(update=values)})


def with_hard_coded_gravity(scene):
    return scene if scene.gravity is None else ds.load(content(scene) | {"gravity": {"acceleration": [0.0, -9.8, 0.0]}})


def with_hard_coded_mass(scene):
    """Of 1 kg; the moments are those of the scene."""
    moments = np.diag(scene.body.inertia_tensor).tolist()
    return variations.changed(scene, body={"mass": 1.0, "inertia": moments})  # which no body of this size may have


def without_products_of_inertia(scene):
    moments = np.diag(scene.body.inertia_tensor).tolist()
    return ds.load(content(scene) | {"body": content(scene)["body"] | {"inertia": moments}})


def with_more_restitution(scene):
    return scene.model_copy(update={"floor": scene.floor.model_copy(update={"restitution": 1.01 * scene.floor.restitution})})


def content(scene):
    return scene.model_dump(exclude_none=True, exclude={"origin"})


@pytest.mark.extended
def test_an_exact_engine_raises_no_alarm(drawn):
    results = ds.run(drawn, Exact())
    assert results.exit_code() == 0, results.table[~results.table["verdict"].isin(["passed", "measured"])].to_string()
    assert set(results.table["verdict"]) <= {"passed", "measured"}
    judged = results.table[results.table["kind"] == "asymptotic_error"]
    assert judged.groupby("scene").size().reindex([scene.name for scene in drawn]).min() >= 3


@pytest.mark.extended
@pytest.mark.parametrize(
    ("change", "families"),
    [
        (with_hard_coded_gravity, {"free-tensor", "free-axes", "ball"}),
        (with_hard_coded_mass, {"rough-ball"}),
        (without_products_of_inertia, {"free-tensor"}),
        (with_more_restitution, {"ball", "flat-box", "strike", "wall"}),
    ],
    ids=lambda case: case.__name__ if callable(case) else "",
)
def test_an_engine_fitted_to_a_table_is_caught(drawn, change, families):
    """In a scene of each of these families."""
    scenes = [scene for scene in drawn if scene.tags[1] in families]
    results = ds.run(scenes, changed(change))
    failed = set(results.table.loc[results.table["verdict"] == "failed", "scene"])
    assert {scene.tags[1] for scene in scenes if scene.name in failed} == families
    assert results.exit_code() == 1
