"""`dropspin diagnose`: a table of several bodies, files, targets, exit codes and wrong files."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from support.cli import dropspin
from trimesh import Trimesh
from trimesh.exchange.stl import export_stl_ascii

DOCS = Path(__file__).parents[3] / "docs"
WORLD = """<mujoco model="two"><worldbody><geom name="floor" type="plane" size="1 1 .1"/>
<body name="heavy" pos="0 0 1"><freejoint/><inertial pos="0 0 0" mass=".1" diaginertia="1 1 1"/><geom type="box" size=".05 .05 .05"/></body>
<body name="damped" pos="1 0 1"><joint type="free" damping=".01"/><geom size=".05"/></body>
<body name="arm" pos="3 0 1"><joint type="hinge"/><geom size=".05"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def model(tmp_path):
    (tmp_path / "two.xml").write_text(WORLD)
    return tmp_path


def test_table_findings_and_files_of_several_bodies(model):
    done = dropspin("diagnose", "two.xml", "--loose", cwd=model)
    assert done.returncode == 1, done.stderr  # an inertia is impossible
    lines = done.stdout.splitlines()
    assert [line.split()[0] for line in lines[:4]] == ["body", "heavy", "damped", "arm"]
    assert "arm" in lines[3]
    [impossible] = [line for line in lines if line.startswith("heavy: Inertia, impossible")]
    assert 'diaginertia="1 1 1" (two.xml, line 2)' in impossible
    [spin] = [line for line in lines if line.startswith("damped: Spin, setting:")]
    assert spin.endswith("Remedy, tried: <freejoint/> (two.xml, line 3) gives a fraction of 1 kept in 1 s.")
    folder = model / "out/diagnosis"
    assert {"report.html", "diagnosis.json", "diagnosis.csv", "diagnosis.md", "diagnosis.parquet"} <= {
        path.name for path in folder.iterdir()
    }
    rows = json.loads((folder / "diagnosis.json").read_text())
    assert len(rows) == pq.read_table(folder / "diagnosis.parquet").num_rows
    assert {row["body"] for row in rows} == {"heavy", "damped", "arm"}
    assert "Diagnosis of two.xml" in (folder / "report.html").read_text()


def test_one_body_has_its_answers_and_a_missed_target_fails(model):
    asked = ("diagnose", "two.xml", "--body", "damped", "-o", "one")
    done = dropspin(*asked, cwd=model)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) <= 40
    assert done.stdout.startswith("damped: sphere, 0.5236 kg; MuJoCo")
    missed = dropspin(*asked, "--restitution", "0.5", "--friction", "0.3", "--json", cwd=model)
    assert missed.returncode == 1
    targets = [row for row in json.loads(missed.stdout) if row["finding"] == "target"]
    assert {row["question"] for row in targets} == {"impact", "friction"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.xml"], "none.xml: No such file"),
        (["."], "is not a model file"),
        (["two.xml", "-e", "wang"], "wang does not read .xml files; use mujoco"),
        (["two.xml", "-e", "mujoco[cone=elliptic]"], "mujoco[cone=elliptic]: diagnose takes an engine without options"),
        (["two.xml", "--body", "heavi"], "heavy"),
        (["two.xml", "--on", "flor"], "floor"),
        (["two.xml", "--body", "heavy", "--on", "geom 4"], "neither a plane nor a box"),
        (["many.xml"], "more than 100,000 elements"),
        (["bare.xml"], "Error opening file"),
        (["open.obj"], "the mesh is not closed"),
    ],
)
def test_wrong_file_or_name_ends_in_one_line(model, arguments, message):
    (model / "many.xml").write_text(f"<mujoco><worldbody>{'<geom/>' * 100_001}</worldbody></mujoco>")
    mesh = '<asset><mesh name="m" file="none.stl"/></asset><worldbody><body><freejoint/><geom type="mesh" mesh="m"/></body></worldbody>'
    (model / "bare.xml").write_text(f"<mujoco>{mesh}</mujoco>")
    (model / "open.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\n")
    done = dropspin("diagnose", *arguments, cwd=model)
    assert (done.returncode, done.stdout) == (2, "")
    assert message in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("arguments", [("cup.xml",), ("brick.urdf", "-e", "mujoco")])
def test_page_shows_what_the_command_prints(tmp_path, arguments):
    page = (DOCS / "diagnose.md").read_text(encoding="utf-8")
    shutil.copy(DOCS / "diagnose" / arguments[0], tmp_path)
    done = dropspin("diagnose", *arguments, cwd=tmp_path, COLUMNS="200")
    printed = " ".join(done.stdout.split())
    section = page.partition(f"`dropspin diagnose {' '.join(arguments)}` prints")[2].partition("\n## ")[0]
    shown = [line for block in re.findall(r"^```text\n(.*?)^```$", section, re.DOTALL | re.MULTILINE) for line in block.splitlines()]
    assert len(shown) >= 4
    assert [line for line in shown if " ".join(line.split()) not in printed] == []


def test_mesh_in_millimetres_is_named_and_its_unit_can_be_given(tmp_path, monkeypatch):
    corners = [(0, 0, 0), (100, 0, 0), (0, 50, 0), (0, 0, 20)]
    lines = [*(f"v {x} {y} {z}" for x, y, z in corners), "f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4"]
    (tmp_path / "part.obj").write_text("\n".join(lines))
    monkeypatch.setattr("dropspin.comparisons.diagnosis.study.QUESTIONS", ())
    in_metres = dropspin("diagnose", "part.obj", cwd=tmp_path, COLUMNS="200").stdout
    assert "length of the body is 100 m; dropspin reads SI units, and this may be a model in mm." in in_metres
    scaled = dropspin("diagnose", "part.obj", "--scale", "0.001", cwd=tmp_path, COLUMNS="200").stdout
    assert scaled.startswith("part: mesh, 0.01667 kg;")  # 100 × 50 × 20 mm³ / 6 of water
    assert "length of the body" not in scaled


def test_what_needs_no_simulation_is_told_of_a_body_whose_simulation_breaks_down(model, monkeypatch):
    """The question after the inertia runs out of memory, as another one may run out of time."""

    def endless(body, dts):
        raise MemoryError

    monkeypatch.setattr("dropspin.comparisons.diagnosis.study.QUESTIONS", (endless,))
    done = dropspin("diagnose", "two.xml", "--body", "heavy", cwd=model, COLUMNS="200")
    assert done.returncode == 3
    why, head, *lines = done.stdout.splitlines()
    assert why.startswith("heavy: ")
    assert head.startswith("heavy: box, 0.1 kg")
    assert [line for line in lines if line.startswith("Inertia, impossible: ")]
    assert "1 body without a result" in done.stdout


@pytest.mark.extended
def test_mesh_is_a_solid_of_a_density(tmp_path):
    corners = [f"v {x} {y} {z}" for x in (0, 0.1) for y in (0, 0.2) for z in (0, 0.3)]
    faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    (tmp_path / "brick.obj").write_text("\n".join([*corners, *(f"f {face}" for face in faces)]))
    done = dropspin("diagnose", "brick.obj", "--density", "500", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    moments = [row["measured"] for row in json.loads(done.stdout) if row["unit"] == "kg m²"]
    assert sorted(moments) == pytest.approx([0.0125, 0.025, 0.0325], rel=1e-4)


@pytest.mark.extended
def test_urdf_that_one_engine_refuses_is_diagnosed_in_the_other(tmp_path):
    pytest.importorskip("pybullet", exc_type=ImportError)
    text = (DOCS / "diagnose/brick.urdf").read_text(encoding="utf-8")
    (tmp_path / "brick.urdf").write_text(text.replace('ixy="0"', ""))
    done = dropspin("diagnose", "brick.urdf", cwd=tmp_path, COLUMNS="200")
    assert done.returncode == 1, done.stderr  # an inertia is impossible
    refused, measured, *_ = done.stdout.splitlines()
    assert "MuJoCo does not compile it: XML Error: required attribute missing: 'ixy'" in refused
    assert measured.startswith("brick: box, 2 kg; PyBullet")


def test_message_of_an_engine_that_refuses_a_file_is_not_lost(model):
    """MuJoCo says where the comma is; PyBullet reads a box of size 0, and has no result either."""
    inertia = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    shape = '<collision><geometry><box size="0,2 0,1 0,06"/></geometry></collision>'
    (model / "comma.urdf").write_text(f'<robot name="r"><link name="b">{inertia}{shape}</link></robot>')
    done = dropspin("diagnose", "comma.urdf", cwd=model)
    assert done.returncode == 2
    message = " ".join(done.stderr.split())
    assert "bad format in attribute 'size'" in message
    assert "PyBullet gives link b the mass 1 kg and the moments 0, 0, 0 kg m²" in message


LINK = """<robot name="r"><link name="b"><inertial><mass value="1"/><inertia ixx=".1" ixy="0" ixz="0" iyy=".1" iyz="0" izz=".1"/></inertial>
<collision><geometry>{}</geometry></collision></link></robot>"""


@pytest.mark.parametrize("path", ["package://arm/b.stl", "model://arm/b.stl", "arm/b.stl"])
@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_path_of_a_mesh_in_a_package_has_a_remedy(tmp_path, path, engine):
    pytest.importorskip(engine, exc_type=ImportError)
    (tmp_path / "arm.urdf").write_text(LINK.format(f'<mesh filename="{path}"/>'))
    done = dropspin("diagnose", "arm.urdf", "-e", engine, cwd=tmp_path)
    assert done.returncode == 2
    beginning, is_in_package, _ = path.partition("://")
    remedy = f"; replace {beginning}:// in line 2 by the path of the folder that has the package."
    assert (remedy in " ".join(done.stderr.split())) is bool(is_in_package)


@pytest.mark.parametrize(("geometry", "code"), [('<box size="1 1 1"/>', 3), ('<box size="0,2 0,1 0,06"/>', 2)])
def test_engine_that_breaks_down_on_reading_a_file_is_named_beside_what_the_other_finds(tmp_path, monkeypatch, geometry, code):
    """What MuJoCo measures, or why it refuses the file; an empty mesh ends PyBullet's process."""
    bodies = pytest.importorskip("dropspin.comparisons.diagnosis.pybullet_body", exc_type=ImportError)

    def break_down(*arguments, **options):
        raise RuntimeError("no mesh")

    monkeypatch.setattr(bodies, "load", break_down)
    file = f"box{code}.urdf"  # files of one name are read once
    (tmp_path / file).write_text(LINK.format(geometry))
    done = dropspin("diagnose", file, cwd=tmp_path, COLUMNS="200")
    assert done.returncode == code
    said = " ".join((done.stdout if code == 3 else done.stderr).split())
    assert f"{file}: cannot be read with pybullet: RuntimeError: no mesh." in said
    assert ("b: box, 1 kg; MuJoCo" if code == 3 else f"{file}: MuJoCo does not compile it: ") in said


def test_mesh_in_text_is_read(tmp_path, monkeypatch):
    """MuJoCo reads binary STL files alone."""
    corners = np.array([(0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.0, 0.05, 0.0), (0.0, 0.0, 0.02)])
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    (tmp_path / "part.stl").write_text(export_stl_ascii(Trimesh(corners, faces)))
    monkeypatch.setattr("dropspin.comparisons.diagnosis.study.QUESTIONS", ())
    assert dropspin("diagnose", "part.stl", cwd=tmp_path, COLUMNS="200").stdout.startswith("part: mesh, 0.01667 kg;")
