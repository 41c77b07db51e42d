"""What the settings of MJCF and URDF files do in MuJoCo, compared with closed forms and with MuJoCo alone."""

import math

import numpy as np
import pytest
from support.model_files import FREE, PLANE, body_of, by_quantity, findings_of, ladder

from dropspin.comparisons.diagnosis.answers import REBOUND
from dropspin.comparisons.diagnosis.flight import fall, spin, tumble, worst_tumble
from dropspin.comparisons.diagnosis.inertia import armature, inertia
from dropspin.comparisons.diagnosis.landing import impact, rest
from dropspin.comparisons.diagnosis.mujoco_body import MuJoCoModel
from dropspin.comparisons.diagnosis.remedies import Targets, answers_to
from dropspin.comparisons.diagnosis.sliding import slide
from dropspin.scenarios import DropspinError
from dropspin.scenarios.state import POSITION, UP
from dropspin.scenarios.truths.damped_joint import fall as damped_fall


def test_healthy_ball_has_no_finding(tmp_path):
    option = 'timestep="1e-3" integrator="RK4" cone="elliptic" impratio="100"'
    body = body_of(tmp_path, FREE.format('<geom size=".05"/>'), option)
    assert findings_of(body) == []
    assert not any(answer.findings for answer in inertia(body))


def test_damping_of_a_free_joint_is_named_and_its_time_constants_are_exact(tmp_path):
    world = '<body name="egg" pos="0 0 1"><joint type="free" damping="0.02"/><geom type="ellipsoid" size=".02 .03 .05"/></body>'
    body = body_of(tmp_path, world)
    moments, mass = np.diag(body.inertia), body.mass
    answers = spin(body, ladder(body))
    assert [answer.in_force for answer in answers] == pytest.approx((moments / 0.02).tolist(), rel=1e-12)
    h = body.dt  # MuJoCo's implicit damper divides a spin by 1 + h/τ in each step
    assert [answer.measured for answer in answers] == pytest.approx([h / math.log1p(h * 0.02 / moment) for moment in moments], rel=1e-6)
    assert {tuple(finding.kind for finding in answer.findings) for answer in answers} == {("setting", "time step")}
    [fallen, terminal] = fall(body, ladder(body))
    assert terminal.in_force == pytest.approx(mass * 9.81 / 0.02, rel=1e-12)
    rate = 0.02 / mass
    assert fallen.in_force == pytest.approx(9.81 / rate * (1.0 - (1.0 - math.exp(-rate)) / rate), rel=1e-9)
    found = [(answer, finding) for answer, finding in findings_of(body) if finding.kind == "setting"]
    assert {str(body.settings[name]) for _, finding in found for name in finding.settings} == {'damping="0.02" (model.xml, line 1)'}
    assert {remedy.text for _, finding in found for remedy in finding.remedies} == {"<freejoint/> (model.xml, line 1)"}
    kept = [remedy.value for answer, finding in found for remedy in finding.remedies if answer.question == "spin"]
    assert kept == pytest.approx([1.0] * 3, rel=1e-9)


def test_armature_slows_the_fall_and_is_found_in_a_default_class(tmp_path):
    head = '<default>\n<default class="a">\n<joint armature="0.5"/>\n</default></default>'
    world = '<body name="b" pos="0 0 1" childclass="a"><joint type="free"/><geom type="box" size=".1 .1 .1" mass="1"/></body>'
    body = body_of(tmp_path, world, head=head)
    [answer] = fall(body, ladder(body))
    assert (answer.findings[0].kind, answer.findings[0].settings) == ("setting", ("armature",))
    assert answer.in_force == pytest.approx(0.5 * 9.81 / 1.5, rel=1e-9)
    assert str(body.settings["armature"]) == 'armature="0.5" (model.xml, line 3)'


@pytest.mark.parametrize(("added", "kinds"), [(0.02, ["setting"]), (1e-5, [])])
def test_armature_is_compared_with_the_moment_of_a_ball(tmp_path, added, kinds):
    """The ball of 2.2 kg has a moment of 0.0022 kg m², and 0.9 % more mass with 0.02 kg: MuJoCo turns it a tenth as fast."""
    ball = '<body name="b" pos="0 0 1"><joint type="free"/><geom size=".05" mass="2.2"/></body>'
    body = body_of(tmp_path, ball, head=f'<default>\n<joint armature="{added}"/></default>')
    answers = list(answers_to(armature, body))
    assert [answer.measured for answer in answers] == [pytest.approx(1.0 + added / 0.0022, rel=1e-12)]
    found = answers[0].findings
    assert [(one.kind, one.settings) for one in found] == [(kind, ("armature",)) for kind in kinds]
    assert [remedy.value for one in found for remedy in one.remedies] == [1.0] * len(kinds)


def test_armature_beside_a_displaced_centre_of_mass_is_that_of_the_mass_matrix(tmp_path):
    """A torque without a force, which leaves the velocity free: the block of the rotation less what the coupling takes."""
    import mujoco

    box = '<geom type="box" size=".1 .05 .03" pos=".1 .02 0" mass="1"/>'
    body = body_of(tmp_path, f'<body name="b"><joint type="free" armature=".5"/>{box}</body>')
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    data, whole = mujoco.MjData(model), np.zeros((6, 6))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, whole)
    turning = whole[3:, 3:] - whole[3:, :3] @ np.linalg.solve(whole[:3, :3], whole[:3, 3:])
    [answer] = armature(body, [body.dt])
    assert answer.measured == pytest.approx(np.linalg.eigvalsh(turning)[0] / np.linalg.eigvalsh(body.inertia)[0], rel=1e-9)


@pytest.mark.extended
def test_gain_of_energy_is_a_time_step_error_that_rk4_removes(tmp_path):
    world = FREE.format('<geom type="box" size=".008 .044 .089" mass=".09"/>')
    body = body_of(tmp_path, world)
    [stated, turned] = tumble(body, ladder(body))
    [worst, speed, step] = worst_tumble(body, ladder(body))
    assert stated.measured == pytest.approx(4.148, abs=2e-3)  # by MuJoCo alone: 100 (E(1 s)/E(0) - 1)
    assert [finding.kind for finding in stated.findings] == ["time step"]
    assert abs(stated.limit) < 0.01
    assert turned.measured == pytest.approx(5.369, abs=5e-3)
    assert worst.measured > 6.4
    assert 3.0 < speed.measured < 10.0
    assert 4e-4 < step.measured < 6e-4
    [(_, found)] = findings_of(body, tumble)
    integrator, step = found.remedies
    assert integrator.text == '<option integrator="RK4"/> (model.xml, line 1)'
    assert abs(integrator.value) < 1e-6
    assert 'timestep="0.0004' in step.text
    assert step.value == pytest.approx(0.845, abs=0.05)


@pytest.mark.parametrize(
    ("geom", "option", "points"),
    [
        ('<geom size=".05"/>', "", 1),
        ('<geom size=".05" condim="4"/>', "", 1),
        ('<geom size=".05" condim="6"/>', 'cone="elliptic"', 1),
        ('<geom type="box" size=".05 .05 .05"/>', "", 4),
        ('<geom type="cylinder" size=".05 .05"/>', "", 3),
        ('<geom size=".05" margin=".002"/>', "", 1),
        ('<geom size=".05" solref="-2000 -80"/>', "", 1),
    ],
)
def test_depth_at_rest_is_exact(tmp_path, geom, option, points):
    body = body_of(tmp_path, FREE.format(geom), option)
    depth = by_quantity(rest(body, ladder(body)))["penetration"]
    assert body._points() == points
    assert depth.measured == pytest.approx(depth.in_force, abs=1e-8)


def test_margin_lifts_a_body(tmp_path):
    body = body_of(tmp_path, FREE.format('<geom size=".02" margin=".001"/>'))
    [(answer, found)] = findings_of(body, rest)
    [remedy] = found.remedies
    assert (found.settings, remedy.text) == (("margin",), '<geom size=".02" margin="0"/> (model.xml, line 1)')
    assert answer.measured == pytest.approx(0.00036718184 - 0.001, abs=1e-8)
    assert remedy.value == pytest.approx(0.00036718184, abs=1e-8)


def test_default_contact_returns_the_speed_of_a_critically_damped_spring(tmp_path):
    body = body_of(tmp_path, FREE.format('<geom size=".05"/>'), 'timestep="1e-4"')
    answers = {answer.quantity: answer for answer in impact(body, [body.dt]) if answer.speed == 1.0}
    assert answers["largest upward / impact speed"].measured == pytest.approx(math.exp(-2.0), abs=0.02)  # without gravity
    assert answers[REBOUND].measured == 0.0
    assert answers["contact"].detail == "> 0.3 s"


def test_coarse_step_scatters_the_rebound_over_start_phases(tmp_path):
    body = body_of(tmp_path, FREE.format('<geom type="box" size=".025 .025 .025"/>'), 'timestep="0.01"')
    [(answer, found)] = findings_of(body, impact)
    assert (found.kind, found.settings) == ("time step", ("timestep",))
    assert answer.most - answer.least > 0.1
    assert abs(answer.limit) < 0.01


def test_raised_time_constant_of_a_contact_is_said(tmp_path):
    body = body_of(tmp_path, FREE.format('<geom size=".05" solref="0.001 1" priority="1"/>'))
    [(name, setting, made)] = body.ignored
    assert (name, setting.text) == ("solref", 'solref="0.001 1"')
    assert made == "raised to a time constant of 0.004 s, two time steps"


def test_pyramid_is_named_where_friction_depends_on_direction(tmp_path):
    world = FREE.format('<geom name="puck" type="cylinder" size=".1 .02" mass="2" friction=".3"/>') + (
        '<geom name="table" type="box" size="1 1 .2" pos="5 0 .2" friction=".1"/>'
    )
    body = body_of(tmp_path, world, on="table")
    assert body.friction == pytest.approx(0.3)
    along, diagonal = answers_to(slide, body)
    assert along.findings == ()
    assert along.in_force == pytest.approx(0.25 / (2.0 * 0.3 * 9.81))
    assert diagonal.measured / diagonal.in_force == pytest.approx(math.sqrt(2.0), abs=0.05)
    [found] = diagonal.findings
    assert (found.kind, found.settings) == ("setting", ("cone",))
    assert found.remedies[0].text == '<option cone="elliptic"/> (model.xml, line 1)'


def test_impossible_inertia_is_measured_against_the_shape(tmp_path):
    inertial = '<inertial pos="0 0 0" mass=".1" diaginertia="1e5 1e5 1e5"/>'
    body = body_of(tmp_path, FREE.format(f'{inertial}<geom type="box" size=".015 .015 .12"/>'))
    answer = by_quantity(inertia(body))["largest moment / largest possible"]
    assert [finding.kind for finding in answer.findings] == ["impossible"]
    assert answer.measured == pytest.approx(1e5 / (0.1 * (0.015**2 + 0.12**2)), rel=1e-9)


def test_compilers_change_of_an_inertia_is_said(tmp_path):
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 2.5"/>'
    world = FREE.format(f'{inertial}<geom type="box" size="2 2 2"/>')
    body = body_of(tmp_path, world, head='<compiler balanceinertia="true"/>')
    [(name, setting, made)] = body.ignored
    assert (name, setting.text) == ("inertia", 'diaginertia="1 1 2.5"')
    assert 'balanceinertia="true" (model.xml, line 1)' in made
    assert by_quantity(inertia(body))["largest moment / sum of others"].measured == pytest.approx(1.25)


def test_root_of_a_urdf_is_welded_and_cut_loose(tmp_path):
    tensor = '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>'
    link = f'<contact><restitution value="0.5"/></contact><inertial><mass value="1"/>{tensor}</inertial>'
    shape = '<collision><geometry><sphere radius="0.5"/></geometry></collision>'
    body = body_of(tmp_path, f'<robot name="r"><link name="ball">{link}{shape}</link></robot>', file="ball.urdf")
    assert [name for name, *_ in body.ignored] == ["base", "restitution"]
    assert body.unmodelled == []
    assert body.surface == "a plane with default settings"
    assert np.diag(body.inertia) == pytest.approx([0.1] * 3)


def test_link_of_a_urdf_lands_on_the_plane_that_is_added_and_not_on_the_root(tmp_path):
    """Only the root of an MJCF file is as fixed as the file says."""
    mass = '<inertial><mass value="1"/><inertia ixx=".002" iyy=".002" izz=".002" ixy="0" ixz="0" iyz="0"/></inertial>'
    link = f'<link name="{{}}">{mass}<collision><origin rpy="0 .4 0"/><geometry><box size=".1 .1 .1"/></geometry></collision></link>'
    joint = '<joint name="j" type="continuous"><parent link="base"/><child link="arm"/><origin xyz="0 0 .2"/><axis xyz="0 0 1"/></joint>'
    text = f'<robot name="r">{link.format("base")}{link.format("arm")}{joint}</robot>'
    body = body_of(tmp_path, text, name="arm", file="arm.urdf")
    assert (body.surface, body.unmodelled) == ("a plane with default settings", ["joints"])
    arm = '<body name="arm" pos="0 0 .2"><joint/><geom type="box" size=".1 .1 .1"/></body>'
    (tmp_path / "arm.xml").write_text(
        f'<mujoco><worldbody><body name="base"><geom name="foot" type="box" size=".1 .1 .1"/>{arm}</body></worldbody></mujoco>'
    )
    assert MuJoCoModel(tmp_path / "arm.xml", "arm.xml").body("arm", None).surface == "foot"


def test_welded_parts_and_an_offset_centre_move_as_in_mujoco(tmp_path):
    part = '<body pos=".1 .05 0" euler="0 0 30"><geom type="capsule" size=".02 .05" mass=".3"/></body>'
    joint = '<joint type="free" damping=".01" armature=".02"/>'
    world = f'<body name="b" pos="0 0 1" euler="20 0 0">{joint}<geom size=".05" mass="1"/>{part}</body>'
    body = body_of(tmp_path, world)
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    data = mujoco.MjData(model)
    start = body.start(height=5.0, velocity=np.array([0.3, 0.1, 0.2]), spin=np.array([1.0, 2.0, 3.0]))
    motion = body.motions(start[np.newaxis], 2e-3, 200, np.array([0.0, -9.81, 0.0]), floor=False)[0]
    data.qvel[3:6] = [1.0, 2.0, 3.0]
    mujoco.mj_forward(model, data)
    turn = data.xmat[1].reshape(3, 3)
    arm = data.subtree_com[1] - data.qpos[:3]
    data.qvel[:3] = np.array([0.3, -0.2, 0.1]) - np.cross(turn @ data.qvel[3:6], arm)  # y is up there, z here
    first = data.subtree_com[1].copy()
    mujoco.mj_step(model, data, 200)
    mujoco.mj_forward(model, data)
    x, y, z = data.subtree_com[1] - first
    assert (motion[-1] - motion[0])[:3] == pytest.approx([x, z, -y], abs=1e-12)
    exact = body.in_force(start, np.array([0.0, 0.4]), 9.81)[-1]
    finer = body.motions(start[np.newaxis], 1e-4, 4000, np.array([0.0, -9.81, 0.0]), floor=False)[0, -1]
    assert finer == pytest.approx(exact, abs=2e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<mujoco>", "not XML"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><mujoco/>', "declares a document type"),
        ('<mujoco><include file="bad.xml"/></mujoco>', "includes itself"),
        ('<mujoco><include file="none.xml"/></mujoco>', "none.xml"),
        ('<mujoco><worldbody><body><freejoint/><geom size="-1"/></body></worldbody></mujoco>', "MuJoCo does not compile it"),
        ('<mujoco><worldbody><body><freejoint/><geom size="nan"/></body></worldbody></mujoco>', "MuJoCo does not compile it"),
        ("<mujoco/>", "no body both moves and has mass"),
        ('<mujoco><worldbody><body mocap="true"><geom size=".1"/></body></worldbody></mujoco>', "no body both moves and has mass"),
        ('<mujoco><worldbody><body name="arm"><joint/><geom size=".1"/></body></worldbody></mujoco>', "--loose"),
        ('<robot name="r"><link name="b"/></robot>', "give a link a mass above 0"),
        ('<robot name="r"><link name="a"/><link name="b"/></robot>', r"has 2 links without a parent \(a, b\); a URDF file has one"),
        ('<robot name="r"><xacro:property name="m" value="1"/></robot>', "has macros; expand them first"),
        ('<?xml version="1.0" encoding="ISO-8859-1"?><mujoco model="\xe9"/>'.encode("latin-1"), "is not encoded as UTF-8"),
    ],
)
def test_wrong_file_ends_in_one_line(tmp_path, text, message):
    (tmp_path / "bad.xml").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(DropspinError, match=message) as error:
        MuJoCoModel(tmp_path / "bad.xml", "bad.xml").bodies([], False)
    assert "\n" not in str(error.value)


@pytest.mark.extended
def test_fluid_and_wind_act_as_in_mujoco_and_are_named(tmp_path):
    import mujoco

    geom = '<geom type="ellipsoid" size=".05 .04 .01" mass=".02" fluidshape="ellipsoid" fluidcoef=".5 .25 1.5 1 1"/>'
    body = body_of(tmp_path, FREE.format(geom), 'density="1.2" wind="3 0 1"')
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 200)
    along = body.motions(body.start()[np.newaxis], 0.002, 200, -9.81 * UP, floor=False)[0]
    x, _, z = data.qpos[:3] - [0.0, 0.0, 1.0]
    assert abs(x) > 0.1
    assert along[-1, POSITION] - along[0, POSITION] == pytest.approx([x, z, 0.0], abs=1e-9)
    found = {answer.question: finding for answer, finding in findings_of(body)}
    assert str(body.settings[found["fall"].settings[0]]) == 'density="1.2" (model.xml, line 1)'
    [remedy] = found["fall"].remedies
    assert remedy.text == '<option density="0" wind="3 0 1" viscosity="0"/> (model.xml, line 1)'
    assert remedy.value == pytest.approx(4.905, rel=3e-3)


@pytest.mark.extended
def test_pyramid_is_told_from_dry_friction_of_the_joint(tmp_path):
    world = '<body name="b" pos="0 0 1"><joint type="free" frictionloss=".01"/><geom type="box" size=".05 .05 .02" mass="1"/></body>'
    found = findings_of(body_of(tmp_path, world))
    [diagonal] = [finding for answer, finding in found if answer.direction == "45°"]
    assert diagonal.remedies[0].text.startswith('<option cone="elliptic"')
    assert {finding.settings for answer, finding in found if answer.question == "spin"} == {("frictionloss",)}


def test_friction_of_a_urdf_is_not_read(tmp_path):
    contact = '<contact><lateral_friction value="0.3"/><rolling_friction value="0"/><inertia_scaling value="2"/></contact>'
    shape = '<collision><geometry><box size=".1 .1 .1"/></geometry></collision>'
    mass = '<inertial><mass value="1"/><inertia ixx=".002" iyy=".002" izz=".002" ixy="0" ixz="0" iyz="0"/></inertial>'
    body = body_of(tmp_path, f'<robot name="r"><link name="l">{contact}{mass}{shape}</link></robot>', file="model.urdf")
    assert body.friction == 1.0
    assert [name for name, _, made in body.ignored if made == "not read"] == ["lateral_friction", "inertia_scaling"]


def test_settings_of_contacts_that_neither_engine_reads_are_named(tmp_path):
    """Of the body and of what is fixed to it, and not of other links."""
    pytest.importorskip("pybullet", exc_type=ImportError)
    from dropspin.comparisons.diagnosis.pybullet_body import PyBulletModel

    drake = "<drake:proximity_properties><drake:mu_static value='.6'/></drake:proximity_properties>"
    mass = '<inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>'
    link = f'<link name="{{}}">{mass}<collision><geometry><box size="1 1 1"/></geometry>{{}}</collision></link>'
    links = "".join(link.format(name, drake if name == "fixed" else "") for name in ("base", "fixed", "arm"))
    joint = '<joint name="{1}" type="{0}"><parent link="base"/><child link="{1}"/><axis xyz="0 0 1"/></joint>'
    joints = joint.format("fixed", "fixed") + joint.format("continuous", "arm")
    gazebo = "<gazebo reference='{}'>\n<mu1>.2</mu1><contact_cfm/><contact_damping/><material>Gazebo/Red</material></gazebo>"
    text = f'<robot name="r">{links}{joints}{gazebo.format("base")}{gazebo.format("arm")}<gazebo><kp>1e6</kp></gazebo></robot>'
    text = text.replace("<collision>", "<collision><contact_coefficients mu='.3'/>", 1)
    of_mujoco = body_of(tmp_path, text, name="base", file="model.urdf").ignored
    of_pybullet = PyBulletModel(tmp_path / "model.urdf", "model.urdf").body("base", None).ignored
    for ignored in (of_mujoco, of_pybullet):
        found = [(name, setting.text, setting.line) for name, setting, made in ignored if made == "not read"]
        drake_of_fixed = ("drake:mu_static of fixed", '<drake:mu_static value=".6">', 1)
        assert found == [
            ("contact_coefficients", '<contact_coefficients mu=".3">', 1),
            ("mu1", "<mu1>", 2),
            ("contact_cfm", "<contact_cfm>", 2),
            ("contact_damping", "<contact_damping>", 2),
            ("kp", "<kp>", 3),
            drake_of_fixed,
            ("kp of fixed", "<kp>", 3),
        ]


def test_link_without_a_geometry_that_collides_is_named(tmp_path):
    pytest.importorskip("pybullet", exc_type=ImportError)
    from dropspin.comparisons.diagnosis.pybullet_body import PyBulletModel

    mass = '<inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>'
    shape = '<visual><geometry><box size="1 1 1"/></geometry></visual>'
    of_mujoco = body_of(tmp_path, f'<robot name="r"><link name="l">{mass}{shape}</link></robot>', file="model.urdf")
    for body in (of_mujoco, PyBulletModel(tmp_path / "model.urdf", "model.urdf").body("l", None)):
        found = {name: (setting.text, made) for name, setting, made in body.ignored}
        assert (body.surface, found["collision"]) == ("", ('<link name="l">', "missing: the link collides with nothing"))
    joint = '<joint name="j" type="fixed"><parent link="l"/><child link="camera"/></joint>'
    beside = f'<link name="l">{mass}{shape}{shape.replace("visual", "collision")}</link><link name="camera">{shape}</link>{joint}'
    of_camera = body_of(tmp_path, f'<robot name="r">{beside}</robot>', file="model.urdf")
    assert not [name for name, _, _ in of_camera.ignored if name.startswith("collision")]


def test_an_answer_has_a_finding_for_each_cause(tmp_path):
    joint = '<joint type="free" armature=".2"/>'
    world = f'<body name="b" pos="0 0 1">{joint}<geom type="box" size=".05 .05 .02" mass="1" friction=".3" priority="1"/></body>'
    found = [finding for answer, finding in findings_of(body_of(tmp_path, world), slide) if answer.direction == "45°"]
    assert [(finding.kind, finding.settings) for finding in found] == [("setting", ("armature",)), ("setting", ("cone",))]
    armature, cone = (finding.remedies[0] for finding in found)
    assert armature.text == '<joint type="free" armature="0"/> (model.xml, line 1)'
    assert cone.text.startswith('<option cone="elliptic"')


def test_damping_and_armature_that_both_act_are_removed_together(tmp_path):
    world = '<body name="b" pos="0 0 1"><joint type="free" armature=".1" damping=".1"/><geom size=".1" mass="1"/></body>'
    [(_, found)] = findings_of(body_of(tmp_path, world), fall)
    assert found.shares == (("damping, armature", pytest.approx(1.0)),)
    assert [remedy.text for remedy in found.remedies] == ["<freejoint/> (model.xml, line 1)"]
    assert found.remedies[0].value == pytest.approx(0.5 * 9.81 * 1.002, rel=1e-9)  # semi-implicit Euler


@pytest.mark.parametrize(
    ("armature", "damping", "option", "named"),
    [
        (0.1, 1e-5, "", ["armature"]),
        (1e-4, 0.1, "", ["damping", "armature"]),
        (0.1, 1.0, "", ["damping, armature"]),  # their own shares do not add up
        (1e-6, 0.0, 'density="12" viscosity="1e-5"', ["density", "integrator"]),  # semi-implicit Euler falls g dt t/2 too far
    ],
)
def test_settings_that_explain_a_difference_are_named_and_no_others(tmp_path, armature, damping, option, named):
    """Of several that act, with the shares that the closed form of a damped fall has."""
    joint = f'<joint type="free" armature="{armature}" damping="{damping}"/><geom size=".1" mass="1"/>'
    body = body_of(tmp_path, f'<body name="b" pos="0 0 1">{joint}</body>', option)
    [found] = [finding for _, finding in findings_of(body, fall) if finding.kind == "setting"]
    assert [name for name, _ in found.shares] == named
    if not option:
        left = {"armature": (0.0, damping), "damping": (armature, 0.0), "damping, armature": (0.0, 0.0)}[named[0]]
        free, whole, reverted = (float(damped_fall(1.0, 9.81, 1.0, *settings)[0]) for settings in ((0.0, 0.0), (armature, damping), left))
        assert found.shares[0][1] == pytest.approx((reverted - whole) / (free - whole), abs=1e-3)


def test_body_that_tips_over_has_a_row_that_says_so(tmp_path):
    body = body_of(tmp_path, FREE.format('<geom type="box" size=".01 .01 .1"/>'))
    assert [(answer.direction, answer.detail) for answer in slide(body, ladder(body))] == [
        ("0°", "tips or rolls"),
        ("45°", "tips or rolls"),
    ]


def test_tied_body_is_not_free_and_what_acts_on_a_body_is_named(tmp_path):
    bodies = [f'<body name="{name}" pos="{3 * number} 0 1"><freejoint/><geom size=".05"/></body>' for number, name in enumerate("abc")]
    ties = '<equality><weld body1="a"/></equality><tendon><spatial><site site="s"/><site site="t"/></spatial></tendon>'
    turned = '<keyframe><key name="turned" qpos="0 0 1 1 0 0 0 3 0 1 0 1 0 0 6 0 1 1 0 0 0"/></keyframe>'
    bodies[2] = bodies[2].replace("<geom", '<site name="s"/><geom')
    world = f'{"".join(bodies)}<site name="t" pos="6 0 2"/>'
    text = f"<mujoco><worldbody>{PLANE}<geom type='box' name='box' size='1 1 .1' pos='9 0 0'/>{world}</worldbody>{ties}{turned}</mujoco>"
    (tmp_path / "tied.xml").write_text(text)
    model = MuJoCoModel(tmp_path / "tied.xml", "tied.xml")
    assert model.bodies([], False) == ["b", "c"]
    left_out = {name: model.body(name, None).unmodelled for name in "abc"}
    assert left_out == {"a": ["equality constraints"], "b": ["the pose of keyframe turned"], "c": ["tendons"]}
    assert model.body("b", None).others == ["box"]
    assert model.body("b", "box").others == []


def test_settings_for_a_restitution_are_tried(tmp_path):
    for integrator, dt in (("Euler", 2e-3), ("RK4", 2.5e-4)):
        body = body_of(tmp_path, FREE.format('<geom size=".05"/>'), f'integrator="{integrator}"')
        answers = [answer for answer in impact(body, [2e-3]) if answer.speed == 3.0]
        [missed] = Targets(0.5, None).judged(body, answers)
        [remedy] = missed.findings[-1].remedies
        assert remedy.value == pytest.approx(0.5, abs=0.02)
        assert (f'timestep="{dt:g}"' in remedy.text) is (dt != 2e-3)
        assert f'solref="{"0 -750" if integrator == "Euler" else "-294912 -277.259"}"' in remedy.text


def test_lowest_points_of_turned_round_shapes_are_exact(tmp_path):
    geoms = ['<geom type="cylinder" size=".05 .01" euler="20 30 40"/>', '<geom type="ellipsoid" size=".05 .02 .01" euler="20 30 40"/>']
    for geom in geoms:
        body = body_of(tmp_path, FREE.format(geom))
        [number] = body._alone.geoms
        up = body._file.data.geom_xmat[number].reshape(3, 3)[2]  # the vertical in the frame of the geometry
        sizes = body._file.model.geom_size[number]
        height = np.linalg.norm(sizes * up) if "ellipsoid" in geom else sizes[1] * abs(up[2]) + sizes[0] * math.hypot(up[0], up[1])
        assert body.start()[1] == pytest.approx(height, rel=1e-12)


def test_equal_bodies_are_alike_and_others_are_not(tmp_path):
    settings = ("", "", 'friction="1.5"', 'margin=".001"', 'mass="2"')
    geoms = [*(f'<geom type="box" size=".05 .05 .05" {setting}/>' for setting in settings), '<geom type="box" size=".05 .05 .04"/>']
    bodies = [f"<body><freejoint/>{geom}</body>" for geom in geoms]
    body_of(tmp_path, "".join([*bodies, bodies[0].replace("<body", '<body euler="0 0 30"')]))
    model = MuJoCoModel(tmp_path / "model.xml", "model.xml")
    likenesses = [model.body(name, None).likeness for name in model.bodies([], False)]
    assert likenesses[0] == likenesses[1]
    assert len(set(likenesses)) == len(likenesses) - 1
