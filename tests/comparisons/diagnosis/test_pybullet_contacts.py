"""Contacts of bodies of URDF files as PyBullet has them."""

import math
from pathlib import Path

import pytest

pytest.importorskip("pybullet", exc_type=ImportError)

from support.urdf_files import BOX, body, joint, link, two_links

from dropspin.comparisons.diagnosis.answers import COEFFICIENT, Answer
from dropspin.comparisons.diagnosis.landing import rest
from dropspin.comparisons.diagnosis.remedies import Targets, answers_to
from dropspin.comparisons.diagnosis.sliding import roll, slide

STEP = 1.0 / 240.0


def test_settings_of_contacts_are_those_of_the_links_that_touch(tmp_path):
    def contact(mu, e):
        return f'<contact><lateral_friction value="{mu}"/><restitution value="{e}"/></contact>'

    def standing(x, *of_b):
        parts = link(BOX, extra=contact(0.1, 0.9)), link(BOX, name="b", extra=contact(*of_b))
        return body(tmp_path, *parts, joint("fixed", origin=f'<origin xyz="{x} 0 {-0.5 * (not x)}"/>'))

    below, beside, alike = standing(0, 0.9, 0.0), standing(1, 0.9, 0.0), standing(1, 0.1, 0.9)
    assert (below.friction, below.restitution, str(below.settings["friction"])) == (
        0.9,
        0.0,
        'value="0.9" (model.urdf, line 1)',
    )
    assert "restitution" not in below.remedies
    assert math.isnan(beside.friction)
    assert beside.restitution is None
    assert alike.friction == 0.1
    [missed] = [answer.findings[0].detail for answer in Targets(friction=0.5).judged(beside, [])]
    assert missed == "the target is 0.5, but the geometries that touch the surface differ in it"


def test_restitution_of_several_links_is_called_for_each(tmp_path):
    calls = two_links(tmp_path).patch({"own restitution": 0.3}, STEP)
    assert calls == "for link in range(-1, getNumJoints(body)): changeDynamics(body, link, restitution=0.3)"


def test_slide_on_a_soft_contact_of_the_file_is_due_to_the_contact(tmp_path):
    """PyBullet's own slides take 18.6 mm with the file's contact at 1/240 s, 20.1 mm without it, and 19.7 mm with it at 0.29 ms."""
    soft = '<contact><lateral_friction value="0.6"/><stiffness value="1000"/><damping value="10"/></contact>'
    box = body(tmp_path, link('<box size=".2 .2 .2"/>', extra=soft))
    for answer in answers_to(slide, box):
        [found] = [one for one in answer.findings if one.kind == "setting"]
        assert found.settings == ("stiffness",)
        assert [(one.text, one.value) for one in found.remedies] == [
            (box.patch({"stiffness": "none"}, STEP), pytest.approx(0.0201, rel=1e-2))
        ]


def test_friction_for_a_target_is_that_of_every_link(tmp_path):
    """The coefficient of a contact is the product with that of plane.urdf, which is 1."""
    boxes = body(tmp_path, link(BOX), link(BOX, name="b"), joint("fixed", origin='<origin xyz="1 0 0"/>'))
    [answer] = Targets(friction=0.8).judged(boxes, [Answer("friction", COEFFICIENT, "1", measured=boxes.friction)])
    [remedy] = answer.findings[0].remedies
    assert (remedy.text, remedy.value) == (
        "for link in range(-1, getNumJoints(body)): changeDynamics(body, link, lateralFriction=0.8)",
        pytest.approx(0.8, rel=1e-12),
    )


def test_rolling_friction_that_slows_a_ball_is_named_and_removed(tmp_path):
    """Beside damping; without both it rolls on."""
    ball = body(tmp_path, link('<sphere radius=".1"/>', moments=(0.004,) * 3, extra='<contact><rolling_friction value="0.02"/></contact>'))
    [answer] = answers_to(roll, ball)
    [finding] = answer.findings
    assert answer.measured < 0.3
    assert (finding.kind, [str(ball.settings[name]) for name in finding.settings][-1]) == (
        "setting",
        '<rolling_friction value="0.02"> (model.urdf, line 1)',
    )
    [remedy] = finding.remedies
    assert "changeDynamics(body, -1, rollingFriction=0)" in remedy.text
    assert remedy.value == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(
    ("filters", "falls"),
    [('group="0" mask="0"', True), ('group="2" mask="1"', True), ('group="0"', False), ('mask="1"', False), ("", False)],
)
def test_link_whose_collision_filter_excludes_static_bodies_falls_through_the_floor(tmp_path, filters, falls):
    """By its group and its mask, as in PyBullet alone; no smaller step prevents it."""
    block = body(tmp_path, link(BOX, "0.05").replace("<collision", f"<collision {filters}"))
    through = [finding for answer in rest(block, (STEP,)) for finding in answer.findings if answer.quantity == "support"]
    assert bool(through) == falls
    assert all("exclude static bodies" in finding.detail for finding in through)
    import pybullet
    import pybullet_data

    client = pybullet.connect(pybullet.DIRECT)
    pybullet.loadURDF(str(Path(pybullet_data.getDataPath(), "plane.urdf")), physicsClientId=client)
    number = pybullet.loadURDF(str(tmp_path / "model.urdf"), [0.0, 0.0, 1.0], physicsClientId=client)
    pybullet.setGravity(0, 0, -9.81, client)
    for _ in range(480):
        pybullet.stepSimulation(client)
    assert (pybullet.getBasePositionAndOrientation(number, client)[0][2] < -1.0) == falls
    pybullet.disconnect(client)
