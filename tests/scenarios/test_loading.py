"""Loading scenes; the message for an invalid scene is one line that says where, what was given and what is allowed."""

import fnmatch
import math
import re
from pathlib import Path

import numpy as np
import pytest

from dropspin import scenarios
from dropspin.scenarios import SceneError, load

MALFORMED = sorted((Path(__file__).parent / "malformed").glob("*.toml"))
BALL = {"duration": 1.0, "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0}}


def test_malformed_files_are_found():
    assert len(MALFORMED) >= 30


@pytest.mark.parametrize("path", MALFORMED, ids=lambda path: path.stem)
def test_malformed_file_is_rejected_with_its_message(path):
    """The first lines of each file state the expected text; the message is one line that starts with the file."""
    expected = re.findall(r"^# says: (.*)$", path.read_bytes().decode("latin-1"), flags=re.MULTILINE)
    assert expected
    with pytest.raises(SceneError) as caught:
        load(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    for part in expected:
        assert part in message


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ({"mas": 2.0}, "scene['body']['mas']: unknown key. Allowed: mass, center_of_mass, shape, radius, inertia. Did you mean 'mass'?"),
        ({"mas": 2.0, "raduis": 0.1}, "Did you mean 'mass'?"),
        ({"radius": -1.0, "mas": 2.0}, "Did you mean 'mass'?"),
        ({"radius": 0.1, "mass": 1.0, "inertai": 1.0}, "Did you mean 'inertia'?"),
    ],
)
def test_misspelt_key_is_named_first_and_is_one_problem_with_the_key_that_is_meant(body, message):
    with pytest.raises(SceneError) as caught:
        load({"duration": 1.0, "body": {"shape": "sphere", **({} if "raduis" in body else {"radius": 0.1}), **body}})
    assert str(caught.value).endswith(message)
    assert "unknown key" in str(caught.value)


def test_misspelt_table_is_named_first(tmp_path):
    (tmp_path / "scene.toml").write_text('duration = 1.0\n[boddy]\nshape = "sphere"\nradius = 0.1\nmass = 1.0\n')
    with pytest.raises(SceneError, match=r"scene\.toml: boddy: unknown key\. .* Did you mean 'body'\?$"):
        load(tmp_path / "scene.toml")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("model.xml", b'<mujoco model="x"><worldbody/></mujoco>', "not TOML: *; a scene is a TOML file in UTF-8."),
        ("scene.json", b'{"duration": 1.0}', "not TOML: *; a scene is a TOML file in UTF-8."),
        ("scene.yaml", b"duration: 1.0\nbody:\n", "not TOML: *(at line 1, column 9); a scene is a TOML file in UTF-8."),
        ("program", b"\x7fELF\x02\x00\xf8", "is a binary file, which is not UTF-8 text; a scene is a TOML file in UTF-8."),
    ],
)
def test_file_of_another_format_is_named(name, content, message, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(SceneError) as caught:
        load(tmp_path / name)
    assert fnmatch.fnmatchcase(str(caught.value), f"*{name}: {message}")


def test_unreadable_files_are_rejected(tmp_path):
    """Missing, a directory, too large, nested too deeply."""
    with pytest.raises(SceneError, match=r"absent\.toml: No such file or directory; give the path"):
        load(tmp_path / "absent.toml")
    with pytest.raises(SceneError, match="is a directory; a scene is one file"):
        load(tmp_path)
    huge = tmp_path / "huge.toml"
    with huge.open("wb") as file:
        file.truncate(100_000_000)
    with pytest.raises(SceneError, match=r"huge\.toml: larger than 1,000,000 bytes, the limit for a scene"):
        load(huge)
    deep = tmp_path / "deep.toml"
    deep.write_text("a = " + "[" * 5000 + "]" * 5000)
    with pytest.raises(SceneError, match=r"deep\.toml: "):
        load(deep)


def test_unknown_scene_suggests_the_nearest_name():
    with pytest.raises(SceneError, match=r"'drop-bal' is not in the catalogue.*Did you mean 'drop-ball'\?.*spin-principal"):
        load("drop-bal")


@pytest.mark.parametrize("name", scenarios.names())
def test_catalogue_scene_has_source_and_expectations(name):
    scene = load(name)
    assert scene.name == name
    assert scene.summary
    assert scene.source
    assert scene.expect


@pytest.mark.sample(12)
@pytest.mark.parametrize("name", scenarios.names())
def test_catalogue_scene_has_an_exact_solution(name):
    """All but the laboratory, of whose motion none is known."""
    assert (scenarios.truth_for(load(name)) is None) == (name == "laboratory")


def test_defaults_and_absent_tables():
    """The default start is the origin, the identity, at rest; absent tables are None."""
    scene = load(BALL)
    np.testing.assert_array_equal(scene.initial_state, [0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0])
    assert (scene.gravity, scene.floor, scene.damping, scene.ensemble) == (None, None, None, None)
    assert load(BALL | {"floor": {"restitution": 1, "friction": 0}, "start": {"position": [0, 1, 0]}}).floor.friction == "none"


def test_orientation_is_normalised_once():
    """A unit quaternion keeps its last digit, so that a saved scene loads unchanged."""
    scene = load(BALL | {"start": {"orientation": [0.2, 0.1, -0.3, 0.9]}})
    assert math.hypot(*scene.start.orientation) == pytest.approx(1.0, abs=2e-16)
    again = load(scene.model_dump(exclude_none=True))
    assert again.start.orientation == scene.start.orientation
    assert again.digest == scene.digest


def test_digest_depends_on_the_motion_only():
    """Not on texts and expectations."""
    scene = load("drop-ball")
    assert scene.model_copy(update={"summary": "x", "expect": ()}).digest == scene.digest
    assert scene.model_copy(update={"duration": 1.6}).digest != scene.digest


def test_last_step_is_not_lost_to_rounding():
    """1.5 / 0.001 is 1500 steps, 0.3 / 0.1 is 3."""
    assert load("drop-ball").steps(1e-3) == 1500
    assert load(BALL | {"duration": 0.3}).steps(0.1) == 3


def test_mapping_may_have_a_name():
    """The default is `scene`."""
    assert load(BALL | {"name": "mine"}).name == "mine"
    assert load(BALL).name == "scene"


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"body": BALL["body"] | {"mass": -1}}, "scene['body']['mass']: got -1; must be greater than 0."),
        (
            {"floor": {"restitution": 0.5, "friction": "none"}},
            "scene['start']['position']: got [0.0, 0.0, 0.0]; there the body is 0.1 m below the floor; increase its height.",
        ),
        ({"gravity": {"acceleration": -9.8}}, "scene['gravity']['acceleration']: got -9.8; must be a list."),
        (
            {"body": {"shape": "ball"}},
            "scene['body']['shape']: got 'ball'; must be one of 'sphere', 'box', 'capsule', 'cylinder', 'ellipsoid', 'vertices', 'mesh'.",
        ),
        (
            {"floor": {"restitution": 0.5, "friction": "sticky"}},
            "scene['floor']['friction']: got 'sticky'; must be 'none' or 'infinite', or a",
        ),
        ({"floor": 0.5}, "scene['floor']: got 0.5; must be a mapping."),
        ({"expect": [{"metric": "energy_error", "below": 1.0}]}, "scene['expect'][0]['reason']: missing; it has no default."),
        ({"flor": {}}, "scene['flor']: unknown key. Allowed: name, summary,"),
        ({"name": 3}, "scene['name']: got 3; must be a string."),
        ({"origin": "there"}, "scene['origin']: got 'there'; the key is not allowed."),
    ],
)
def test_wrong_mapping_is_rejected_with_its_key(changed, message):
    """As Python writes it, in one line."""
    with pytest.raises(SceneError) as caught:
        load(BALL | changed)
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_mapping_may_have_arrays():
    """Arrays for lists, and NumPy's numbers for numbers."""
    position = np.array([0, 1, 0])
    scene = load(BALL | {"duration": np.int64(1), "start": {"position": position, "velocity": (np.float32(0.5), 0, 0)}})
    assert scene == load(BALL | {"start": {"position": [0.0, 1.0, 0.0], "velocity": [0.5, 0.0, 0.0]}})


def test_bare_name_is_the_catalogue_s_although_a_file_exists(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("drop-ball.toml").write_text('duration = 9.0\n[body]\nshape = "sphere"\nradius = 1.0\nmass = 1.0\n')
    assert load("drop-ball").duration == 1.5
    assert load("drop-ball.toml").duration == 9.0
    assert load(Path("drop-ball.toml")).duration == 9.0


def test_scenes_are_equal_by_their_values():
    """Cached properties have no influence."""
    one, other = load("drop-box-corner"), load("drop-box-corner")
    assert one.body.inertia_tensor.any()
    assert one.clearance > 0.0
    assert one == other
    assert hash(one) == hash(other)
    assert scenarios.truth_for(one) is scenarios.truth_for(other)
    assert one != load("drop-box-sticking")
    assert one.body != load("drop-ball").body
