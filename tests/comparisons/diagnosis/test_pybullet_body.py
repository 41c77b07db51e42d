"""Bodies of URDF files as PyBullet has them: against closed forms, and against PyBullet alone."""

import math

import numpy as np
import pytest

pytest.importorskip("pybullet", exc_type=ImportError)

from support.urdf_files import BALL, BOX, body, joint, link, model, two_links

from dropspin.comparisons.diagnosis import landing
from dropspin.comparisons.diagnosis.answers import REBOUND
from dropspin.comparisons.diagnosis.flight import fall, spin, tumble
from dropspin.comparisons.diagnosis.inertia import inertia
from dropspin.comparisons.diagnosis.landing import impact, rest
from dropspin.comparisons.diagnosis.pybullet_server import server
from dropspin.comparisons.diagnosis.remedies import Targets, answers_to
from dropspin.comparisons.diagnosis.sliding import creep, roll, slide
from dropspin.scenarios import DropspinError
from dropspin.scenarios.errors import UnknownName
from dropspin.scenarios.rotations import rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, UP, VELOCITY

LIVELY = f"{REBOUND} on a surface with restitution 1"
DTS = (1.0 / 240.0, 1.0 / 480.0, 1.0 / 960.0)
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def named(answers, quantity, speed=None):
    [found] = [answer for answer in answers if answer.quantity == quantity and speed in (None, answer.speed)]
    return found


def test_the_default_damping_slows_fall_and_spin_as_the_closed_forms_say(tmp_path):
    block = body(tmp_path, link(BOX, "0.05", (1.0, 1.0, 1.0)))
    of_fall, terminal = fall(block, DTS)
    assert of_fall.limit == pytest.approx(4.558187518993211, rel=1e-6)
    assert of_fall.in_force == pytest.approx(4.558187518993211, rel=1e-9)
    assert terminal.in_force == pytest.approx(15.168439615992398, rel=1e-12)
    for answer in spin(block, DTS):
        assert answer.limit == pytest.approx(0.6901699363194228, rel=1e-6)
        assert (answer.findings[0].kind, answer.findings[0].settings) == ("setting", ("damping",))
    [of_tumble, _] = tumble(block, DTS)
    assert of_tumble.limit == pytest.approx(of_tumble.in_force, rel=1e-5)
    end = block.motions(block.start()[np.newaxis], 0.01, 1000, -9.81 * UP, floor=False)[0, -1]
    assert -end[VELOCITY][1] == pytest.approx(terminal.in_force, rel=1e-4)


def test_a_motion_is_that_of_pybullet_alone(tmp_path):
    block = body(tmp_path, link(BOX, "0.05"))
    start = block.start(velocity=np.array([1.0, 2.0, 3.0]), spin=np.array([3.0, 4.0, 5.0]))
    states = block.motions(start[np.newaxis], DTS[0], 240, -9.81 * UP, floor=False)[0]
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    number = pybullet.loadURDF(str(tmp_path / "model.urdf"), start[POSITION], start[ORIENTATION], physicsClientId=client)
    pybullet.setGravity(0, -9.81, 0, client)
    pybullet.resetBaseVelocity(number, start[VELOCITY], start[SPIN], client)
    for _ in range(240):
        pybullet.stepSimulation(client)
    alone = [*pybullet.getBasePositionAndOrientation(number, client), *pybullet.getBaseVelocity(number, client)]
    np.testing.assert_allclose(states[-1], np.concatenate(alone), atol=1e-12)
    pybullet.disconnect(client)


def test_links_that_are_fixed_to_each_other_are_one_body(tmp_path):
    both = two_links(tmp_path)
    assert both.mass == pytest.approx(3.0)
    start = both.start(velocity=np.array([1.0, 2.0, 3.0]), spin=np.array([3.0, 4.0, 5.0]))
    [[again]] = both.motions(start[np.newaxis], DTS[0], 0, np.zeros(3), floor=False)
    np.testing.assert_allclose(again, start, atol=1e-15)

    def momentum(state):
        return rotate(state[ORIENTATION], both.inertia @ unrotate(state[ORIENTATION], state[SPIN]))

    free, errors = both.changed({"damping": 0.0}), []
    for dt in (1e-3, 5e-4):
        end = free.motions(start[np.newaxis], dt, round(0.5 / dt), np.zeros(3), floor=False)[0, -1]
        errors.append([np.abs(momentum(end) - momentum(start)).max(), np.abs(end[VELOCITY] - start[VELOCITY]).max()])
    assert np.log2(np.array(errors[0]) / errors[1]) == pytest.approx([1.0, 1.0], abs=0.2)
    assert np.max(errors) < 0.01 * np.linalg.norm(momentum(start))
    [of_tumble, _] = tumble(both, DTS)
    assert of_tumble.limit == pytest.approx(of_tumble.in_force, rel=1e-4)
    assert fall(both, DTS)[0].limit == pytest.approx(4.558187518993211, rel=1e-6)
    for answer in spin(both, DTS):
        assert answer.limit == pytest.approx(answer.in_force, rel=1e-4)


def test_an_inertia_that_is_not_in_force_is_named(tmp_path):
    block = body(tmp_path, link(BOX, "0.05", (1.0, 1.0, 1.0)))
    np.testing.assert_allclose(block.principal[0], [0.05 / 12 * s for s in (0.0034, 0.0234, 0.025)])
    [(name, setting, made)] = block.ignored
    assert (name, setting.file, setting.line) == ("inertia", "model.urdf", 1)
    assert made == "replaced by that of the bounding box of the collision geometry: 1.42e-05, 9.75e-05, 0.000104 kg m²"
    assert named(inertia(block), "largest moment / largest possible").measured == pytest.approx(3200.0)
    np.testing.assert_allclose(block.changed({"inertia": "file"}).inertia, np.eye(3))
    same = body(tmp_path, link(BOX, "1", (0.0034 / 12, 0.0234 / 12, 0.025 / 12)))
    assert same.ignored == []
    turned = body(tmp_path, link(BOX, "1", (1e-3, 2e-3, 2.5e-3), at='<origin xyz=".1 0 0" rpy="0 0 1.5707963267948966"/>'))
    np.testing.assert_allclose(turned.written.inertia, np.diag([2e-3, 1e-3, 2.5e-3]), atol=1e-9)
    answers = inertia(body(tmp_path, link(BOX, "1", (1e-3, 1e-3, 2.5e-3))))
    assert named(answers, "largest moment / sum of others").measured == pytest.approx(1.25)


def test_displacement_of_a_centre_of_mass_has_no_digits_of_rounding(tmp_path):
    """The inertial frame is turned by 0.5 rad, so that a displacement without y has y = 3e-17 m."""
    off = body(tmp_path, link('<box size=".1 .1 .1"/>', at='<origin xyz=".2 0 0" rpy="0 0 .5"/>', moments=(0.00167, 0.002, 0.003)))
    [answer] = [answer for answer in inertia(off) if answer.findings]
    assert "displaced by (-0.2, 0, 0) m" in answer.findings[0].remedies[0].text


def test_restitution_is_the_product_with_that_of_the_plane(tmp_path):
    ball = body(tmp_path, link(BALL, extra='<contact>\n<restitution value="0.5"/></contact>'))
    assert ball.restitution == 0.0
    [(name, setting, made)] = ball.ignored
    assert (name, str(setting)) == ("restitution", '<restitution value="0.5"> (model.urdf, line 2)')
    assert made == "0, the product with the restitution 0 of plane.urdf"
    assert ball.changed({"restitution": 1.0}).ignored == []
    answers = impact(ball, DTS[:1])
    assert named(answers, REBOUND, 3.0).measured == 0.0
    assert named(answers, LIVELY, 3.0).in_force == 0.5
    lively = ball.changed({"restitution": 1.0, "contactERP": 0.0})
    assert named(impact(lively, [1e-3]), REBOUND, 3.0).measured == pytest.approx(0.5, rel=0.01)


def test_remedies_are_tried(tmp_path, monkeypatch):
    monkeypatch.setattr(landing, "IMPACTS", (3.0,))
    ball = body(tmp_path, link(BALL, extra='<contact><restitution value="0.5"/></contact>'))
    of_fall = next(iter(answers_to(fall, ball)))
    assert of_fall.findings[0].remedies[0].text == "changeDynamics(body, -1, linearDamping=0, angularDamping=0)"
    assert of_fall.findings[0].remedies[0].value == pytest.approx(0.5 * 9.81 * (1.0 + DTS[0]), rel=1e-9)  # semi-implicit Euler
    of_impact = named(list(answers_to(impact, ball)), LIVELY, 3.0)
    [found] = of_impact.findings
    assert found.remedies[0].text == "setPhysicsEngineParameter(contactERP=0), setTimeStep(0.00052)"
    assert (found.kind, found.remedies[0].value) == ("setting", pytest.approx(0.5, rel=0.01))


def test_remedy_of_a_restitution_meets_it_at_all_speeds(tmp_path):
    """An eighth of the step gives 0.918 at 0.5 m/s."""
    ball = body(tmp_path, link(BALL, extra='<contact><restitution value="0.9"/></contact>'))
    missed = [finding for one in Targets(0.9).judged(ball, impact(ball, DTS[:1])) for finding in one.findings if finding.kind == "target"]
    assert [remedy.value for finding in missed for remedy in finding.remedies] == pytest.approx([0.9] * 3, abs=0.01)
    assert missed[0].remedies[0].text.endswith("setTimeStep(0.00013)")


def test_rolling_and_sliding_slow_down_by_friction_and_damping(tmp_path):
    [of_roll] = roll(body(tmp_path, link(BALL)), DTS)
    assert of_roll.limit == pytest.approx(of_roll.in_force, rel=1e-4)
    assert of_roll.in_force < 0.92
    puck = body(tmp_path, link('<box size=".4 .4 .04"/>', extra='<contact><lateral_friction value="0.1"/></contact>'))
    along = slide(puck, DTS)[0]
    assert puck.friction == pytest.approx(0.1)
    assert along.limit == pytest.approx(along.in_force, rel=2e-3)
    assert along.physical / along.in_force > 1.015


def test_a_body_rests_on_its_lowest_point_and_a_hull_on_its_margin(tmp_path):
    shifted = body(tmp_path, link(BOX, at='<origin xyz=".01 0 0" rpy=".3 .2 .1"/>', on='<origin xyz="0 0 .2" rpy="0 0 .4"/>'))
    assert 0.0 < rest(shifted, DTS[:1])[0].measured < 3e-5
    (tmp_path / "mesh.obj").write_text(TETRAHEDRON, encoding="utf-8")
    for geometry, place in (('<cylinder radius=".1" length=".3"/>', ""), ('<mesh filename="mesh.obj"/>', '<origin xyz=".1 .2 .3"/>')):
        hull = body(tmp_path, link(geometry, at='<origin xyz=".25 .25 .25"/>' if place else "", on=place))
        [depth, _] = rest(hull, DTS[:1])
        assert depth.measured == pytest.approx(-1e-3, rel=0.03)
        assert depth.in_force == pytest.approx(-0.99e-3)
    assert body(tmp_path, link('<capsule radius=".1" length=".3"/>')).start()[1] == pytest.approx(0.25)
    assert 'cylinder radius=".1"' in str(body(tmp_path, link('<cylinder radius=".1" length=".3"/>')).ignored)


def test_a_motion_does_not_depend_on_those_before_it(tmp_path):
    (tmp_path / "mesh.obj").write_text(TETRAHEDRON, encoding="utf-8")
    hull = body(tmp_path, link('<mesh filename="mesh.obj"/>'))  # hulls keep their contacts from step to step
    starts = np.array([hull.start(velocity=velocity) for velocity in (np.zeros(3), np.array([1.0, 0.0, 0.5]))])
    both = hull.motions(starts, DTS[0], 200, -9.81 * UP, floor=True)
    np.testing.assert_array_equal(hull.motions(starts[::-1], DTS[0], 200, -9.81 * UP, floor=True)[::-1], both)
    server().clear()
    np.testing.assert_array_equal(hull.motions(starts[1:], DTS[0], 200, -9.81 * UP, floor=True)[0], both[1])


def test_links_on_joints_are_cut_loose(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "arm.obj").write_text(TETRAHEDRON, encoding="utf-8")
    arm = link('<mesh filename="package://meshes/arm.obj" scale=".1 .1 .1"/>', "2", name="b")
    robot = model(tmp_path, link(BOX), arm, link(BALL, name="c"), joint("continuous"), joint("fixed", "b", "c"))
    before = robot.path.read_text(encoding="utf-8")
    assert robot.bodies([], True) == ["a", "b"]
    assert robot.bodies(["b"], False) == ["b"]
    loose = robot.body("b", "plane.urdf")
    assert loose.mass == 3.0
    assert [part.shape.shape for part in loose.parts] == ["mesh", "sphere"]
    assert robot.path.read_text(encoding="utf-8") == before
    with pytest.raises(DropspinError, match="no body is free: a, b are joined; name one with --body, or give --loose"):
        robot.bodies([], False)
    with pytest.raises(UnknownName, match="'c' is unknown"):
        robot.bodies(["c"], False)
    with pytest.raises(UnknownName, match="'floor' is unknown"):
        robot.body("b", "floor")


def test_what_pybullet_does_not_use_is_named(tmp_path):
    bare = '<link name="b"><collision><geometry><sphere radius=".1"/></geometry></collision></link>'
    odd = body(tmp_path, link(BOX, "1", extra='<lateral_friction value="0.9"/>'), bare, joint("floating"))
    assert odd.friction == 0.5
    assert {name: made for name, _, made in odd.ignored if name != "inertia"} == {
        "lateral_friction": "not read, because it is not within <contact>",
        "inertial of b": "missing: the mass is 1 kg",
        "joint": "replaced by a fixed joint",
    }


def test_visual_geometry_bounds_the_inertia_and_does_not_collide(tmp_path):
    shell = '<visual><origin xyz="0 0 -.5" rpy="0 0 .3"/><geometry><cylinder radius="1" length="3"/></geometry></visual>'
    mug = body(tmp_path, link(BOX, extra=shell, at='<origin xyz="0 0 .02" rpy=".1 0 0"/>', moments=(0.3, 0.3, 0.1)))
    assert [(part.shape.shape, part.collides) for part in mug.parts] == [("box", True), ("mesh", False)]
    assert not any(answer.findings for answer in inertia(mug))
    np.testing.assert_allclose(mug.points[:, 2].min(), -2.0 - 0.02, rtol=1e-6)
    assert 0.0 < rest(mug, DTS[:1])[0].measured < 3e-5


@pytest.mark.parametrize(
    ("elements", "message"),
    [
        ((link('<mesh filename="no.obj"/>'),), r"cannot find 'no.obj' in any directory"),
        ((link(BOX), link(BOX, name="b")), r"has 2 links without a parent \(a, b\)"),
        ((link(BOX), link(BOX, name="b"), joint("fixed"), joint("fixed", "b", "a")), "has 0 links without a parent"),
        ((link(BOX), link(BOX, name="b"), joint("loose")), "has unknown type:"),
        ((link(BOX, "0"),), "link a has no mass, so that PyBullet holds it still"),
        ((link(BOX, "-1"),), "gives link a the mass -1 kg"),
        ((link(BOX, moments=("x", 1, 1)),), 'line 1: ixx="x" is not a number'),
        ((link(BOX, "nan"),), "gives link a the mass nan kg"),
        ((link('<sphere radius="nan"/>'),), "the moments nan, nan, nan"),
        ((link('<box size="0 1 1"/>'),), "line 1: a geometry that is not a solid of finite size"),
        (('<link name="a"><inertial><mass value="1"/></inertial></link>',), "element; Could not parse inertial element for Link: a; "),
    ],
)
def test_a_file_that_is_wrong_is_refused_in_one_line(tmp_path, elements, message):
    with pytest.raises(DropspinError, match=message) as error:
        body(tmp_path, *elements)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith("model.urdf: ")


def test_concave_mesh_is_refused(tmp_path):
    """Bullet's has no margin: it rests on the plane, not 1 mm above as a hull."""
    (tmp_path / "mesh.obj").write_text(TETRAHEDRON, encoding="utf-8")
    concave = link('<mesh filename="mesh.obj"/>').replace("<collision>", '<collision concave="yes">')
    with pytest.raises(DropspinError, match="line 1: a concave mesh"):
        body(tmp_path, concave)


def test_the_server_holds_one_world(tmp_path):
    block = body(tmp_path, link(BOX))
    block.motions(block.start()[np.newaxis], DTS[0], 1, np.zeros(3), floor=False)
    assert server().getNumBodies() == 1
    block.motions(block.start()[np.newaxis], DTS[0], 1, np.zeros(3), floor=True)
    assert server().getNumBodies() == 2
    assert math.isclose(server().getPhysicsEngineParameters()["fixedTimeStep"], DTS[0])


def test_moments_of_a_sphere_are_named_with_the_factor_that_the_file_has(tmp_path):
    # 2/5 m r² = 0.1 kg m², times 3; as a solid sphere, 0.1 is the file's value too.
    ball = body(tmp_path, link(BALL, extra='<contact><inertia_scaling value="3.0"/></contact>'))
    [(name, _, made)] = ball.ignored
    assert name == "inertia"
    assert made == "replaced by that of the sphere times <inertia_scaling>: 0.3, 0.3, 0.3 kg m²"


@pytest.mark.parametrize(
    ("on", "made"), [("", "the sphere: 0.1"), ('<origin rpy="0 0 .5"/>', "the bounding box of the collision geometry: ")]
)
def test_what_replaces_the_inertia_of_a_ball_is_named(tmp_path, on, made):
    """Of a ball that is turned, PyBullet takes the inertia of the box that bounds it."""
    ball = body(tmp_path, link(BALL, moments=(0.2, 0.2, 0.2), on=on))
    [found] = [found for name, _, found in ball.ignored if name == "inertia"]
    assert found.startswith(f"replaced by that of {made}")


def test_a_ball_rolls_and_has_no_row_of_slides(tmp_path):
    ball = body(tmp_path, link(BALL))
    assert slide(ball, DTS) == []
    assert creep(ball, DTS) == []
    assert [answer.quantity for answer in roll(ball, DTS)] == ["fraction kept in 1 s"]


def test_a_contact_with_stiffness_and_damping_has_no_exact_rebound(tmp_path):
    soft = "<contact><stiffness value='1000'/><damping value='10'/></contact>"
    assert body(tmp_path, link(BALL, extra=soft)).restitution is None
    assert body(tmp_path, link(BALL)).restitution == 0.0


@pytest.mark.parametrize(("objects", "is_solid"), [(1, True), (2, False)])
def test_hull_around_several_objects_of_a_mesh_is_no_solid(tmp_path, objects, is_solid):
    """PyBullet makes a hull of each object, so that the inertia of the hull of all is no remedy."""
    apart = (
        TETRAHEDRON.replace("v 0 0 0", "v 3 0 0").replace("v 1 0 0", "v 4 0 0").replace("v 0 1 0", "v 3 1 0").replace("v 0 0 1", "v 3 0 1")
    )
    second = "o second\n" + apart.replace("f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4", "f 5 7 6\nf 5 6 8\nf 5 8 7\nf 6 7 8")
    (tmp_path / "mesh.obj").write_text("o first\n" + TETRAHEDRON + second * (objects - 1), encoding="utf-8")
    found = body(tmp_path, link('<mesh filename="mesh.obj"/>'))
    assert np.ptp(found.points[:, 0]) == pytest.approx(4.0 if objects == 2 else 1.0, abs=1e-6)
    assert (found.solid is not None) is is_solid
