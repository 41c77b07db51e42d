"""Numbered problems: the index names every scene once, and no definition changes without a new version."""

import pytest

from dropspin.scenarios import SceneError, load, names
from dropspin.scenarios.problems import identifier, problems

CHANGED = """The definition of {0.identifier} ({0.scene}) is not the one in scenarios/problems.toml.
If the change is not intended, undo it. If it is, the problem has a new definition: set version = {1} and digest = "{2}", say in
CHANGELOG.md what changed, and write its sheet with PYTHONPATH=tests python -m support.problem_sheets."""


def test_every_scene_has_one_number_and_no_number_is_missing():
    """A new scene gets the next number; a scene that is renamed keeps its number."""
    index = problems()
    assert list(index) == [f"DS-{number:03d}" for number in range(1, len(index) + 1)]
    assert sorted(problem.scene for problem in index.values()) == names()


@pytest.mark.parametrize("problem", problems().values(), ids=lambda problem: problem.number)
def test_definition_is_that_of_its_version(problem):
    found = load(problem.scene).digest
    assert found == problem.digest, CHANGED.format(problem, problem.version + 1, found)


def test_digest_of_a_definition_ignores_defaults_that_are_written_out():
    scene = load("drop-ball")
    content = scene.model_dump(exclude_none=True, exclude={"origin"})
    assert load(content).digest == scene.digest
    assert load(content | {"floor": content["floor"] | {"rest_speed": 0.1}}).digest != scene.digest


@pytest.mark.parametrize("given", ["DS-012", "DS-012.1"])
def test_number_loads_its_scene_under_the_scenes_name(given):
    scene = load(given)
    assert (scene.name, scene.origin) == ("drop-ball", "drop-ball")
    assert identifier(scene) == "DS-012.1"


def test_changed_scene_has_no_number():
    assert identifier(load("drop-ball").model_copy(update={"duration": 1.6})) == ""
    assert identifier(load("drop-ball").model_copy(update={"name": "mine", "expect": ()})) == "DS-012.1"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("DS-12", r"scene 'DS-12': no problem has this number\. Did you mean 'DS-012'\? Give one from DS-001 to DS-\d+\."),
        ("ds-012", r"scene 'ds-012': .* Did you mean 'DS-012'\?"),
        ("DS-012.2", r"scene 'DS-012\.2': this version of dropspin has DS-012\.1, another definition"),
    ],
)
def test_unknown_number_or_version_is_refused(given, message):
    with pytest.raises(SceneError, match=message):
        load(given)
