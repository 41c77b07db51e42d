"""Settings of MJCF and URDF files that change what a body's exact motion is, compared with closed forms and other integrations."""

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from support.model_files import FREE, body_of, by_quantity, findings_of, ladder

from dropspin.comparisons.diagnosis.answers import DECAY_TIME, REBOUND
from dropspin.comparisons.diagnosis.flight import fall, spin
from dropspin.comparisons.diagnosis.inertia import inertia
from dropspin.comparisons.diagnosis.landing import IMPACTS, impact, rest
from dropspin.comparisons.diagnosis.mujoco_body import MuJoCoModel
from dropspin.comparisons.diagnosis.remedies import answers_to
from dropspin.comparisons.diagnosis.sliding import slide
from dropspin.scenarios.truths.damped_joint import time_constant

HALF = (0.1, 0.05, 0.03)
MOMENTS = [sum(h * h for j, h in enumerate(HALF) if j != axis) / 3.0 for axis in range(3)]  # of 1 kg
BOX = '<geom name="g" type="box" size=".1 .05 .03" mass="1"/>'
LINK = '<robot name="r"><link name="b">{}<collision>{}<geometry><box size=".2 .1 .06"/></geometry></collision></link></robot>'


def numbers(values):
    return " ".join(map(str, values))


def turned(quat, attribute, values):
    return FREE.format(f'<inertial pos="0 0 0" quat="{quat}" mass="1" {attribute}="{numbers(values)}"/>{BOX}')


def impossible(body):
    return [answer for answer in inertia(body) if answer.findings]


@pytest.mark.parametrize("order", [(2, 1, 0), (0, 1, 2)], ids=["right", "wrong"])
def test_inertia_is_that_about_the_turned_axes_of_its_frame(tmp_path, order):
    """A quarter turn about y exchanges x and z: moments in the order z, y, x are those of the box, and in the order x, y, z are not."""
    moments = [MOMENTS[axis] for axis in order]
    body = body_of(tmp_path, turned(".70710678 0 .70710678 0", "diaginertia", moments))
    assert body.written.inertia == pytest.approx(np.diag(moments[::-1]), abs=1e-9)
    assert body.ignored == []
    if order == (2, 1, 0):
        assert impossible(body) == []
    else:
        [answer] = impossible(body)
        x, y, z = moments[::-1]
        assert answer.measured == pytest.approx(max((y + z - x) / 2 / HALF[0] ** 2, (x + y - z) / 2 / HALF[2] ** 2), rel=2e-3)


def test_turned_frame_of_a_urdf(tmp_path):
    x, y, z = MOMENTS
    tensor = f'<inertia ixx="{z}" ixy="0" ixz="0" iyy="{y}" iyz="0" izz="{x}"/>'
    inertial = f'<inertial><origin rpy="0 1.5707963267948966 0"/><mass value="1"/>{tensor}</inertial>'
    body = body_of(tmp_path, LINK.format(inertial, ""), file="box.urdf")
    assert np.diag(body.written.inertia) == pytest.approx(MOMENTS, rel=1e-6)
    assert impossible(body) == []


def test_inertia_of_zero_is_impossible_and_that_of_a_solid_is_simulated(tmp_path):
    tensor = '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>'
    body = body_of(tmp_path, LINK.format(f'<inertial><mass value="1"/>{tensor}</inertial>', ""), file="box.urdf")
    [answer] = impossible(body)
    assert (answer.quantity, answer.measured) == ("least moment / largest", 0.0)
    assert np.diag(body.inertia) == pytest.approx(MOMENTS, rel=1e-9)
    assert "measured with that of a uniform solid" in {name: made for name, _, made in body.ignored}["inertia"]


def test_wrong_centre_of_mass_is_told_from_wrong_moments(tmp_path):
    inertial = f'<inertial pos="0 0 0" mass="1" diaginertia="{numbers(MOMENTS)}"/>'
    body = body_of(tmp_path, FREE.format(inertial + BOX.replace("/>", ' pos="0 0 .03"/>')))
    [answer] = impossible(body)
    assert (answer.quantity, answer.measured) == ("distance of the centre of mass from a solid's", pytest.approx(0.03))
    assert "which is displaced by (0, 0, 0.03) m" in answer.findings[0].remedies[0].text
    assert [str(body.settings[name]) for name in answer.findings[0].settings] == ['pos="0 0 0" (model.xml, line 1)']


def test_inertia_of_a_solid_is_proposed_with_the_centre_of_mass_without_which_it_is_impossible(tmp_path):
    """A rod with its moment about one end, ml²/3, too small a moment about its axis, and its centre of mass at that end."""
    for place, also in ((".5", ", and its centre of mass, displaced by (0.5, 0, 0) m along the body's axes"), ("0", "")):
        rod = f'<geom type="box" size=".5 .05 .02" pos="{place} 0 0"/><inertial pos="0 0 0" mass="1" diaginertia=".001 .333 .335"/>'
        [answer] = impossible(body_of(tmp_path, FREE.format(rod), head='<compiler balanceinertia="true"/>'))
        text = answer.findings[0].remedies[0].text
        assert text.startswith("the inertia of a uniform solid")
        assert text.endswith("about the body's axes" + also)


def test_mass_and_inertia_that_the_compiler_changes_are_said(tmp_path):
    body = body_of(tmp_path, FREE.format(BOX), head='<compiler boundmass="3" boundinertia=".02"/>')
    changed = {name: (setting.text, made) for name, setting, made in body.ignored}
    assert changed == {
        "mass": ('boundmass="3"', "changed: 3 kg"),
        "inertia": ('boundinertia=".02"', "changed: moments 0.02, 0.02, 0.02 kg m²"),
    }
    assert impossible(body) == []


@pytest.mark.parametrize(
    ("flag", "named"),
    [
        ("", {"o_margin": "not used: the flag override is not set"}),
        ('gravity="disable" override="enable"', {"gravity": "not used"}),
        ('override="enable"', {}),
    ],
)
def test_options_that_a_flag_disables_or_does_not_enable_are_said(tmp_path, flag, named):
    body = body_of(tmp_path, FREE.format(BOX), 'o_margin="0.01"', f"<option><flag {flag}/></option>")
    assert {name: made for name, _, made in body.ignored} == named
    assert all(setting.line == 1 and setting.text.startswith(name) for name, setting, _ in body.ignored)


def test_geometries_that_a_range_of_groups_leaves_out_of_the_mass_are_said(tmp_path):
    range_of_groups = '<compiler inertiagrouprange="3 4"/>'
    world = FREE.format(BOX.replace("/>", ' group="3"/>') + '<geom size=".05" mass="2"/>')
    assert body_of(tmp_path, world).ignored == []
    changed = {name: (setting.text, made) for name, setting, made in body_of(tmp_path, world, head=range_of_groups).ignored}
    assert changed["mass"] == ('inertiagrouprange="3 4"', "changed: 1 kg")
    assert changed["inertia"][0] == 'inertiagrouprange="3 4"'


@pytest.mark.parametrize(
    ("settings", "changing"),
    [('inertiafromgeom="true"', "inertiafromgeom"), ('boundinertia=".02"', "boundinertia")],
)
def test_of_several_settings_of_the_compiler_the_one_that_changes_a_value_is_named(tmp_path, settings, changing):
    head = f'<compiler boundmass=".001" balanceinertia="true" {settings}/>'
    inertial = f'<inertial pos="0 0 0" mass="2" diaginertia="{numbers(MOMENTS)}"/>'
    other = '<body pos="0 0 2"><joint/><inertial pos="0 0 0" mass="1" diaginertia=".9 .1 .1"/></body>'  # possible if it is balanced
    made = [made for _, _, made in body_of(tmp_path, FREE.format(inertial + BOX) + other, head=head, name="b").ignored]
    assert [(one.split(", by ")[1].split("=")[0], one.count("line")) for one in made] == [(changing, 1)]


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass' is deprecated")
def test_all_settings_of_the_compiler_that_act_on_a_mass_by_density_are_named_the_largest_effect_first(tmp_path):
    """MuJoCo raises the mass of another body from 0.02 to 0.1 kg, then scales both to 3 kg: 2.94 kg without the first, 1 without both."""
    other = '<body pos="0 0 2"><joint/><inertial pos="0 0 0" mass=".02" diaginertia="1e-4 1e-4 1e-4"/></body>'
    head = '<compiler boundmass="0.1" settotalmass="3"/>'
    body = body_of(tmp_path, FREE.format(BOX) + other, head=head, name="b")
    [(setting, made)] = [(setting.text, made) for name, setting, made in body.ignored if name == "mass"]
    assert setting == 'settotalmass="3"'
    assert made.startswith('changed: 2.727 kg, by boundmass="0.1"')


def test_bodies_without_mass_may_stand_beside_one_whose_mass_is_kept(tmp_path):
    world = FREE.format(BOX) + '<body name="bare"><joint type="hinge"/></body>'
    body = body_of(tmp_path, world, head='<compiler boundmass=".001" boundinertia=".0001"/>', name="b")
    assert body.ignored == []
    assert body.written.mass == pytest.approx(1.0)


def test_damping_by_the_cube_of_the_speed(tmp_path):
    first, second, third = damping = (0.1, 0.2, 0.05)
    world = f'<body name="b" pos="0 0 1"><joint type="free" damping="{numbers(damping)}"/>{BOX}</body>'
    body = body_of(tmp_path, world)
    solved = solve_ivp(lambda _, y: [y[1], 9.81 - y[1] * (first + y[1] * (second + y[1] * third))], (0, 1), [0, 0], rtol=1e-12, atol=1e-12)
    [fallen, _] = fall(body, ladder(body))
    assert fallen.in_force == pytest.approx(solved.y[0, -1], rel=1e-9)
    assert fallen.measured == pytest.approx(fallen.in_force, rel=2e-3)
    exact, _ = quad(lambda w: 1.0 / (w * (first + w * (second + w * third))), 10.0 / math.e, 10.0, epsrel=1e-13)
    assert time_constant(10.0, 0.3, 0.2, *damping) == pytest.approx(0.5 * exact, rel=1e-12)
    assert time_constant(10.0, 0.3, 0.2, first, second, 1e-12) == pytest.approx(time_constant(10.0, 0.3, 0.2, first, second), rel=1e-9)


def test_damping_acts_at_the_origin_of_the_joint(tmp_path):
    """Of a centre of mass away from it, a spin decays by the force as well: at a finer step, MuJoCo alone has the exact time."""
    inertial = f'<inertial pos=".2 0 0" mass="1" diaginertia="{numbers(MOMENTS)}"/>'
    world = f'<body name="b" pos="0 0 1"><joint type="free" damping=".1"/>{inertial}{BOX}</body>'
    body = body_of(tmp_path, world, 'timestep="2e-4" integrator="RK4"')
    about_y = {answer.direction: answer for answer in spin(body, [body.dt]) if answer.quantity == DECAY_TIME}["y"]
    assert about_y.measured == pytest.approx(about_y.in_force, rel=1e-5)
    assert about_y.in_force < 0.97 * MOMENTS[1] / 0.1


def test_damper_that_a_step_of_rk4_does_not_resolve_is_an_error_of_the_step(tmp_path):
    world = f'<body name="b" pos="0 0 1"><joint type="free" damping="2"/>{BOX}</body>'
    body = body_of(tmp_path, world, 'integrator="RK4"')
    about_x = next(iter(answers_to(spin, body)))
    assert 2.0 * body.dt / MOMENTS[0] > 2.785  # where RK4 is unstable
    assert about_x.detail == "none"
    assert [(found.kind, found.detail) for found in about_x.findings] == [("time step", "because the spin diverges")]


@pytest.mark.parametrize(
    ("body", "option", "head", "raised"),
    [
        ('gravcomp="0.5"', "", "", 0.0),
        ("", 'o_margin="0.01"', '<option><flag override="enable"/></option>', 0.01),
    ],
    ids=["half of the weight", "override"],
)
def test_depth_at_rest_follows_from_what_is_in_force(tmp_path, body, option, head, raised):
    world = FREE.replace("<body", f"<body {body}").format(BOX)
    found = body_of(tmp_path, world, option, head=head)
    depth = by_quantity(rest(found, ladder(found)))["penetration"]
    assert depth.measured == pytest.approx(depth.in_force, abs=1e-8)
    assert depth.in_force == pytest.approx(-raised, abs=2e-4)
    settings = [found.settings[name].text for finding in depth.findings for name in finding.settings]
    assert settings == (['o_margin="0.01"'] if raised else [])


@pytest.mark.parametrize("gap", [0.0, 0.005, 0.02])
def test_gap_does_not_change_where_a_body_rests(tmp_path, gap):
    body = body_of(tmp_path, FREE.format(BOX.replace("/>", f' margin=".02" gap="{gap}"/>')))
    [(answer, found)] = findings_of(body, rest)
    assert (found.settings, answer.measured) == (("margin",), pytest.approx(-0.02, abs=2e-4))


def test_body_that_does_not_come_to_rest_is_an_error(tmp_path):
    body = body_of(tmp_path, FREE.format(BOX.replace("/>", ' solref="-1e6 -100"/>')))
    found = {answer.quantity: finding.kind for answer, finding in findings_of(body, rest)}
    assert found["penetration"] == "time step"


def test_friction_that_depends_on_the_direction(tmp_path):
    """In the direction of a slide along x, the second coefficient of a pair acts."""
    pair = '<contact><pair geom1="g" geom2="floor" friction=".1 .05 .005 .0001 .0001"/></contact>'
    body = body_of(tmp_path, FREE.format(BOX), head=pair)
    along, diagonal = slide(body, ladder(body))
    assert along.in_force == pytest.approx(0.25 / (2.0 * 0.05 * 9.81))
    assert along.measured == pytest.approx(along.in_force, rel=5e-3)
    assert (math.isnan(diagonal.in_force), diagonal.findings) == (True, ())


def test_short_slide_with_a_large_error_is_a_finding(tmp_path):
    """A contact that bounces: the default contact mends the slide along an axis, and with the elliptic cone the one at 45 degrees."""
    body = body_of(tmp_path, FREE.format(BOX.replace("/>", ' solref="-1e4 -10"/>')))
    found = findings_of(body, slide)
    [(along, of_contact), (diagonal, of_both)] = found
    assert (along.direction, of_contact.kind, of_contact.settings) == ("0°", "setting", ("solref",))
    assert (diagonal.direction, of_both.kind, of_both.settings) == ("45°", "setting", ("cone", "solref"))
    assert of_both.remedies[0].value == pytest.approx(of_contact.remedies[0].value, rel=0.05)


def test_stiffness_and_the_direction_of_gravity_are_left_out_and_named(tmp_path):
    world = f'<body name="b" pos="0 0 1"><joint type="free" stiffness="100"/>{BOX}</body>'
    assert body_of(tmp_path, world).unmodelled == ["the stiffness of its joint"]
    for gravity, angle in (("0 0 9.81", 180), ("0 -9.81 0", 90), ("5 0 -5", 45)):
        body = body_of(tmp_path, FREE.format(BOX), f'gravity="{gravity}"')
        assert body.unmodelled == [f"a gravity {angle}° from the inward normal of the surface"]
        assert body.lands == (angle < 90)


def test_model_in_millimetres_is_named(tmp_path):
    """Gravity of 9.81 m/s² is 9810 mm/s²."""
    named = [body_of(tmp_path, FREE.format(BOX), f'gravity="0 0 -{g}"').ignored for g in (9810, 980.7, 9.81, 5000)]
    assert [[name for name, *_ in ignored] for ignored in named] == [["gravity"], ["gravity"], [], []]
    assert named[0][0][1].line == 1
    assert "a model in mm" in named[0][0][2]


@pytest.mark.parametrize(("head", "option"), [('<option><flag gravity="disable"/></option>', ""), ("", 'gravity="0 0 0"')])
def test_absence_of_gravity_is_stated(tmp_path, head, option):
    [answer] = fall(body_of(tmp_path, FREE.format(BOX), option, head=head), [0.002])
    assert (answer.quantity, answer.detail, answer.findings) == ("gravity", "none", ())


def test_start_inside_the_floor_is_named(tmp_path):
    world = FREE.replace('pos="0 0 1"', 'pos=".3 0 {}" euler="0 90 0"').replace("{}</body>", BOX + "</body>")
    sunk = body_of(tmp_path, world.format(HALF[0] - 0.02))
    assert sunk.unmodelled == ["a start 0.02 m inside the surface"]
    assert body_of(tmp_path, world.format(HALF[0])).unmodelled == []
    joined = f'<geom name="hill" type="plane" size="1 1 .1" pos="0 0 .5" euler="30 0 0"/>{world.format(0.5)}'
    assert body_of(tmp_path, joined, on="hill", name="b").unmodelled[0].startswith("a start ")


def test_name_with_a_line_break_stays_on_one_line(tmp_path):
    body = body_of(tmp_path, FREE.replace('"b"', '"b&#10;0 findings."').format(BOX))
    assert body.name == r"b\n0 findings."


EXCLUDED = '<contact><exclude body1="world" body2="b"/></contact>'
HIDDEN = BOX.replace("/>", ' contype="0" conaffinity="0"/>')
BARE = f'<inertial pos="0 0 0" mass="1" diaginertia="{numbers(MOMENTS)}"/>'


@pytest.mark.parametrize(
    ("geom", "option", "why"),
    [
        (HIDDEN, "", "no geometry of the body collides with it"),
        (HIDDEN, EXCLUDED.replace('"world"', '"c"'), "no geometry of the body collides with it"),
        (BARE, "", "the body has no geometry"),
        (BOX, '<option><flag contact="disable"/></option>', 'contacts are disabled, by contact="disable" (model.xml, line 1)'),
        (BOX, '<option><flag constraint="disable"/></option>', 'contacts are disabled, by constraint="disable" (model.xml, line 1)'),
        (BOX, EXCLUDED, f"{EXCLUDED.removeprefix('<contact>').split('/')[0]}> (model.xml, line 1) leaves out their contacts"),
        (BARE + HIDDEN, '<compiler discardvisual="true"/>', 'the body has no geometry, by discardvisual="true" (model.xml, line 1)'),
    ],
    ids=["bits", "excluded from another", "bare", "disabled", "unconstrained", "excluded", "discarded"],
)
def test_body_that_falls_through_the_floor(tmp_path, geom, option, why):
    other = '<body name="c" pos="3 0 1"><freejoint/><geom size=".1"/></body>'
    body = body_of(tmp_path, FREE.format(geom) + other, head=option, name="b")
    [(answer, found)] = findings_of(body, rest)
    assert (answer.quantity, answer.detail, found.detail) == ("support", "none", f"floor does not hold it, because {why}")
    assert body_of(tmp_path, FREE.format(BOX)).missed == ""


def test_floor_that_collides_with_nothing_is_told_from_the_plane_that_is_added(tmp_path):
    hidden = '<geom name="hidden" type="plane" size="1 1 .1" contype="0" conaffinity="0"/>'
    (tmp_path / "model.xml").write_text(f"<mujoco><worldbody>{hidden}{FREE.format(BOX)}</worldbody></mujoco>")
    body = MuJoCoModel(tmp_path / "model.xml", "model.xml").body("b", None)
    assert body.surface == "a plane with default settings"
    assert body.missed == "hidden does not hold it, because no geometry of the body collides with it"


def rebound_of_a_spring(stiffness, damping, impedance, speed, gravity=9.81):
    """The rebound over the impact speed of a mass on MuJoCo's contact of constant impedance, whose force only pushes."""

    def moving(_, state):
        pushes = gravity - (damping * state[1] + stiffness * state[0]) / impedance
        return [state[1], -gravity + max(0.0, impedance * pushes)]

    def leaves(_, state):
        return state[0]

    leaves.terminal, leaves.direction = True, 1.0
    return solve_ivp(moving, (0.0, 3.0), [0.0, -speed], events=leaves, rtol=1e-10, atol=1e-12).y_events[0][0][1] / speed


@pytest.mark.sample(1)
@pytest.mark.parametrize("speed", [3.0, 1.0])
def test_impact_that_lasts_half_a_second_is_watched_to_its_end(tmp_path, speed):
    soft = '<geom type="sphere" size=".1" mass="1" solref="-50 -2" solimp=".95 .95 .001 .5 2" priority="1"/>'
    body = body_of(tmp_path, FREE.format(soft), 'timestep="0.0005"')
    [of_speed] = [answer for answer in impact(body, ladder(body)) if answer.quantity == REBOUND and answer.speed == speed]
    assert of_speed.measured == pytest.approx(rebound_of_a_spring(50.0, 2.0, 0.95, speed), rel=0.02)


def test_body_that_passes_through_a_thin_table_has_no_rebound(tmp_path):
    table = '<geom name="table" type="box" size=".2 .2 .002" pos="0 0 .1"/>'
    coin = FREE.replace('pos="0 0 1"', 'pos="0 0 .11"').format('<geom type="cylinder" size=".01 .001" density="7800"/>')
    body = body_of(tmp_path, table + coin, on="table")
    through = [(answer, found) for answer, found in findings_of(body, impact) if answer.quantity == REBOUND]
    assert [answer.speed for answer, _ in through] == list(IMPACTS)
    for answer, found in through:
        assert math.isnan(answer.measured)
        assert answer.detail == "none"
        assert "passes through the surface" in found.detail


def test_pyramidal_cone_through_which_a_rough_body_falls_is_named_and_no_other_setting(tmp_path):
    """The softening grows with the fourth power of the friction: harder contacts and finer steps do not hold the body."""
    box = FREE.format('<geom type="box" size=".05 .05 .05" friction="1000" solimp="0.998 0.998 0.001" solref="0.001 1"/>')
    body = body_of(tmp_path, box)
    found = [(answer.quantity, found) for question in (impact, rest) for answer, found in findings_of(body, question)]
    named = {REBOUND: ("cone",), "penetration": ("cone", "friction"), "drift speed": ("cone",)}
    assert {quantity: finding.settings for quantity, finding in found} == named
    depths = [remedy.value for quantity, finding in found if quantity == "penetration" for remedy in finding.remedies]
    assert depths == pytest.approx([1.5e-5], rel=0.1)


@pytest.mark.parametrize(("option", "depths"), [("", [0.01594]), ('impratio="500"', []), ('cone="elliptic"', [])])
def test_depth_of_a_rough_body_at_rest_is_due_to_the_pyramidal_cone_and_the_friction(tmp_path, option, depths):
    """MuJoCo's own box is 15.9 mm deep, as the exact solution has it, with a large impratio or elliptic cones less than a millimetre."""
    box = FREE.format('<geom type="box" size=".1 .1 .1" friction="5"/>')
    found = [(answer, finding) for answer, finding in findings_of(body_of(tmp_path, box, option), rest) if answer.quantity == "penetration"]
    assert [answer.measured for answer, _ in found] == pytest.approx(depths, rel=1e-3)
    assert [answer.in_force for answer, _ in found] == pytest.approx(depths, rel=1e-3)
    for _, finding in found:
        assert (finding.kind, finding.settings) == ("setting", ("cone", "friction"))
        assert [remedy.value for remedy in finding.remedies] == pytest.approx([1.1e-4], rel=0.1)


def test_wind_that_blows_a_box_away_is_named_and_removed(tmp_path):
    """A light box of 0.4 m by 0.6 m in a wind of 8 m/s: on a floor with friction 1 it stands still in still air."""
    box = FREE.format('<geom type="box" size=".1 .2 .3" mass=".05"/>')
    body = body_of(tmp_path, box, 'density="1.2" wind="8 0 0"')
    [(answer, found)] = [pair for pair in findings_of(body, rest) if pair[0].quantity == "drift speed"]
    assert answer.measured > 1.0
    assert "wind" in found.settings
    remedy = next(one for one in found.remedies if 'wind="0 0 0"' in one.text)
    assert remedy.value < 1e-6


def bracket(inertia):
    """An L of 0.02 m by 0.02 m bars of 0.2 m, as a mesh of water, with a key for its inertia."""
    outline = [(0, 0), (0.2, 0), (0.2, 0.02), (0.02, 0.02), (0.02, 0.2), (0, 0.2)]
    vertices = [f"{x} {y} {z}" for z in (-0.01, 0.01) for x, y in outline]
    faces = [(0, n + 1, n) for n in range(1, 5)] + [(6, 6 + n, 7 + n) for n in range(1, 5)]
    faces += [face for n in range(6) for m in [(n + 1) % 6] for face in ((n, m, m + 6), (n, m + 6, n + 6))]
    faces_text = " ".join(numbers(face) for face in faces)
    mesh = f'<asset><mesh name="L" {inertia} vertex="{" ".join(vertices)}" face="{faces_text}"/></asset>'
    return mesh, FREE.format('<geom type="mesh" mesh="L" density="1000"/>')


def test_mesh_of_which_parts_are_counted_twice_is_named(tmp_path):
    mass = 1000.0 * 0.02 * (0.2 * 0.02 + 0.18 * 0.02)
    head, world = bracket("")
    body = body_of(tmp_path, world.replace("<geom", '<geom size=".01" mass="2"/><geom', 1), head=head)
    [(name, setting, made)] = body.ignored
    assert name == "mesh"
    assert setting.line == 1
    assert made.startswith(f"counted with {body.mass - 2.0 - mass:.4g} kg more than its volume has")
    head, world = bracket('inertia="exact"')
    body = body_of(tmp_path, world, head=head)
    assert body.mass == pytest.approx(mass, rel=1e-6)
    assert body.ignored == []


@pytest.mark.parametrize(("condim", "named"), [(3, ["torsional", "rolling"]), (4, ["rolling"]), (6, [])])
def test_friction_that_the_dimension_of_a_contact_leaves_out_is_named(tmp_path, condim, named):
    ball = f'<geom type="sphere" size=".1" mass="1" condim="{condim}" friction="1 .1 .1"/>'
    found = [made for name, _, made in body_of(tmp_path, FREE.format(ball)).ignored if name == "friction"]
    assert len(found) == bool(named)
    assert all(f"{name} friction needs condim" in found[0] for name in named)
    plain = FREE.format(ball.replace(' friction="1 .1 .1"', ' friction="1 .005 .0001"'))
    assert body_of(tmp_path, plain).ignored == []


@pytest.mark.parametrize(
    ("own", "floor", "option", "is_unused"),
    [
        ('friction=".3"', "", "", True),
        ('friction="0"', "", "", True),
        ('friction=".3" priority="1"', "", "", False),
        ('friction=".3"', 'friction=".8"', "", False),  # both are written
        ('friction="1.2"', "", "", False),
        ('friction=".3" condim="1"', 'condim="1"', "", False),
        ('friction=".3"', "", '<option o_friction=".3 .3 .005 .0001 .0001"><flag override="enable"/></option>', False),
    ],
)
def test_sliding_friction_below_the_default_of_the_floor_is_not_used(tmp_path, own, floor, option, is_unused):
    world = f'<geom name="f" type="plane" size="1 1 .1" {floor}/>' + FREE.format(f'<geom size=".1" mass="1" {own}/>')
    found = [(setting.text, made) for name, setting, made in body_of(tmp_path, world, on="f", head=option).ignored if "slide" in made]
    assert found == [(own, "not used for a slide: that of the other geometry, 1, is larger")] * is_unused


def test_friction_of_a_pair_with_two_and_of_a_file_without_a_floor_is_used(tmp_path):
    pair = '<contact><pair geom1="floor" geom2="g" friction=".5 .8"/></contact>'
    assert body_of(tmp_path, FREE.format('<geom name="g" size=".1" mass="1"/>'), head=pair).ignored == []
    box = BOX.replace("/>", ' friction=".3"/>')
    (tmp_path / "bare.xml").write_text(f"<mujoco><worldbody>{FREE.format(box)}</worldbody></mujoco>")
    assert MuJoCoModel(tmp_path / "bare.xml", "bare.xml").body("b", None).ignored == []


def test_friction_of_a_floor_that_the_dimension_of_a_contact_leaves_out_is_named(tmp_path):
    """The larger coefficients count: of the floor those of turning and rolling, of which four dimensions have the first alone."""
    floor, ball = 'friction="1 .5 .1"', '<geom size=".1" mass="1" condim="{}" friction="1 .02 .0001"/>'
    world = f'\n<geom name="f" type="plane" size="1 1 .1" {floor}/>\n'
    found = {
        condim: [(name, setting.text, made.split(",")[0]) for name, setting, made in body.ignored]
        for condim in (3, 4, 6)
        for body in [body_of(tmp_path, world + FREE.format(ball.format(condim)), on="f")]
    }
    both = "used in part: torsional friction needs condim 4 and rolling friction needs condim 6"
    assert found[3] == [
        ("friction in line 3", 'friction="1 .02 .0001"', "used in part: torsional friction needs condim 4"),
        ("friction", floor, both),
    ]
    assert found[4] == [("friction", floor, "used in part: rolling friction needs condim 6")]
    assert found[6] == []


@pytest.mark.parametrize(
    ("solref", "settings", "remedy"),
    [
        ("-2500 -100", ("cone", "timestep"), '<option timestep="0.0013" cone="elliptic"/>'),
        (".05 1", ("cone", "impratio", "timestep"), '<option timestep="0.0013" cone="elliptic" impratio="10"/>'),
    ],
)
def test_settings_of_a_slide_are_all_that_the_remedy_changes(tmp_path, solref, settings, remedy):
    box = f'<geom type="box" size=".05 .05 .05" mass=".3" solref="{solref}"/>'
    body = body_of(tmp_path, FREE.format(box), 'timestep="0.01"')
    [found] = [found for answer, found in findings_of(body, slide) if answer.direction == "45°"]
    assert found.settings == settings
    assert found.remedies[0].text.startswith(remedy)


def test_a_body_that_trembles_on_an_undamped_contact_of_the_file_is_due_to_this_contact(tmp_path):
    undamped = '<geom type="sphere" size=".1" density="200" solref="-1000 0"/>'
    [(answer, found)] = findings_of(body_of(tmp_path, FREE.format(undamped), 'timestep="0.0002"'), rest)
    assert (answer.quantity, found.kind, found.settings) == ("drift speed", "setting", ("solref",))
    damped = undamped.replace("-1000 0", "-1000 -30")
    assert findings_of(body_of(tmp_path, FREE.format(damped), 'timestep="0.0002"'), rest) == []


def test_mass_of_geometries_that_the_file_gives_no_mass_is_named(tmp_path):
    """A box of 1.2 litres: in a frame before one of 1 kg that collides, and as the only geometry of a link that is welded to another."""
    size = 'type="box" size=".1 .05 .03"'
    without, masked = f'<geom name="w" {size} contype="0" conaffinity="0" mass="0"/>', f'{size} contype="0" conaffinity="0"'
    visual = f'{without}<frame><geom name="v" {masked}{{}}/></frame><geom {size} mass="1"/>'
    made = {}
    for mass in ("", ' mass="0"'):
        alone = '<body name="marker" pos="1 0 1"><freejoint/><geom size=".1" contype="0" conaffinity="0"/></body>'
        found = body_of(tmp_path, FREE.format(visual.format(mass)) + alone, name="b").ignored
        made[mass] = [(name, setting.text.split()[1], text) for name, setting, text in found]
    assert made[' mass="0"'] == []
    assert made[""] == [("visual", 'name="v"', "counted in the mass with 1.2 kg, by density, although it collides with nothing")]
    geometry = '<collision><geometry><box size="0.2 0.1 0.06"/></geometry></collision>'
    inertial = '<inertial><mass value="5"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    joint = '<joint name="{}" type="fixed"><parent link="{}"/><child link="{}"/></joint>'
    links = f'<link name="foot"/><link name="b">{inertial}{geometry}</link><link name="c">{geometry}</link>'
    text = f'<robot name="r">{links}{joint.format("j", "foot", "b")}{joint.format("k", "b", "c")}</robot>'
    found = body_of(tmp_path, text, file="model.urdf").ignored
    missing = [(setting.text, made) for name, setting, made in found if name == "inertial"]
    assert missing == [("no inertial in link c", "missing: the mass is 1.2 kg, that of the geometries at the default density")]


def test_disabled_dampers_do_not_damp(tmp_path):
    """`<flag damper="disable"/>`: the spin of 10 rad/s stays."""
    world = f'<body name="b" pos="0 0 1"><joint type="free" damping="1"/>{BOX}</body>'
    body = body_of(tmp_path, world, head='<option><flag damper="disable"/></option>')
    assert [answer.measured for answer in spin(body, ladder(body))] == pytest.approx([1.0] * 3)
    assert [answer.in_force for answer in spin(body, ladder(body))] == pytest.approx([1.0] * 3)


def test_terminal_speed_is_not_that_of_the_damping_alone_in_air(tmp_path):
    """The drag of the air limits the speed to far less."""
    damped = f'<body name="b" pos="0 0 1"><joint type="free" damping="1e-3"/>{BOX}</body>'
    for option, count in (("", 1), ('density="1.2"', 0)):
        answers = fall(body := body_of(tmp_path, damped, option), ladder(body))
        assert [answer.quantity for answer in answers].count("terminal speed") == count


CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
FACES = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]


def cube(number):
    """A cube of 1 m of an OBJ file, beside the last one."""
    corners = [f"v {x + number} {y} {z}" for x, y, z in CORNERS]
    faces = ["f " + " ".join(str(int(index) + 8 * number) for index in face.split()) for face in FACES]
    return "\n".join([f"o cube{number}", *corners, *faces])


def test_mesh_of_several_objects_has_the_mass_of_the_first_one(tmp_path):
    """Two cubes of 1 m side by side: MuJoCo's mass is that of one, and both collide."""
    (tmp_path / "two.obj").write_text(f"{cube(0)}\n{cube(1)}\n")
    mesh = '<asset><mesh name="m" file="two.obj"/></asset>'
    body = body_of(tmp_path, FREE.format('<geom name="g" type="mesh" mesh="m" density="1"/>'), head=mesh)
    assert body.mass == pytest.approx(1.0)
    [(name, words, made)] = body.ignored
    assert (name, "two.obj" in str(words), made.startswith("read in part: all of its 16 vertices collide")) == ("mesh", True, True)
    assert body.solid is None


@pytest.mark.parametrize("mass", ['<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>', '<geom size=".1" mass="1"/>'])
def test_mesh_of_several_objects_without_mass_is_not_named(tmp_path, mass):
    (tmp_path / "two.obj").write_text(f"{cube(0)}\n{cube(1)}\n")
    mesh = '<asset><mesh name="m" file="two.obj"/></asset>'
    body = body_of(tmp_path, FREE.format(f'{mass}<geom name="g" type="mesh" mesh="m" mass="0"/>'), head=mesh)
    assert body.mass == pytest.approx(1.0)
    assert body.ignored == []


def test_part_with_mass_and_without_geometry_does_not_bound_the_inertia(tmp_path):
    """A load of 3 kg on a stalk above a box: the box does not contain the mass."""
    load = '<body pos=".08 0 .2"><inertial pos="0 0 0" mass="3" diaginertia=".003 .003 .003"/></body>'
    assert impossible(body_of(tmp_path, FREE.format(f'<geom type="box" size=".1 .05 .03" mass="2"/>{load}'))) == []


def test_frame_of_an_inertia_that_is_turned_by_mistake_is_named(tmp_path):
    """By 90 rad in place of 90°, of the moments of a solid box of 2 kg."""
    moments = 2.0 / 3.0 * np.array([0.05**2 + 0.03**2, 0.1**2 + 0.03**2, 0.1**2 + 0.05**2])
    inertial = f'<inertial pos="0 0 0" euler="0 90 0" mass="2" diaginertia="{numbers(moments)}"/><geom type="box" size=".1 .05 .03"/>'
    [answer] = impossible(body_of(tmp_path, FREE.format(inertial), head='<compiler angle="radian"/>'))
    [found] = answer.findings
    assert found.settings == ("turn",)
    assert found.remedies[0].text.startswith(
        "a frame that is not turned: the file's moments are then ixx, iyy, izz = 0.00227, 0.00727, 0.00833 kg m²"
    )


def test_moments_in_a_wrong_order_are_not_blamed_on_a_frame_that_is_not_turned(tmp_path):
    moments = 2.0 / 3.0 * np.array([0.1**2 + 0.05**2, 0.1**2 + 0.03**2, 0.05**2 + 0.03**2])  # of z, y and x
    inertial = f'<inertial pos="0 0 0" quat="1 0 0 0" mass="2" diaginertia="{numbers(moments)}"/><geom type="box" size=".1 .05 .03"/>'
    [answer] = impossible(body_of(tmp_path, FREE.format(inertial)))
    assert answer.findings[0].settings == ("inertia",)


def test_light_part_without_geometry_leaves_the_shape_to_bound_the_inertia(tmp_path):
    sensor = '<body pos="0 0 .04"><inertial pos="0 0 0" mass=".001" diaginertia="1e-7 1e-7 1e-7"/></body>'
    heavy = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom type="box" size=".1 .05 .03"/>'
    assert [answer.quantity for answer in impossible(body_of(tmp_path, FREE.format(heavy + sensor)))] == [
        "largest moment / largest possible"
    ]


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass' is deprecated")
def test_inertia_of_a_solid_is_that_of_the_mass_in_the_file(tmp_path):
    """`settotalmass` multiplies both: the inertia for the mass in force would be as impossible."""
    world = FREE.format('<inertial pos="0 0 0" mass="0.3" diaginertia="3e-4 1e-4 1e-4"/><geom type="box" size=".1 .05 .03"/>')
    body = body_of(tmp_path, world, head='<compiler settotalmass="10" balanceinertia="true"/>')
    [answer] = impossible(body)
    assert body.mass == pytest.approx(10.0)
    assert "ixx, iyy, izz = 0.00034, 0.00109, 0.00125 kg m²" in answer.findings[0].remedies[0].text
