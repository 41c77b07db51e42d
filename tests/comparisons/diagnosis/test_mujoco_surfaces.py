"""What a body of an MJCF file lands on, of several planes, boxes and other geometries of the world."""

import pytest
from support.model_files import findings_of, ladder

from dropspin.comparisons.diagnosis.landing import rest
from dropspin.comparisons.diagnosis.mujoco_body import MuJoCoModel
from dropspin.comparisons.diagnosis.sliding import roll

BOX = '<geom type="box" size=".1 .1 .04"/>'
FLOOR = '<geom name="floor" type="plane" size="0 0 1"/>'
WALL = '<geom name="wall" type="plane" size="0 0 1" zaxis="1 0 0" pos="-2 0 0"/>'
TABLE = '<geom name="table" type="box" size=".3 .3 .02" pos="{} .7"/>'
TERRAIN = '<geom name="terrain" type="hfield" hfield="h"/><geom name="far" type="box" size=".1 5 1" pos="5 0 0"/>'
POST = '<geom name="post" type="cylinder" size=".1 .25" pos="{} 0 .25"/>'
SEESAW = '<body name="seesaw" pos="0 0 .3"><joint/><geom name="board" type="box" size="1 .1 .02"/></body>'
BESIDE = ["a start beside or below the surface"]


def on(tmp_path, world, height=1.0, option="", geom=BOX):
    asset = '<asset><hfield name="h" nrow="2" ncol="2" size="5 5 1 .1" elevation="0 0 0 0"/></asset>'
    body = f'<body name="b" pos="0 0 {height}"><freejoint/>{geom}</body>'
    return written(tmp_path, f"{asset}<option {option}/><worldbody>{world}{body}</worldbody>")


def written(tmp_path, model):
    """The body b of a model."""
    (tmp_path / "model.xml").write_text(f"<mujoco>{model}</mujoco>")
    return MuJoCoModel(tmp_path / "model.xml", "model.xml").body("b", None)


@pytest.mark.parametrize(
    ("world", "height", "option", "surface", "left_out"),
    [
        (WALL + FLOOR, 1.0, "", "floor", []),
        (FLOOR + TABLE.format("0 0"), 1.0, "", "table", []),
        (FLOOR + TABLE.format("0 0"), 0.3, "", "floor", []),
        (FLOOR + TABLE.format("5 0"), 1.0, "", "floor", []),
        (FLOOR + '<geom name="table" type="box" size="1 .1 1" pos="0 -2 0"/>', 0.5, 'gravity="0 -9.81 0"', "table", []),
        (TERRAIN, 1.0, "", "a plane with default settings", ["the height field terrain"]),
        (WALL + TABLE.format("5 0"), 1.0, "", "table", BESIDE),
        (FLOOR + POST.format(0), 1.0, "", "floor", ["the cylinder post"]),
        (FLOOR + POST.format(1), 1.0, "", "floor", []),
        (FLOOR + POST.format(0) + TABLE.format("0 0"), 1.0, "", "table", []),
        (FLOOR + SEESAW, 1.0, "", "floor", ["the box board"]),
        (FLOOR + SEESAW, 0.2, "", "floor", []),
        (SEESAW, 1.0, "", "a plane with default settings", ["the box board"]),
        (FLOOR + SEESAW.replace("<joint/>", "<freejoint/>"), 1.0, "", "floor", []),
        (TABLE.format("0 0"), 0.3, "", "table", BESIDE),
    ],
)
def test_body_lands_on_what_is_below_it(tmp_path, world, height, option, surface, left_out):
    body = on(tmp_path, world, height, option)
    assert (body.surface, body.unmodelled) == (surface, left_out)


def test_plane_that_is_added_has_mujocos_own_settings_not_those_of_the_default_class(tmp_path):
    of_class = '<default><geom friction=".05" margin=".02" condim="1" contype="0" conaffinity="0"/></default>'
    geom = '<geom type="box" size=".1 .1 .1" friction=".3" margin="0" condim="3" contype="1" conaffinity="1"/>'
    body = f'<body name="b" pos="0 0 1"><freejoint/>{geom}</body>'
    body = written(tmp_path, f"{of_class}<worldbody>{body}</worldbody>")
    assert (body.surface, body.friction) == ("a plane with default settings", 1.0)
    assert rest(body, ladder(body)[:1])[0].measured == pytest.approx(body.rest_depth, rel=1e-3)


def test_margin_of_the_floor_is_not_that_of_a_body_that_has_none(tmp_path):
    body = on(tmp_path, FLOOR.replace("/>", ' margin=".02"/>'), geom=BOX.replace("/>", ' margin="0"/>'))
    [(_, found)] = findings_of(body, rest)
    assert body.settings["margin"].text == 'margin=".02"'
    assert found.remedies[0].text == '<geom name="floor" type="plane" size="0 0 1" margin="0"/> (model.xml, line 1)'


def test_capsule_is_put_down_where_a_wide_margin_begins(tmp_path):
    """Not a metre below, from where the contact would throw it up."""
    body = on(tmp_path, FLOOR.replace("/>", ' margin="1"/>'), geom='<geom type="capsule" size=".05 .2"/>')
    depth, drift = rest(body, ladder(body)[:1])
    assert (depth.measured, drift.measured) == (pytest.approx(-1.0, abs=2e-3), pytest.approx(0.0, abs=1e-6))


def test_box_that_rattles_for_ever_is_not_at_rest_although_it_tilts(tmp_path):
    """MuJoCo's time constant is half of a time step: its bottom is between -5 and 1 mm."""
    option = '<option timestep=".01"><flag refsafe="disable"/></option>'
    geom = '<geom type="box" size=".1 .05 .03" mass="2" solref=".005 1"/>'
    world = f'{FLOOR}<body name="b" pos="0 0 .5"><freejoint/>{geom}</body>'
    body = written(tmp_path, f"{option}<worldbody>{world}</worldbody>")
    assert [answer.quantity for answer, _ in findings_of(body, rest)] == ["drift speed"]


def test_egg_that_rocks_is_no_error(tmp_path):
    """Put down at 40°, it turns to and fro for long, and its centre rises and falls."""
    egg = '<geom type="ellipsoid" size=".05 .05 .1" euler="40 0 0"/>'
    assert findings_of(on(tmp_path, FLOOR, geom=egg), rest) == []


def test_ball_rolls_on_when_its_table_ends(tmp_path):
    """MuJoCo's own keeps 0.82 on a wide table, and 0.998 in the flight after a narrow one."""
    ball = '<geom name="g" type="sphere" size=".03" condim="6" friction="1 .005 .001"/>'
    body = on(tmp_path, TABLE.format("0 0"), geom=ball)
    [answer] = roll(body, ladder(body)[:1])
    assert answer.measured == pytest.approx(0.820, abs=2e-3)


def test_part_that_hangs_beside_its_support_is_no_penetration(tmp_path):
    post = '<geom name="post" type="box" size=".05 .05 .5" pos="0 0 .5"/>'
    skirts = "".join(f'<geom type="box" size=".01 .2 .05" pos="{x} 0 -.05"/>' for x in (-0.19, 0.19))
    body = on(tmp_path, post, geom=f'<geom type="box" size=".2 .2 .01" pos="0 0 .01"/>{skirts}')
    depth = rest(body, ladder(body)[:1])[0]
    assert 0.0 < depth.measured < 1e-3
    assert body.unmodelled == []


def test_beam_of_a_mesh_rests_on_a_table_without_jitter(tmp_path):
    """Its depth is that of an impedance of 0.9, as in MuJoCo alone."""
    corners = " ".join(f"{x} {y} {z}" for x in (-0.6, 0.6) for y in (-0.03, 0.03) for z in (-0.03, 0.03))
    mesh = f'<option><flag multiccd="enable"/></option><asset><mesh name="beam" vertex="{corners}"/></asset>'
    body = '<body name="b" pos="0 0 .02" euler="0 0 40"><freejoint/><geom type="mesh" mesh="beam"/></body>'
    table = '<geom type="box" size="1 1 .3" pos="0 0 -.3"/>'
    beam = written(tmp_path, f"{mesh}<worldbody>{table}{body}</worldbody>")
    depth, drift = rest(beam, ladder(beam)[:1])[:2]
    assert depth.measured == pytest.approx(beam.rest_depth, rel=1e-3)
    assert drift.measured < 1e-8


@pytest.mark.parametrize(
    ("top", "rest", "why"),
    [
        ('contype="2" conaffinity="2"', "", "no geometry of the body collides with it"),
        ("", '<contact><exclude body1="table" body2="mug"/></contact>', "leaves out their contacts"),
        ('contype="0" conaffinity="0"', "", ""),  # is only seen
        ("", "", ""),
    ],
)
@pytest.mark.parametrize("floor", ['<geom type="plane" size="2 2 .1"/>', ""])
def test_table_that_a_body_falls_through_is_named_with_the_reason(tmp_path, floor, top, rest, why):
    """The mug is a centimetre above the table, and half a metre above the floor."""
    mug = '<body name="mug" pos="0 0 .58"><freejoint/><geom type="cylinder" size=".04 .05" mass=".3"/></body>'
    table = f'<body name="table"><geom name="top" type="box" size=".5 .5 .02" pos="0 0 .5" {top}/></body>'
    path = tmp_path / "model.xml"
    path.write_text(f"<mujoco><worldbody>{floor}{table}{mug}</worldbody>{rest}</mujoco>", encoding="utf-8")
    missed = MuJoCoModel(path, "model.xml").body("mug", None).missed
    assert missed.startswith("top does not hold it, because") is bool(why)
    assert why in missed
