"""The scene of docs/laboratory: its mesh is closed, its settings are the page's, and the averaged contact converges with the vertices."""

import re
import sys
from collections import Counter
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

import dropspin as ds

DOCS = Path(__file__).parents[2] / "docs"
spec = spec_from_file_location("laboratory", DOCS / "laboratory" / "laboratory.py")
laboratory = sys.modules[spec.name] = module_from_spec(spec)
spec.loader.exec_module(laboratory)


@pytest.mark.parametrize("cells", [1, 2, 5, 22])
def test_mesh_is_closed_and_faces_outwards(cells):
    """Each edge belongs to two triangles, in opposite directions; Euler's characteristic is 2; the volume is positive."""
    points, triangles = laboratory.mesh(cells)
    assert len(points) == 6 * cells**2 + 2
    edges = Counter(map(tuple, np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]).tolist()))
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)
    assert len(points) - len(edges) // 2 + len(triangles) == 2
    a, b, c = points[triangles].transpose(1, 0, 2)
    assert np.sum(a * np.cross(b, c)) > 0.0


def test_scene_has_the_settings_of_the_course():
    scene = laboratory.scene_of(22)
    assert scene.damping.factors == pytest.approx({"linear_factor": 0.999, "angular_factor": 0.98}, rel=1e-15)
    assert (scene.damping.factor_dt, scene.floor.restitution, scene.body.mass) == (0.015, 0.5, len(scene.body.points))
    assert scene.start.position[1] == 0.59
    assert scene.wall[0].point == (2.0, 0.0, 0.0)


def test_catalogue_has_the_scene_with_a_rounded_mesh():
    """Its tables, its vertices in their order, to half a micrometre, and its faces."""
    scene, known = laboratory.scene_of(16), ds.load("laboratory")
    for table in ("duration", "start", "gravity", "damping", "floor", "wall"):
        assert getattr(known, table) == getattr(scene, table)
    np.testing.assert_allclose(known.body.points, scene.body.points, rtol=0, atol=5.01e-7)
    np.testing.assert_allclose(known.body.inertia_tensor, scene.body.inertia_tensor, rtol=0, atol=1e-5)
    assert sorted(map(tuple, known.body.faces)) == sorted(map(tuple, scene.body.faces))


@pytest.mark.extended
def test_row_of_the_page_is_that_of_the_program(monkeypatch):
    """With 29,402 vertices, the most of the page."""
    monkeypatch.setattr(laboratory, "CELLS", (70,))
    [row] = laboratory.by_vertices(laboratory.DT)
    page = (DOCS / "laboratory.md").read_text(encoding="utf-8")
    assert f"| {' | '.join(map(laboratory.cell, row[:8]))} |" in re.sub(r" \| [^|]* \| [^|]* \|$", " |", page, flags=re.MULTILINE)


@pytest.mark.extended
def test_energy_is_accounted_for():
    """Start, changes and end add up; the numbers are those of the page to 1 %."""
    _, start, flight, floor, wall, gain, end = laboratory.budget("wang")
    assert start + flight + floor + wall == pytest.approx(end, abs=1e-9)
    assert start == pytest.approx(12.5 + 2.0 + 9.8 * (0.59 - laboratory.scene_of(22).body.resting_height))
    assert (flight, floor, wall, gain) == pytest.approx((-4.332, -4.712, -9.563, 0.021), rel=0.03)


@pytest.mark.parametrize("name", [pytest.param("wang", marks=pytest.mark.extended), "mujoco", "pybullet"])
def test_every_engine_runs_the_laboratory(name):
    """With its damping and its wall, from which the body comes back."""
    states = ds.simulate(laboratory.scene_of(8), name, laboratory.DT).states
    assert states[:, 0].max() < 2.0
    assert states[-1, 0] < 1.0


def test_scene_that_is_written_can_be_loaded(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    laboratory.main("write", "2")
    assert len(ds.load("laboratory.toml").body.points) == 26
