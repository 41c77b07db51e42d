"""Contacts of MJCF files in MuJoCo: targets, bodies that roll on soft surfaces or do not rest, and remedies that keep a target."""

import math

import numpy as np
import pytest
from support.model_files import FREE, PLANE, body_of, findings_of, ladder

from dropspin.comparisons.diagnosis.answers import COEFFICIENT, MOVES, REBOUND, TIPS, Answer
from dropspin.comparisons.diagnosis.flight import tumble
from dropspin.comparisons.diagnosis.inertia import inertia
from dropspin.comparisons.diagnosis.landing import impact, rebound, rest
from dropspin.comparisons.diagnosis.remedies import Targets, answers_to
from dropspin.comparisons.diagnosis.sliding import creep, roll, slide
from dropspin.comparisons.diagnosis.study import BodyDiagnosis, Diagnosis, diagnose
from dropspin.reports.document import Paragraph
from dropspin.reports.stories.diagnose import Diagnosed
from dropspin.scenarios import DropspinError

BALL = FREE.format('<geom size=".05" mass="1" {}/>')


@pytest.mark.parametrize(
    ("geom", "option", "why"),
    [
        ('contype="0" conaffinity="0"', "", "floor does not hold it, because no geometry of the body collides with it"),
        ("", 'gravity="0 -9.81 0"', "the body lands on no surface"),
        ("", 'gravity="0 0 0"', "gravity does not hold the body on a surface"),
    ],
)
def test_target_that_nothing_is_measured_for_is_missed(tmp_path, geom, option, why):
    body = body_of(tmp_path, BALL.format(geom), option)
    answers = list(Targets(0.5, 0.3).judged(body, [*impact(body, ladder(body)), *rest(body, ladder(body))]))
    found = [(answer.quantity, finding.detail) for answer in answers for finding in answer.findings if finding.kind == "target"]
    assert found == [(REBOUND, f"the target is 0.5, but {why}"), (COEFFICIENT, f"the target is 0.3, but {why}")]


GROUNDS = {
    "the cylinder table": '<geom name="table" type="cylinder" size="1 .1" friction=".2"/>',
    "the height field geom 0": '<geom type="hfield" hfield="h" friction=".2"/>',
    "the box board": '<body><joint/><geom name="board" type="box" size="1 1 .1" friction=".2"/></body>',
    "the sphere a, the sphere b, the sphere c and others": "".join(f'<geom name="{name}" size=".1"/>' for name in "abcd"),
}


@pytest.mark.parametrize(("left_out", "ground"), GROUNDS.items())
def test_ground_that_is_neither_plane_nor_box_is_named_and_targets_are_not_judged_without_it(tmp_path, left_out, ground):
    asset = '<asset><hfield name="h" nrow="2" ncol="2" size="1 1 .1 .1"/></asset>'
    world = FREE.format('<geom type="box" size=".05 .05 .05" friction=".2"/>')
    (tmp_path / "ground.xml").write_text(f"<mujoco>{asset}<worldbody>{ground}{world}</worldbody></mujoco>")
    diagnosis = diagnose(tmp_path / "ground.xml", friction=0.2)
    [body] = diagnosis.bodies
    assert (body.surface, body.unmodelled) == ("a plane with default settings", (left_out,))
    [(answer, finding)] = [(answer, finding) for answer, finding in body.findings if finding.kind == "target"]
    assert (answer.quantity, answer.detail) == (COEFFICIENT, "not measured")
    assert finding.detail == f"the target is 0.2, but the simulation leaves out {left_out}"
    assert diagnosis.failed
    assert not diagnose(tmp_path / "ground.xml").failed


def test_plane_counts_and_what_else_of_the_world_a_body_collides_with_is_named(tmp_path):
    body = body_of(tmp_path, GROUNDS["the cylinder table"] + BALL.format(""))
    assert (body.surface, body.unmodelled, body.left_out) == ("floor", ["the cylinder table"], "")
    targets = list(Targets(None, 1.0).judged(body, [Answer("friction", COEFFICIENT, "1", measured=body.friction)]))
    assert [finding for answer in targets for finding in answer.findings] == []


def test_settings_of_a_contact_are_those_of_the_larger_priority(tmp_path):
    """MuJoCo raises the time constant of the table, not that of the cube, and has its friction."""
    table = '<geom name="t" type="plane" size="1 1 .1" pos="0 0 .2" priority="2" solref="0.002 1" friction=".3 .05 .01"/>'
    cube = FREE.format('<geom type="box" size=".1 .1 .1" mass="1" solref="0.02 1" friction="0.9 .01 .001"/>')
    ignored = {name: (setting.text, made) for name, setting, made in body_of(tmp_path, table + cube, on="t").ignored}
    assert ignored["solref"] == ('solref="0.002 1"', "raised to a time constant of 0.004 s, two time steps")
    assert ignored["friction"][0] == 'friction=".3 .05 .01"'


@pytest.mark.parametrize(
    ("table", "cube", "name", "decides"),
    [
        ('solref=".2 1"', 'solref=".02 1"', "solref", 'solref=".2 1"'),  # the cube's is MuJoCo's default
        ('solref=".001 1" solmix="100"', 'solref=".05 1"', "solref", 'solref=".001 1"'),
        ('solref=".001 1"', 'solref=".05 1"', "solref", 'solref=".05 1"'),
        ('solref="-900 -5"', 'solref=".5 1"', "solref", 'solref="-900 -5"'),
        ('solimp=".5 .9 .001"', 'solimp=".9 .95 .001" priority="0"', "solimp", 'solimp=".5 .9 .001"'),
        ('priority="1" solimp=".5 .9 .001"', 'solimp=".1 .2 .001"', "solimp", 'solimp=".5 .9 .001"'),
        ('friction=".3"', 'friction=".2"', "friction", 'friction=".3"'),
        ('friction="1.5"', 'friction=".2"', "friction", 'friction="1.5"'),
        ('condim="6"', 'condim="4"', "condim", 'condim="6"'),
    ],
)
def test_setting_of_two_geometries_is_that_which_decides_what_is_in_force(tmp_path, table, cube, name, decides):
    world = f'<geom name="t" type="plane" size="1 1 .1" pos="0 0 .2" {table}/>' + FREE.format(f'<geom type="box" size=".1 .1 .1" {cube}/>')
    assert body_of(tmp_path, world, on="t").settings[name].text == decides


def test_friction_of_a_contact_without_friction_is_not_used(tmp_path):
    ball = FREE.format('<geom size=".1" mass="1" condim="1" priority="1" friction="0.9 .01 .001"/>')
    made = [made for name, _, made in body_of(tmp_path, ball).ignored if name == "friction"]
    assert made == ["not used: condim is 1"]


def test_both_coefficients_of_a_pair_are_judged(tmp_path):
    """MuJoCo's own slides along the two axes take 32 and 64 mm: v²/2µg with 0.4 and 0.2."""
    body = '<body name="b" pos="0 0 1"><freejoint/><geom name="g" type="box" size=".1 .1 .1"/></body>'
    text = f'<worldbody><geom name="f" type="plane" size="0 0 1"/>{body}</worldbody>'
    pair = '<contact><pair geom1="f" geom2="g" friction="0.4 0.2"/></contact>'
    (tmp_path / "pair.xml").write_text(f"<mujoco>{text}{pair}</mujoco>")
    [body] = diagnose(tmp_path / "pair.xml", friction=0.2).bodies
    assert {body.friction, body.friction_across} == {0.2, 0.4}
    assert [answer.measured for answer, finding in body.findings if finding.kind == "target"] == [0.4]


def test_slide_between_directions_of_different_friction_is_followed_to_its_end(tmp_path):
    """It stops when the smaller friction has stopped it, beside the direction in which it began: as MuJoCo's own slide of 2 s."""
    import mujoco

    box = '<body name="b" pos="0 0 .05"><freejoint/><geom name="g" type="box" size=".1 .1 .05"/></body>'
    pair = '<contact><pair geom1="floor" geom2="g" friction="0.1 1"/></contact>'
    body = body_of(tmp_path, box, 'cone="elliptic"', pair)
    data = mujoco.MjData(model := mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml")))
    data.qvel[:2] = 0.5 * np.sqrt(0.5)
    mujoco.mj_step(model, data, 1000)
    [stopped] = [answer.measured for answer in slide(body, [body.dt]) if answer.direction == "45°"]
    assert stopped == pytest.approx(np.hypot(*data.qpos[:2]), rel=0.01)


@pytest.mark.parametrize("geom", ['solref="0.2 1"', 'margin="0.003"'], ids=["6 mm deep", "3 mm above"])
def test_ball_on_a_soft_surface_keeps_its_speed_when_it_rolls(tmp_path, geom):
    """MuJoCo's contact is not at the radius of the ball, so that a start with v = ωr slips: it would keep 0.98 or 1.01."""
    body = body_of(tmp_path, BALL.format(geom))
    [answer] = roll(body, ladder(body))
    assert answer.measured == pytest.approx(1.0, abs=1e-3)
    assert answer.findings == ()


@pytest.mark.parametrize(("floor", "place"), [("", 3), ('priority="2" condim="6" friction="1 .005 .01"', 2)])
def test_rolling_friction_that_slows_a_ball_is_named_and_removed(tmp_path, floor, place):
    """By µr g/(1.4 r), about 1.4 m/s²: MuJoCo's own ball stops within a second. Of contacts of four dimensions, it rolls on."""
    ground = f'\n<geom name="ground" type="box" size="9 9 .1" {floor}/>\n'
    geom = '<geom size=".05" mass="1" condim="6" friction="1 .005 .01"/>'
    body = body_of(tmp_path, ground + FREE.format(geom), on="ground")
    [(answer, finding)] = findings_of(body, roll)
    assert answer.measured == pytest.approx(0.0, abs=1e-3)
    assert math.isnan(answer.in_force)
    assert finding.kind == "setting"
    written = [str(body.settings[name]) for name in finding.settings]
    assert written == [f"{text} (model.xml, line {place})" for text in ('condim="6"', 'friction="1 .005 .01"')]
    [remedy] = finding.remedies
    assert remedy.value == pytest.approx(1.0, abs=1e-3)
    other = body_of(tmp_path, ground + FREE.format(remedy.text.rpartition(" (")[0]), on="ground")
    assert other.rolling == ()
    assert other.friction == 1.0


def test_damping_in_three_powers_that_slows_a_rolling_ball_is_named(tmp_path):
    """No closed form says how much; without it, the ball rolls on."""
    joint = '<joint type="free" damping=".01 .01 .01"/><geom size=".05" mass=".3"/>'
    [(answer, finding)] = findings_of(body_of(tmp_path, f'<body name="b" pos="0 0 .2">{joint}</body>'), roll)
    assert answer.measured < 0.01
    assert (finding.kind, finding.settings) == ("setting", ("damping",))
    assert finding.remedies[0].value == pytest.approx(1.0, abs=1e-3)


def test_slides_of_a_body_that_does_not_rest_have_no_number(tmp_path):
    """At 2 ms the contact throws the box up; at 0.5 ms it rests, and slides as far as Coulomb's law says."""
    geom = '<geom type="box" size=".05 .05 .02" mass="1" friction="0.2" priority="1" solref="0.004 0.2"/>'
    body = body_of(tmp_path, FREE.format(geom), 'cone="elliptic"')
    assert {answer.detail for answer in [*slide(body, ladder(body)), *creep(body, ladder(body))]} == {MOVES}
    assert [finding.kind for _, finding in findings_of(body, rest)] == ["time step"] * 2
    fine = body_of(tmp_path, FREE.format(geom), 'cone="elliptic" timestep="0.0005"')
    assert [answer.measured for answer in slide(fine, ladder(fine))] == pytest.approx([0.5**2 / (2 * 0.2 * 9.81)] * 2, rel=0.01)


@pytest.mark.parametrize(("margin", "cone"), [(0.002, "elliptic"), (0.003, "elliptic"), (0.002, "pyramidal"), (0.003, "pyramidal")])
def test_short_slide_that_is_right_to_ten_percent_has_no_finding_and_is_a_remedy(tmp_path, margin, cone):
    """A box 2 or 3 mm above the floor stops in 0.05 s: with an elliptic cone at 0° 7 or 10 % early, at 45° within 1.1 %."""
    body = body_of(tmp_path, FREE.format(f'<geom type="box" size=".05 .05 .05" margin="{margin}"/>'), f'cone="{cone}"')
    along, diagonal = answers_to(slide, body)
    found = [(finding.kind, finding.settings, finding.remedies[0].value) for finding in diagonal.findings]
    right = pytest.approx(diagonal.in_force, rel=0.011)
    if cone == "elliptic":
        assert (found, diagonal.measured) == ([], right)
        assert along.findings == ()
    else:
        assert found == [("setting", ("cone",), right)]


def test_drift_in_a_wind_is_due_to_the_density_and_the_wind(tmp_path):
    geom = '<geom type="ellipsoid" size=".2 .2 .01" mass="0.02" fluidshape="ellipsoid"/>'
    body = body_of(tmp_path, FREE.format(geom), 'density="1.2" viscosity="0.00002" wind="3 0 0"')
    [(answer, finding)] = findings_of(body, rest)
    assert (answer.quantity, finding.kind, finding.settings) == ("drift speed", "setting", ("density", "wind"))
    assert [remedy.value < 1e-6 for remedy in finding.remedies] == [True, True]


def test_remedy_that_misses_a_target_that_was_met_is_not_given(tmp_path):
    """A damper without stiffness gives its restitution at one time step only; a finer one, which would remove the finding, gives 0."""
    damper = 'solref="0 -1500" solimp="0.9999 0.9999 0.001 0.5 2" priority="9"'
    body = body_of(tmp_path, BALL.format(damper), 'timestep="0.001"')
    of_targets = {}
    for target in (None, 0.5):
        answers = list(answers_to(impact, body, Targets(target)))
        of_targets[target] = [remedy.value for answer in answers for finding in answer.findings for remedy in finding.remedies]
    assert of_targets == {None: pytest.approx([0.0] * 3), 0.5: []}
    [(answer, finding)] = findings_of(body, rest)
    assert (answer.quantity, finding.kind, finding.settings) == ("penetration", "setting", ("solref", "solimp"))
    assert finding.detail == "and grows without end: a contact without stiffness holds no body"


def test_moments_that_are_each_possible_but_not_together_are_named(tmp_path):
    """Of a plate of 2 mm: z² mass of (Ixx + Iyy - Izz)/2 = 5e-4 kg m², and at most m c² = 1e-6 kg m²."""
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="0.003 0.003 0.005"/><geom type="box" size=".1 .1 .001"/>'
    [answer] = [answer for answer in inertia(body_of(tmp_path, FREE.format(inertial))) if answer.findings]
    assert answer.quantity == "second moments / largest possible"
    assert answer.measured == pytest.approx(500.0, rel=0.01)


@pytest.mark.parametrize("step", ["0", "-0.002", "nan", "10"])
def test_time_step_that_resolves_no_motion_is_refused(tmp_path, step):
    with pytest.raises(
        DropspinError, match=rf'model.xml: timestep="{step}" \(model.xml, line 1\): a time step must be above 0 and at most'
    ):
        body_of(tmp_path, BALL.format(""), f'timestep="{step}"')


@pytest.mark.parametrize(("wanted", "remedies"), [(0.5, 0), (None, 2)])
def test_remedy_of_a_spin_keeps_the_restitution_that_is_met(tmp_path, wanted, remedies):
    """The damper of a rebound is for Euler's method and one time step: with RK4 the box does not bounce."""
    pair = '<contact><pair geom1="floor" geom2="g" solref="0 -300" solimp=".9999 .9999 .001 .5 2" solreffriction="0 -200"/></contact>'
    box = FREE.format('<geom name="g" type="box" size=".09 .04 .02" mass=".25"/>')
    body = body_of(tmp_path, box, 'timestep=".005"', head=pair)
    [answer] = [answer for answer in answers_to(tumble, body, Targets(wanted)) if answer.findings]
    assert [len(finding.remedies) for finding in answer.findings] == [remedies]


def test_gravity_that_is_no_number_is_refused(tmp_path):
    with pytest.raises(DropspinError, match=r'model.xml: gravity="0 0 nan" \(model.xml, line 1\): gravity must be three finite numbers'):
        body_of(tmp_path, BALL.format(""), 'gravity="0 0 nan"')


def test_body_without_a_result_is_not_a_sound_one():
    """One that another engine has a result for counts only if the engine broke down."""
    sound, declined = (
        BodyDiagnosis("a", "mujoco", answers=(Answer("fall", "", ""),)),
        BodyDiagnosis("a", "pybullet", breakdown="x", declined=True),
    )
    assert not Diagnosis("f", (sound, declined)).broke_down
    assert Diagnosis("f", (sound, declined._replace(declined=False))).broke_down
    assert Diagnosis("f", (sound, declined._replace(name="b"))).broke_down


def test_bodies_beside_a_free_one_that_are_not_free_are_named(tmp_path):
    arm = '<body name="arm"><joint type="hinge"/><geom size=".02"/></body>'
    other = f'<body name="other" pos="1 0 1"><freejoint/><geom size=".1"/>{arm}</body>'
    moved = '<body name="moved" mocap="true" pos="3 0 1"><geom size=".1"/></body>'
    (tmp_path / "two.xml").write_text(f"<mujoco><worldbody>{BALL.format('')}{other}{moved}</worldbody></mujoco>")
    of_all, of_one = diagnose(tmp_path / "two.xml"), diagnose(tmp_path / "two.xml", bodies="b")
    assert [body.name for body in of_all.bodies] == ["b"]
    named = "other, arm move on joints, carry others on joints or are tied; name one with --body, or give --loose for all"
    assert (of_all.others, of_one.others) == (named, "")
    assert Paragraph(f"Not diagnosed: {named}.") in Diagnosed(diagnosis=of_all).document().parts


@pytest.mark.parametrize(("wanted", "step"), [(0.3, 2.5e-4), (0.5, 2e-3)])
def test_one_change_is_given_for_a_restitution_at_all_speeds(tmp_path, wanted, step):
    """At the file's step, the damper for 0.3 gives 0.268 at 0.5 m/s and 0.296 at 3 m/s, that for 0.5 gives 0.507 and 0.5015."""
    body = body_of(tmp_path, BALL.format(""))
    missed = [answer.findings[0].remedies for answer in Targets(wanted).judged(body, impact(body, ladder(body))) if answer.findings]
    assert {remedy.text for remedies in missed for remedy in remedies} == {body.patch(body.for_contact(wanted, None, step), step)}
    assert [remedy.value for [remedy] in missed] == pytest.approx([wanted] * 3, abs=0.01)


def test_pair_for_a_restitution_grips_as_a_contact_of_this_friction_does(tmp_path):
    """A sphere that sticks keeps 5/7 of its speed along the floor; the same settings in its geometry leave 0.56 of it.

    Without `solreffriction` MuJoCo uses those of a normal force for friction, too: the restitution reverses the slip.
    """
    import mujoco

    ball, option = BALL.format('name="g"'), 'timestep=".001" cone="elliptic"'
    body = body_of(tmp_path, ball, option)
    [answer] = Targets(0.5).judged(body, [rebound(body, [body.dt], 1.0, REBOUND)])
    pair = answer.findings[0].remedies[0].text
    text = f'<mujoco>{pair}<option gravity="0 0 0" {option}/><worldbody>{PLANE}{ball}</worldbody></mujoco>'
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[2], data.qvel[[0, 2]] = 0.06, [1.0, -3.0]
    mujoco.mj_step(model, data, 100)
    assert data.qvel[[0, 2]] == pytest.approx([5.0 / 7.0, 1.5], rel=0.03)


@pytest.mark.parametrize("condim", [1, 3])
def test_missed_friction_has_a_remedy_of_its_own_and_one_together_with_the_restitution(tmp_path, condim):
    body = body_of(tmp_path, BALL.format(f'name="g" condim="{condim}" priority="1" friction=".9 .01 .001"'))
    answers = [rebound(body, [body.dt], 1.0, REBOUND), Answer("friction", COEFFICIENT, "1", measured=body.friction)]
    alone = [answer for answer in Targets(None, 0.4).judged(body, answers) if answer.quantity == COEFFICIENT]
    frictions = [(one.text, one.value) for one in alone[0].findings[0].remedies]
    written = '<geom size=".05" mass="1" name="g" condim="3" priority="2" friction="0.4 0.01 0.001"/> (model.xml, line 1)'
    assert frictions == [(written, 0.4)]
    both = [one for answer in Targets(0.5, 0.4).judged(body, answers) for finding in answer.findings for one in finding.remedies]
    assert [one.value for one in both] == pytest.approx([0.5, 0.4], abs=0.01)
    [text] = {one.text for one in both}
    assert text.startswith('<contact><pair geom1="floor" geom2="g" friction="0.4 0.4 0.01 0.001 0.001" condim="3" solref=')


def test_friction_for_a_target_keeps_the_contact_of_the_surface(tmp_path):
    """A larger priority takes all settings of the geometry, not the coefficient alone: the ball would no longer bounce."""
    damper = 'solref="0 -1500" solimp=".9999 .9999 .001 .5 2" priority="1"'
    world = f'<geom name="f" type="plane" size="1 1 .1" {damper}/>' + BALL.format("")
    body = body_of(tmp_path, world, 'timestep=".001"', on="f")
    assert body.patch(body.for_contact(None, 0.4, body.dt), body.dt).endswith(
        'friction="0.4 0.005 0.0001" priority="2" solref="0 -1500" solimp="0.9999 0.9999 0.001 0.5 2"/> (model.xml, line 1)'
    )


@pytest.mark.parametrize(("of_class", "written"), [("", ""), ('margin=".02"', ' margin="0" gap="0"')])
def test_pair_has_all_that_a_class_could_change(tmp_path, of_class, written):
    head = f"<default><pair {of_class}/></default>" if of_class else ""
    body = body_of(tmp_path, BALL.format('name="g" friction="0 0 0" priority="1"'), head=head)
    text = body.patch(body.for_contact(0.5, None, body.dt), body.dt)
    assert text.startswith(f'<contact><pair geom1="floor" geom2="g" friction="0 0 0 0 0" condim="3"{written} solref=')


def test_copies_of_a_body_have_no_pair_of_their_own(tmp_path):
    world = f'<replicate count="2" offset="1 0 0">{BALL.format("")}</replicate>'
    body = body_of(tmp_path, world)
    text = body.patch(body.for_contact(0.5, None, body.dt), body.dt)
    assert text.startswith('<geom size=".05" mass="1" solref="0 -750"')


def test_geometry_without_a_name_gets_one_for_its_pair(tmp_path):
    body = body_of(tmp_path, BALL.format(""))
    named = '<geom size=".05" mass="1" name="geometry 1 of b"/> (model.xml, line 1)'
    text = body.patch(body.for_contact(0.5, None, body.dt), body.dt)
    assert text.startswith(f'{named}, <contact><pair geom1="floor" geom2="geometry 1 of b" ')


def test_settings_that_miss_the_wanted_restitution_are_no_remedy(tmp_path):
    """With a damping of 500 N s/m the ball is at rest after a few milliseconds, whatever its contact."""
    body = body_of(tmp_path, '<body name="b" pos="0 0 1"><joint type="free" damping="500"/><geom size=".1" mass="1"/></body>')
    answers = [rebound(body, [body.dt], 1.0, REBOUND), Answer("friction", COEFFICIENT, "1", measured=body.friction)]
    impact, friction = Targets(0.5, 0.4).judged(body, answers)
    assert [(finding.kind, finding.remedies) for finding in impact.findings] == [("target", ())]
    assert [one.value for one in friction.findings[0].remedies] == [0.4]


def test_settings_for_a_restitution_are_those_that_override_what_the_geometry_says(tmp_path):
    body = body_of(tmp_path, BALL.format(""), head='<option o_solref="0.2 1"><flag override="enable"/></option>')
    [answer] = Targets(0.5).judged(body, [rebound(body, [body.dt], 1.0, REBOUND)])
    [remedy] = answer.findings[0].remedies
    assert remedy.text.startswith("<option o_solref=")
    assert remedy.value == pytest.approx(0.5, abs=0.01)


def test_tall_box_that_friction_turns_over_its_edge_has_no_stopping_distance(tmp_path):
    """Of 2 h on 2 b, with µ > b/h: MuJoCo's own tips by degrees, after 4 to 7 mm, not v²/2µg = 13 mm; not over its corner."""
    for height, tips in ((0.12, True), (0.05, False)):
        world = FREE.format(f'<geom name="g" type="box" size=".1 .1 {height}" mass="1"/>')
        body = body_of(tmp_path, world, 'cone="elliptic" impratio="10"')
        assert [answer.detail == TIPS for answer in slide(body, ladder(body))] == [tips, False]


def test_box_that_tips_over_its_long_edge_at_45_degrees_has_no_stopping_distance(tmp_path):
    """The load moves by µ h = 90 mm, along the motion to (64, 64) mm, beyond the edge at 50 mm; with µ h = 60 mm to (42, 42) mm."""
    for height, tips in ((0.09, True), (0.06, False)):
        body = body_of(tmp_path, FREE.format(f'<geom type="box" size=".1 .05 {height}" mass="2"/>'), 'cone="elliptic"')
        assert [answer.detail == TIPS for answer in slide(body, ladder(body))] == [False, tips]


def test_box_that_tilts_at_finer_steps_than_that_of_the_file_has_a_distance(tmp_path):
    body = body_of(tmp_path, FREE.format('<geom type="box" size=".1 .05 .03" mass="2"/>'), 'timestep=".05"')
    assert [answer.detail for answer in slide(body, ladder(body))] == ["", ""]


def test_body_that_an_uneven_load_tilts_at_rest_slides(tmp_path):
    """By 0.5 mrad on a soft surface, backwards; µ times its height is 25 mm, the lever about its leading edge 250 mm."""
    block = '<inertial pos="-.1 0 .005" mass="1" diaginertia=".01 .01 .01"/><geom type="box" size=".15 .1 .02"/>'
    body = body_of(tmp_path, FREE.format(block))
    assert [answer.detail for answer in slide(body, ladder(body))] == ["", ""]
