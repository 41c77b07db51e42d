"""Bodies of several geometries, pairs and links in MJCF: the settings and the remedies are those of what touches."""

import math

import pytest
from support.model_files import FREE, body_of, findings_of

from dropspin.comparisons.diagnosis.flight import fall
from dropspin.comparisons.diagnosis.landing import rest
from dropspin.comparisons.diagnosis.study import QUESTIONS
from dropspin.comparisons.running.driving import Breakdown

LID = '<geom name="lid" type="box" size=".1 .1 .01" pos="0 0 .05" mass=".1" friction="1.5"/>'
SOLE = '<geom name="sole" type="box" size=".1 .1 .04" mass="1" {}/>'
GROUND = '<geom name="ground" type="box" size="9 9 .1" {}/>'
SPRING = {"solref": "0 -750", "solimp": "0.9999 0.9999 0.001 0.5 2"}


def test_settings_are_those_of_the_geometry_that_touches(tmp_path):
    body = body_of(tmp_path, FREE.format(LID + SOLE.format('friction="2" margin=".01"')))
    assert (body.friction, body.margin) == (2.0, 0.01)
    [(_, found)] = findings_of(body, rest)
    assert [remedy.text.split()[1] for remedy in found.remedies] == ['name="sole"']
    assert body.patch(SPRING, body.dt).startswith('<geom name="sole"')


def test_geometries_of_different_friction_that_touch_together_have_none_in_common(tmp_path):
    feet = "".join(f'<geom name="f{y}" size=".05" pos="0 {y} 0" friction="{2 + y}"/>' for y in (-1, 0, 1))
    body = body_of(tmp_path, FREE.format(feet))
    assert math.isnan(body.friction)
    assert body.unmodelled == ["a slide on geometries of different friction (f-1, f0, f1)"]


@pytest.mark.parametrize(
    ("floor", "geom"),
    [
        ("", ""),
        ('priority="12"', ""),
        ("", 'friction=".3"'),
        ('priority="2" friction=".3" condim="4"', 'priority="1" friction=".8"'),
    ],
)
def test_remedy_of_a_contact_is_in_force_and_keeps_friction(tmp_path, floor, geom):
    """The remedy written into the file: what MuJoCo then mixes of both geometries."""
    ground = GROUND.format(floor)
    body = body_of(tmp_path, ground + FREE.format(f'<geom name="g" type="box" size=".1 .1 .04" {geom}/>'), on="ground")
    patched = body.patch(SPRING, body.dt).rpartition(" (")[0]
    other = body_of(tmp_path, ground + FREE.format(patched), on="ground")
    [before], [after] = body._touching.values(), other._touching.values()
    assert after["solref"] == pytest.approx([0, -750])
    assert after["friction"] == pytest.approx(before["friction"])
    assert after["condim"] == before["condim"]


@pytest.mark.parametrize("name", ["n0", "n1"])
def test_remedy_of_a_replicated_body_changes_the_element_within_the_replicate(tmp_path, name):
    body = '<body name="n" pos="0 0 1"><freejoint/>{}</body>'
    world = GROUND.format("") + f'<replicate count="2" offset="1 0 0">{body}</replicate>'
    file = body_of(tmp_path, world.format('<geom type="box" size=".1 .1 .04"/>'), name=name, on="ground")
    option, words = file.patch(SPRING, 0.00025).split("), ")
    assert option == '<option timestep="0.00025"/> (model.xml, line 1'
    assert words.endswith(" within <replicate> (model.xml, line 1)")
    after = body_of(tmp_path, world.format(words.partition(" within")[0]), name=name, on="ground")
    assert [list(contact["solref"]) for contact in after._touching.values()] == [[0, -750]]


@pytest.mark.parametrize("dt", [0.002, 0.00025])
def test_remedy_of_the_contact_of_a_link_is_written_out_for_mjcf(tmp_path, dt):
    """A URDF has no settings of contacts that MuJoCo reads: the time step alone would not bounce."""
    mass = '<inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>'
    link = f'<link name="b">{mass}<collision><geometry><box size="1 1 1"/></geometry></collision></link>'
    body = body_of(tmp_path, f'<robot name="r">{link}</robot>', file="model.urdf")
    step = '<mujoco><option timestep="0.00025"/></mujoco>, ' * (dt < 0.002)
    geom = '<geom solref="0 -750" solimp="0.9999 0.9999 0.001 0.5 2" priority="1"/>'
    assert body.patch(SPRING, dt) == f"{step}{geom} for geometry 1 of b in an MJCF file (a URDF has no such settings)"


def test_settings_and_remedies_of_a_pair_are_its_own(tmp_path):
    pair = '<contact><pair geom1="floor" geom2="g" margin=".01" solref="0.001 1"/></contact>'
    body = body_of(tmp_path, FREE.format('<geom name="g" size=".05" margin=".001" solref="0.05 1"/>'), head=pair)
    assert body.settings["solref"].text == 'solref="0.001 1"'
    assert body.patch({"margin": 0.0}, body.dt).startswith('<pair geom1="floor" geom2="g" margin="0"')
    assert body.patch(SPRING, body.dt).startswith('<pair geom1="floor" geom2="g" margin=".01" solref="0 -750"')


def test_inertial_of_a_child_is_not_its_parents(tmp_path):
    arm = '<body pos=".2 0 0"><joint/><inertial pos="0 0 0" mass="2" diaginertia="5 5 5"/></body>'
    body = body_of(tmp_path, FREE.format(f'<geom type="box" size=".1 .1 .04"/>{arm}'), name="b")
    assert body.written.inertia.max() < 1.0
    assert "inertia" not in body.settings


def test_geometry_and_joint_within_frames_have_their_lines(tmp_path):
    world = '<body name="b" pos="0 0 1">\n<frame><joint type="free" damping=".1"/>\n<geom size=".05" margin=".004"/></frame></body>'
    settings = body_of(tmp_path, world).settings
    assert (settings["damping"].line, settings["margin"].line) == (2, 3)


def test_settings_of_all_sections_of_defaults_are_found(tmp_path):
    """As an included file may bring one more; of several, MuJoCo takes the last value."""
    one, other = '<default><geom margin=".002" solimp=".8 .9 .001"/></default>', '<default><geom margin=".001"/><site size=".1"/></default>'
    settings = body_of(tmp_path, FREE.format(LID), head=one + other).settings
    assert {name: settings[name].text for name in ("margin", "solimp")} == {"margin": 'margin=".001"', "solimp": 'solimp=".8 .9 .001"'}


def test_margins_that_add_are_both_named(tmp_path):
    feet = "".join(f'<geom name="f{y}" size=".05" pos="0 {y} 0" margin=".002"/>' for y in (-1, 1))
    settings = body_of(tmp_path, GROUND.format('margin=".003"') + "\n" + FREE.format(feet), on="ground").settings
    assert str(settings["margin"]) == 'margin=".003" (model.xml, line 1), margin=".002" (model.xml, line 2)'


def test_gravcomp_of_a_welded_part_lifts_its_own_weight(tmp_path):
    part = '<body name="w" gravcomp="1"><geom type="box" size=".1 .1 .02" mass="1" pos="0 0 .06"/></body>'
    body = body_of(tmp_path, FREE.format(f'<geom type="box" size=".1 .1 .04" mass="1"/>{part}'))
    [(answer, found)] = findings_of(body, fall)
    assert answer.in_force == pytest.approx(0.25 * 9.81)
    assert (found.kind, body.settings["gravcomp"].text) == ("setting", 'gravcomp="1"')
    assert found.remedies[0].text == '<body name="w" gravcomp="0"> (model.xml, line 1)'


@pytest.mark.parametrize(
    ("body", "why"),
    [
        ('<body name="b" gravcomp="-1"><freejoint/><geom size=".1"/></body>', "its gravcomp is negative"),
        ('<body name="b"><joint type="free" damping="-1"/><geom size=".1"/></body>', "the damping of its joint is negative"),
    ],
)
def test_settings_that_mujoco_uses_in_part_or_that_add_energy_are_declined(tmp_path, body, why):
    with pytest.raises(Breakdown, match=why):
        body_of(tmp_path, body)


def test_distance_of_a_step_that_does_not_divide_a_second_is_that_in_a_second(tmp_path):
    """Of semi-implicit Euler g t (t + dt) / 2."""
    body = body_of(tmp_path, FREE.format('<geom size=".1"/>'), 'timestep="0.03"')
    [answer] = fall(body, [0.03])
    assert (answer.measured, answer.in_force) == (pytest.approx(0.5 * 9.81 * 1.03, rel=1e-9), pytest.approx(0.5 * 9.81))


@pytest.mark.parametrize("gravcomp", [1, 2])
def test_body_that_does_not_fall_has_answers_that_say_so(tmp_path, gravcomp):
    body = body_of(tmp_path, FREE.replace("<body", f'<body gravcomp="{gravcomp}"').format(LID))
    found = {answer.quantity: answer for answer, _ in findings_of(body, *QUESTIONS)}
    assert found["distance in 1 s"].in_force == pytest.approx((1 - gravcomp) * 0.5 * 9.81)
    assert math.isnan(body.rest_depth)


@pytest.mark.parametrize(("wind", "is_known"), [("0 0 0", True), ("2 0 0", False)])
def test_depth_at_rest_is_not_known_in_wind(tmp_path, wind, is_known):
    """Air at rest exerts no force on a body at rest."""
    depth = body_of(tmp_path, FREE.format(LID), f'density="1.2" wind="{wind}"').rest_depth
    assert math.isfinite(depth) == is_known


def test_sleep_is_a_setting_with_a_remedy(tmp_path):
    flag = '<option sleep_tolerance="0.6"><flag sleep="enable"/></option>'
    body = body_of(tmp_path, FREE.format(LID), head=flag)
    [(answer, found)] = findings_of(body, fall)
    assert answer.in_force == pytest.approx(0.5 * 9.81)
    assert (found.kind, [body.settings[name].text for name in found.settings]) == ("setting", ['sleep="enable"'])
    assert found.remedies[0].value == pytest.approx(0.5 * 9.81, rel=3e-3)
    assert 'sleep_tolerance="0"' in found.remedies[0].text
