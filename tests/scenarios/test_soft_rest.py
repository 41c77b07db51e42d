"""Depth at rest on MuJoCo's soft contacts, compared with 25 digits by mpmath and with MuJoCo itself, settled to rest."""

import math

import mpmath
import numpy as np
import pytest

from dropspin.scenarios.truths.soft_rest import GeomSettings, SoftContact, mixed

G = 9.81
BALL = 'type="sphere" size=".05"'
CUBE = 'type="box" size=".025 .025 .025"'


def model_of(geom="", floor="", option="", flag="", shape=BALL, joint="<freejoint/>", gravity=(0.0, 0.0, -G)):
    import mujoco

    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="1e-3" gravity="{" ".join(map(str, gravity))}" {option}>{flag}</option>'
        f'<worldbody><geom type="plane" size="1 1 .1" {floor}/><body pos="0 0 .05">{joint}<geom {shape} mass="2" {geom}/></body>'
        "</worldbody></mujoco>"
    )


def at_rest(model):
    """The contacts after 1.5 s, in which a body loses 1 % of its velocity in each step, beside the damping of its contacts."""
    import mujoco

    data = mujoco.MjData(model)
    for _ in range(1500):
        data.qvel *= 0.99
        mujoco.mj_step(model, data)
    assert np.abs(data.qvel).max() <= 1e-9
    return data.contact


def contact_of(model):
    floor, body = (
        GeomSettings(
            solref=tuple(model.geom_solref[geom]),
            solimp=tuple(model.geom_solimp[geom]),
            friction=tuple(model.geom_friction[geom]),
            condim=int(model.geom_condim[geom]),
            margin=float(model.geom_margin[geom]),
            priority=int(model.geom_priority[geom]),
            solmix=float(model.geom_solmix[geom]),
        )
        for geom in (0, 1)
    )
    return SoftContact(mixed(floor, body), bool(model.opt.cone), float(model.opt.impratio), float(model.opt.timestep))


def test_depth_of_the_default_contact_matches_25_digits():
    with mpmath.workdps(25):
        d = lambda r: mpmath.mpf("0.9") + mpmath.mpf("0.05") * 2 * (r * 1000) ** 2  # noqa: E731
        excess = lambda r: r - (1 - d(r)) * mpmath.mpf(G) * (mpmath.mpf("0.95") / 50) ** 2 / d(r) ** 2  # noqa: E731
        exact = mpmath.findroot(excess, mpmath.mpf("3.6e-4"))
    assert SoftContact(GeomSettings()).depth(G) == pytest.approx(float(exact), rel=1e-14)
    assert SoftContact(GeomSettings(condim=4)).depth(G) == pytest.approx(0.00026654, abs=5e-9)
    assert SoftContact(GeomSettings(condim=6)).depth(G) == pytest.approx(0.00016883, abs=5e-9)


SETTINGS = [
    ("", ""),
    ('condim="1"', 'condim="1"'),
    ('condim="4"', ""),
    ('condim="6" friction=".3"', 'friction=".2"'),
    ('friction="2"', ""),
    ('solref="-800 -30"', 'solref="-1000 -20"'),
    ('solref="-800 -30"', ""),
    ('solref=".0001 1"', 'solref=".0002 .8"'),
    ('solref=".05 0"', ""),
    ('solmix="3" solref=".03 .9" solimp=".8 .97 .002 .3 3"', 'solmix="1"'),
    ('solmix="0" solref=".03 .9"', ""),
    ('solmix="0" solref=".03 .9"', 'solmix="0"'),
    ('priority="1" solref=".03 .9" friction=".4" condim="4" solimp=".95 .9 .0004 .5 1"', 'friction="2"'),
    ('margin=".001" gap=".0004"', 'margin=".0003" gap=".0002"'),
    ('solimp=".5 .5 .01 .5 2"', 'solimp=".5 .5 .01 .5 2"'),
    ('solimp="0 1 .003 .99 5"', 'solimp="0 1 .003 .99 5"'),
]
CONES = ["", 'cone="elliptic"', 'impratio="3"', 'cone="elliptic" impratio="10"']


@pytest.mark.parametrize("option", CONES)
@pytest.mark.parametrize(("geom", "floor"), SETTINGS)
def test_ball_rests_where_mujoco_has_it(geom, floor, option):
    """The settings of the pair exactly; the depth to 1e-6 of itself."""
    model = model_of(geom, floor, option)
    contact, found = contact_of(model), at_rest(model)
    settings = contact.settings
    np.testing.assert_allclose(found.solref[0], settings.solref, rtol=1e-15)
    np.testing.assert_allclose(found.solimp[0], settings.solimp, rtol=1e-15)
    np.testing.assert_array_equal(found.friction[0], np.array(settings.friction)[[0, 0, 1, 2, 2]])
    assert (found.dim[0], found.includemargin[0]) == (settings.condim, pytest.approx(settings.margin, rel=1e-15))
    assert settings.margin - found.dist[0] == pytest.approx(contact.depth(G), rel=1e-6)


@pytest.mark.parametrize(
    ("shape", "contacts"),
    [
        (CUBE, 4),
        ('type="cylinder" size=".05 .05"', 3),
        ('type="cylinder" size=".05 .08" euler="90 0 0"', 2),
        ('type="capsule" size=".05 .08" euler="90 0 0"', 2),
        ('type="ellipsoid" size=".05 .06 .05"', 1),
    ],
)
@pytest.mark.parametrize("option", CONES[:2])
def test_contacts_share_the_weight(shape, contacts, option):
    model = model_of(shape=shape, option=option)
    depths = -at_rest(model).dist
    assert len(depths) == contacts
    np.testing.assert_allclose(depths, contact_of(model).depth(G / contacts), rtol=1e-6)


def test_armature_adds_to_the_mass_and_not_to_the_load():
    model = model_of(joint='<joint type="free" armature="1"/>')
    assert -at_rest(model).dist[0] == pytest.approx(contact_of(model).depth(G * 2.0 / 3.0), rel=1e-6)


@pytest.mark.parametrize("option", CONES[:2])
def test_ball_rests_on_a_free_box(option):
    """A is 1/2 + 1/3 for the ball of 2 kg on the box of 3 kg, whose corners carry both with A = 1/3."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="1e-3" {option}/><worldbody><geom type="plane" size="1 1 .1"/>'
        '<body pos="0 0 .05"><freejoint/><geom type="box" size=".05 .05 .05" mass="3"/></body>'
        '<body pos="0 0 .149"><freejoint/><geom type="sphere" size=".05" mass="2"/></body></worldbody></mujoco>'
    )
    contact, found = contact_of(model), at_rest(model)
    expected = [contact.depth(2.0 * G * (1 / 2 + 1 / 3)) if 2 in pair else contact.depth(5.0 / 4.0 * G / 3.0) for pair in found.geom]
    np.testing.assert_allclose(-found.dist, expected, rtol=1e-6)


def test_exact_inverse_mass_includes_rotation():
    """With the flag diagexact, A of a corner is 1/m (1 + 3/2 + 3/2): a cube's moment of inertia is 2/3 m w², and its corners are w off."""
    model = model_of(shape=CUBE, option='cone="elliptic"', flag='<flag diagexact="enable"/>')
    np.testing.assert_allclose(-at_rest(model).dist, contact_of(model).depth(4.0 * G / 4.0), rtol=1e-6)


def test_time_constant_is_kept_with_refsafe_disabled():
    model = model_of('solref=".0018 2"', 'solref=".0018 2"', flag='<flag refsafe="disable"/>')
    kept = SoftContact(contact_of(model).settings)
    assert -at_rest(model).dist[0] == pytest.approx(kept.depth(G), rel=1e-6)
    assert kept.depth(G) == pytest.approx(0.81 * contact_of(model).depth(G), rel=1e-3)


@pytest.mark.parametrize("solref", [".03 .9", ".0001 1", "-2500 -90", ".03 -5"])
def test_stiffness_is_that_of_mujoco(solref, tmp_path, monkeypatch):
    """A solref of mixed signs is replaced with the default; MuJoCo warns of it on the terminal and in a file of the current folder."""
    import mujoco

    monkeypatch.chdir(tmp_path)
    model = model_of(f'solref="{solref}"', f'solref="{solref}"')
    data = mujoco.MjData(model)
    data.qpos[2] = 0.0499
    mujoco.mj_forward(model, data)
    assert data.efc_KBIP.reshape(-1, 4)[0, 0] == pytest.approx(contact_of(model).stiffness, rel=1e-14)


def test_depth_without_stiffness_is_infinite():
    assert SoftContact(GeomSettings(solref=(0.0, -5.0))).depth(G) == math.inf


def test_body_stops_at_the_first_depth_that_carries_it():
    """An impedance that falls from .9 to .1 within 1 mm gives three depths; MuJoCo's body sinks to the first."""
    geom = 'solimp=".9 .1 .001 .5 2" solref="-5000 -50"'
    model = model_of(geom, geom, 'cone="elliptic"')
    assert -at_rest(model).dist[0] == pytest.approx(contact_of(model).depth(G), rel=1e-6)
