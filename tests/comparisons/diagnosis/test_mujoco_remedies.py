"""Remedies and words of settings of MJCF and URDF files in MuJoCo, as they are to be pasted."""

import math

import pytest
from support.model_files import FREE, body_of, findings_of

from dropspin.comparisons.diagnosis.answers import TIPS, Answer, Finding
from dropspin.comparisons.diagnosis.flight import spin, tumble
from dropspin.comparisons.diagnosis.landing import impact, rest
from dropspin.comparisons.diagnosis.mujoco_body import MuJoCoModel
from dropspin.comparisons.diagnosis.remedies import answers_to
from dropspin.comparisons.diagnosis.sliding import roll, slide
from dropspin.comparisons.diagnosis.study import BodyDiagnosis
from dropspin.reports.stories.diagnose import sentences

PADS = (("pad", 0.05, 0.004), ("rim", 0.049, 0.003))
BOX = '<geom type="box" size=".1 .1 .1" mass="1" {}/>'


def test_slide_on_a_soft_contact_is_due_to_the_contact(tmp_path):
    """MuJoCo's own slides take 46 to 49 mm with any cone and step, and 12 to 13 mm with the default contact."""
    body = body_of(tmp_path, FREE.format(BOX.format('solref=".2 1" priority="1"')))
    found = [found for answer, found in findings_of(body, slide) if answer.direction == "0°"]
    assert [(one.kind, one.settings) for one in found] == [("setting", ("solref",))]
    assert found[0].remedies[0].value == pytest.approx(0.01274, rel=0.1)


def test_remedy_changes_the_option_that_overrides_all_contacts(tmp_path):
    """MuJoCo's own slide takes 23.5 mm with the option, and 13.2 mm with the one of the remedy; the box rests at 1.2 mm without margin."""
    option = 'o_solref=".1 1" o_margin=".01" timestep="0.001" integrator="RK4" cone="elliptic"'
    box = FREE.format('<geom type="box" size=".1 .05 .03" mass="2" solref=".004 1"/>')
    body = body_of(tmp_path, box, option, head='<option><flag override="enable"/></option>')
    of_slide = [found for answer, found in findings_of(body, slide) if answer.direction == "0°"]
    assert [(one.kind, str(body.settings[one.settings[0]])) for one in of_slide] == [("setting", 'o_solref=".1 1" (model.xml, line 1)')]
    assert of_slide[0].remedies[0].text.startswith('<option o_solref="0.02 1" o_margin=".01"')
    assert of_slide[0].remedies[0].value == pytest.approx(0.01325, rel=0.01)
    [(_, of_rest)] = findings_of(body, rest)
    assert of_rest.remedies[0].text.startswith('<option o_solref=".1 1" o_margin="0"')
    assert of_rest.remedies[0].value == pytest.approx(1.226e-3, rel=0.01)


def test_remedy_that_mujoco_refuses_is_not_given(tmp_path):
    """The flag `ipc` requires the integrator of the file, so that no other one is a remedy of the tumble's energy."""
    box = FREE.format('<geom type="box" size=".1 .06 .03" mass="1"/>')
    body = body_of(tmp_path, box, 'integrator="discrete"', head='<option><flag ipc="enable"/></option>')
    found = [found for _, found in findings_of(body, tumble)]
    assert [one.kind for one in found] == ["time step"]
    assert not [remedy.text for remedy in found[0].remedies if "integrator" in remedy.text.replace('integrator="discrete"', "")]


def test_high_impratio_is_no_cause_of_what_pyramidal_cones_do(tmp_path):
    """MuJoCo's own slides at 45° take 17.9 mm with pyramidal cones and an `impratio` of 1, 10 or 100, and 12.8 mm with elliptic ones."""
    body = body_of(tmp_path, FREE.format('<geom type="box" size=".1 .05 .03" mass="2"/>'), 'impratio="100"')
    found = [found for answer, found in findings_of(body, slide) if answer.direction == "45°"]
    assert [(one.kind, one.settings, [remedy.text for remedy in one.remedies]) for one in found] == [
        ("setting", ("cone",), ['<option impratio="100" cone="elliptic"/> (model.xml, line 1)'])
    ]


def test_error_that_a_setting_removes_is_beside_the_exact_value_with_the_damping(tmp_path):
    """I/d = 1.667 ms about z. Without `eulerdamp` Euler's method makes it 1.243 ms; the damping, not the method, ends the spin."""
    damped = '<body name="b" pos="0 0 1"><joint type="free" damping="5"/><geom type="box" size=".1 .05 .03" mass="2"/></body>'
    body = body_of(tmp_path, damped, 'timestep=".002"', head='<option><flag eulerdamp="disable"/></option>')
    answers = tuple(answer for answer in answers_to(spin, body) if answer.direction == "z")
    said = sentences(BodyDiagnosis("b", "MuJoCo", answers=answers, settings=body.settings))
    of_error = [one for one in said if "integrator" in one.split("Remedy")[0]]
    assert [one.split(": ")[1] for one in of_error] == ["1/e time about z is 1.243 ms instead of 1.667 ms"]


def test_setting_of_the_file_is_named_before_a_default_that_removes_the_error_too(tmp_path):
    """The soft contact makes the slide 18.1 mm instead of 12.7 mm: without it, it is 12.6 mm; on it with an elliptic cone 11.8 mm."""
    body = body_of(tmp_path, FREE.format('<geom type="box" size=".1 .1 .03" mass="1" solimp=".001 .95 .05" priority="1"/>'))
    found = [found for answer, found in findings_of(body, slide) if answer.direction == "0°"]
    assert [one.settings for one in found] == [("solimp",)]
    assert [remedy.value for remedy in found[0].remedies] == pytest.approx([0.01263, 0.01177], rel=0.01)


def test_elliptic_cone_of_the_file_is_not_named_beside_its_impratio(tmp_path):
    body = body_of(tmp_path, FREE.format('<geom type="box" size=".1 .1 .03" mass="1"/>'), 'impratio="0.01" cone="elliptic"')
    assert [finding.settings for _, finding in findings_of(body, slide)] == [("impratio",)] * 2


def test_limit_that_the_time_steps_do_not_determine_is_not_stated(tmp_path):
    """MuJoCo's own slides at 20, 10 and 5 ms are 9.0, 13.0 and 14.3 mm, and at finer steps shorter: 13.3 mm at 0.1 ms."""
    body = body_of(tmp_path, FREE.format('<geom type="box" size=".1 .06 .03" mass="1"/>'), 'timestep="0.02"')
    along = slide(body, [body.dt, body.dt / 2, body.dt / 4])[0]
    assert [finding.kind for finding in along.findings] == ["time step"]
    assert math.isnan(along.limit)


def test_ball_that_a_contact_slows_is_due_to_the_contact(tmp_path):
    geom = '<geom name="g" size=".1" solimp=".5 .01 .01 .5 2" solref="-100 -5"/>'
    [answer] = answers_to(roll, body_of(tmp_path, FREE.format(geom), 'cone="elliptic"'))
    assert [found.kind for found in answer.findings] == ["setting"]


def test_slide_of_a_solver_that_ends_too_early_is_due_to_its_end(tmp_path):
    """After one iteration the box slides 14.4 mm, with MuJoCo's own 100 the exact v²/2µg of 12.7 mm."""
    ends = 'iterations="1" ls_iterations="1"'
    body = body_of(tmp_path, FREE.format('<geom type="box" size=".1 .1 .03"/>'), f'{ends} cone="elliptic" impratio="10"')
    found = [found for _, found in findings_of(body, slide)]
    assert len(found) == 2
    assert {name for one in found for name in one.settings} <= {"iterations", "ls_iterations"}
    assert [one.remedies[0].value for one in found] == pytest.approx([0.01274] * len(found), rel=0.01)
    assert 'iterations="100"' in found[0].remedies[0].text


def test_change_after_which_nothing_is_measured_is_no_remedy(tmp_path):
    file = body_of(tmp_path, FREE.format(BOX.format("")))

    def tips(body, dts):
        found = Finding("setting", ("cone", "armature"))
        slides = Answer("slide", "stopping distance", "m", measured=0.02, in_force=0.01, physical=0.01, findings=(found,))
        return [slides if body is file else Answer("slide", "stopping distance", "m", detail=TIPS)]

    [answer] = answers_to(tips, file)
    assert [found.remedies for found in answer.findings] == [()]


def test_time_step_of_a_remedy_is_tried_as_if_the_file_had_it(tmp_path):
    """MuJoCo raises the time constant of a contact to two time steps: to 10 ms at 5 ms, and not at 1.25 ms."""
    ball = FREE.format('<geom size=".1" mass="1" solref=".004 1" priority="1"/>')
    tried, written = (body_of(tmp_path, ball, f'timestep="{dt}"') for dt in (0.005, 0.00125))
    answers = [[one.measured for one in impact(body, [0.00125])] for body in (tried.tried((), 0.00125), written)]
    assert answers[0] == answers[1] != [one.measured for one in impact(tried, [0.00125])]


def test_remedy_of_a_margin_names_all_geometries_that_it_is_tried_on(tmp_path):
    """Without the margin of the rim, which does not touch, the body would rest on it."""
    pad, rim = (f'<geom name="{name}" type="box" size=".05 .05 {height}" margin="{margin}"/>' for name, height, margin in PADS)
    [found] = [found for answer, found in findings_of(body_of(tmp_path, FREE.format(pad + rim)), rest) if answer.quantity == "penetration"]
    assert found.remedies[0].value == pytest.approx(1e-4, rel=0.5)
    assert [f'name="{name}" type="box" size=".05 .05 {height}" margin="0"' in found.remedies[0].text for name, height, _ in PADS] == [
        True
    ] * 2


def test_free_joint_keeps_its_name(tmp_path):
    body = body_of(tmp_path, f'<body name="b"><joint name="root" type="free" damping=".02"/>{BOX.format("")}</body>')
    assert body.patch(body.remedies["damping"], body.dt).startswith('<freejoint name="root"/>')


def test_margin_that_shortens_a_slide_is_named(tmp_path):
    """Forces act at the margin's height above the floor: MuJoCo's own slides are 5.4 mm with it and 12.2 mm without."""
    body = body_of(tmp_path, FREE.format('<geom type="box" size=".1 .1 .1" mass="1" margin=".06"/>'))
    found = [found for answer, found in findings_of(body, slide) if answer.direction == "0°"]
    assert [(one.kind, one.settings) for one in found] == [("setting", ("margin",))]
    assert found[0].remedies[0].value == pytest.approx(0.01216, rel=0.01)


def test_flag_that_softens_contacts_is_named(tmp_path):
    """MuJoCo's own box rests at 0.461 mm with the flag and at the exact 0.108 mm without."""
    head = '<option><flag diagexact="enable"/></option>'
    body = body_of(tmp_path, FREE.format('<geom type="box" size=".01 .01 .005" mass=".01"/>'), head=head)
    [(answer, found)] = findings_of(body, rest)
    assert (found.kind, found.settings, found.remedies[0].value) == ("setting", ("diagexact",), pytest.approx(1.078e-4, rel=0.01))
    assert math.isnan(answer.in_force)


def test_flag_that_lets_a_contact_be_shorter_than_a_step_is_named(tmp_path):
    """MuJoCo would raise the time constant of 2 ms to two time steps of 10 ms, with which the box rests."""
    geom = '<geom type="box" size=".1 .1 .1" mass="1" solref=".002 1" priority="1"/>'
    body = body_of(tmp_path, FREE.format(geom), 'timestep=".01"', head='<option><flag refsafe="disable"/></option>')
    found = [found for _, found in findings_of(body, rest)]
    assert [(one.settings, one.remedies[0].text) for one in found] == [(("refsafe",), '<flag refsafe="enable"/> (model.xml, line 1)')] * 2


def test_two_settings_that_stop_a_ball_together_have_a_remedy(tmp_path):
    """Without dry friction it keeps 0.0034 of its speed, without damping nothing, without both all of it."""
    ball = '<body name="b" pos="0 0 1"><joint type="free" frictionloss=".2" damping=".01"/><geom size=".05" mass=".5"/></body>'
    [(_, found)] = findings_of(body_of(tmp_path, ball), roll)
    assert set(found.settings) == {"frictionloss", "damping"}
    assert [(one.text, one.value) for one in found.remedies] == [("<freejoint/> (model.xml, line 1)", pytest.approx(1.0, abs=0.01))]


def test_stop_within_a_time_step_is_no_error_of_the_engine(tmp_path):
    """A die of 1.6 cm in a model in cm: at 981 it stops within 0.5 ms, a quarter of a step."""
    body = body_of(tmp_path, FREE.format('<geom type="box" size=".8 .8 .8" mass="4"/>'), 'gravity="0 0 -981"')
    assert findings_of(body, slide) == []


def test_spin_that_diverges_by_explicit_damping_has_no_decay(tmp_path):
    """Each step multiplies it by 1 - c dt/I = 1 - 2.75; with `eulerdamp` by 1/(1 + c dt/I)."""
    head, moment = '<option><flag eulerdamp="disable"/></option>', (0.2**2 + 0.06**2) / 12
    world = '<body name="b" pos="0 0 1"><joint type="free" damping="1"/><geom type="box" size=".1 .1 .03" mass="1"/></body>'
    body = body_of(tmp_path, world, 'timestep="0.01"', head=head)
    answer = next(iter(answers_to(spin, body)))
    [finding] = answer.findings
    assert (answer.detail, finding.kind, finding.settings) == ("none", "time step", ("eulerdamp",))
    assert finding.remedies[0].text == '<flag eulerdamp="enable"/> (model.xml, line 1)'
    assert finding.remedies[0].value == pytest.approx(0.01 / math.log1p(0.01 / moment))
    [sentence] = sentences(BodyDiagnosis("b", "MuJoCo", answers=(answer,), settings=body.settings))
    assert sentence.startswith("Spin, time step: 1/e time about x is none instead of 3.633 ms, because the spin diverges: eulerdamp=")


def test_option_of_a_urdf_goes_into_its_element(tmp_path):
    mass = '<inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>'
    link = f'<link name="b">{mass}<collision><geometry><box size="1 1 1"/></geometry></collision></link>'
    text = f'<robot name="r"><mujoco><compiler discardvisual="false"/></mujoco>{link}</robot>'
    body = body_of(tmp_path, text, file="model.urdf")
    assert body.patch({"cone": "elliptic"}, body.dt) == '<option cone="elliptic"/> within <mujoco> (model.urdf, line 1)'
    bare = body_of(tmp_path, f'<robot name="r">{link}</robot>', file="model.urdf")
    assert bare.patch({"cone": "elliptic"}, bare.dt) == '<mujoco><option cone="elliptic"/></mujoco>'


def test_remedy_of_a_mesh_does_not_point_to_the_file_that_dropspin_wrote(tmp_path):
    body_of(tmp_path, FREE.format(BOX.format("")))
    body = MuJoCoModel(tmp_path / "model.xml", "cup.obj").body("b", None)
    assert body.patch({"solref": "0 -750"}, body.dt).endswith(' solref="0 -750" priority="1"/> (in an MJCF file with this mesh)')


def test_second_number_of_five_frictions_is_sliding(tmp_path):
    head = '<option o_friction=".2 .2 .005 .0001 .0001"><flag override="enable"/></option>'
    assert [name for name, _, _ in body_of(tmp_path, FREE.format(BOX.format("")), head=head).ignored] == []


def test_mesh_that_is_counted_twice_is_the_bodys(tmp_path):
    corners = "0 0 0 .1 0 0 0 .1 0 0 0 .1"
    outline = [(0, 0), (0.2, 0), (0.2, 0.02), (0.02, 0.02), (0.02, 0.2), (0, 0.2)]
    vertices = " ".join(f"{x} {y} {z}" for z in (-0.01, 0.01) for x, y in outline)
    faces = [(0, n + 1, n) for n in range(1, 5)] + [(6, 6 + n, 7 + n) for n in range(1, 5)]
    faces += [face for n in range(6) for m in [(n + 1) % 6] for face in ((n, m, m + 6), (n, m + 6, n + 6))]
    face = " ".join(str(one) for face in faces for one in face)
    head = f'<asset><mesh name="a" vertex="{corners}"/><mesh name="L" vertex="{vertices}" face="{face}"/></asset>'
    [(_, setting, _)] = body_of(tmp_path, FREE.format('<geom type="mesh" mesh="L"/>'), head=head).ignored
    assert 'name="L"' in setting.text


@pytest.mark.parametrize(
    ("option", "world"),
    [
        (
            'solver="CG" iterations="2" tolerance="1e-4" noslip_iterations="5" cone="elliptic"',
            '<body name="b" pos="0 0 .1"><freejoint/><geom type="box" size=".05 .04 .03" density="2700"/></body>',
        ),
        (
            'timestep="0.005" integrator="implicit"',
            '<body name="b" pos="0 0 1"><freejoint/><geom size=".05" mass=".2"/>'
            '<body gravcomp="1" pos="0.1 0 0"><geom size=".05" mass=".2"/></body></body>',
        ),
    ],
    ids=["restored less", "drifts more"],
)
def test_step_that_leaves_an_error_at_rest_is_no_remedy(option, world, tmp_path):
    """A quarter of the step leaves the box 2 mm above the floor, and the other one drifts faster."""
    head = '<option><flag refsafe="disable"/></option><default><geom solref="0.001 1" friction="1 0.05 0.01"/></default>' * ("CG" in option)
    found = findings_of(body_of(tmp_path, world, option, head=head), rest)
    assert found
    assert not any(finding.remedies for _, finding in found)


def test_error_that_two_settings_have_together_is_removed_by_both(tmp_path):
    """A stiff contact without its own damping, and the pyramid: v²/2µg is 64 mm, MuJoCo's own slide 91 mm, with the ellipse alone 66 mm."""
    world = FREE.format(
        '<geom name="g" type="box" size=".05 .04 .03" density="2700" friction="0.2 .005 .0001" solref="-2000 -20" priority="3"/>'
    )
    [(answer, finding)] = [each for each in findings_of(body_of(tmp_path, world), slide) if each[0].direction == "45°"]
    assert answer.measured == pytest.approx(0.091, abs=2e-3)
    assert {"cone", "solref"} <= set(finding.settings)
    assert finding.remedies[0].value == pytest.approx(0.5**2 / (2 * 0.2 * 9.81), rel=0.01)
