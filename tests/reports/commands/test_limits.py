"""`dropspin limits`."""

import json
import re

import pytest
from support.cli import dropspin


@pytest.mark.extended
def test_a_scan_is_printed_and_written(tmp_path):
    """Sound ranges and largest steps on the terminal; the folder; every point as JSON."""
    asked = ("limits", "spin-principal", "-e", "mujoco", "-e", "pybullet", "--axis", "step")
    done = dropspin(*asked, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    output = " ".join(done.stdout.split())
    assert "inaccurate at 0.1" in output
    assert "accurate up to" in output
    assert done.stdout.endswith("Written: out/limits/limits.md\n")
    assert {path.name for path in (tmp_path / "out/limits").iterdir()} == {
        "limits.csv",
        "limits.json",
        "limits.md",
        "section.json",
        "spin-principal.svg",
    }
    assert "is not sound at the nominal values" not in output
    masses = dropspin(*asked[:6], "--axis", "mass", "--json", cwd=tmp_path)
    assert {row["failure_mode"] for row in json.loads(masses.stdout)} == {"sound", "declined"}


@pytest.mark.extended
def test_engine_that_is_not_accurate_at_the_nominal_step_is_tried_at_smaller_ones(tmp_path):
    """MuJoCo's explicit gyroscopic term at 5 ms, and a tolerance that none of the smaller steps meets; every step tried is in the files."""
    asked = ("limits", "spin-asymmetric", "-e", "mujoco", "--axis", "mass", "-o", "out")
    output = " ".join(dropspin(*asked, cwd=tmp_path).stdout.split())
    assert "Sound: the engine meets no failure criterion, and its errors are at most 0.1 (ratios, or angles in rad)." in output
    assert "mujoco is not sound at the nominal values and dt = 5 ms: gains energy, the energy rises by 0.01" in output
    assert "times the scene's energy (limit 0.01). Smaller time steps tried: sound at 2.5 ms." in output
    output = " ".join(dropspin(*asked, "--within", "1e-6", cwd=tmp_path).stdout.split())
    assert "Smaller time steps tried: inaccurate at 2.5 ms, 1.25 ms, 625 µs, 313 µs, 156 µs, 78.1 µs. " in output
    assert re.search(r"At 78.1 µs, the smallest tried, orientation error is [\d.e-]+ rad \(tolerance 1e-06\)\.", output)
    rows = [row for row in json.loads((tmp_path / "out/limits.json").read_text()) if row["axis"] == "step"]
    assert [row["value"] for row in rows] == [5e-3 / 2**n for n in range(6, -1, -1)]


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (["--axis", "spinn"], "axis 'spinn' is unknown. Did you mean 'spin'?"),
        (["--axis", "height"], "axis 'height': spin-principal does not have it; it has step, spin"),
        (["-e", "mujocoo"], "engine 'mujocoo' is unknown."),
        (["--dt", "7"], "dt: got 7.0 s"),
        (["--within", "nan"], "nan is not a finite number"),
        (["--pair", "spin,mass"], "No such option"),
        (["--time-limit", "nan"], "is not a finite number"),
        (["spin-principal"], "a scene is given twice, or two files have the same name; give each scene once, or rename a file."),
    ],
)
def test_bad_input_is_refused(asked, message, tmp_path):
    done = dropspin("limits", "spin-principal", *asked, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_scene_without_the_axis_is_left_out_and_named(tmp_path):
    """Of one scene alone, it is bad input."""
    alone = dropspin("limits", "spin-principal", "--axis", "height", "--axis", "spin", "-e", "wang", cwd=tmp_path)
    assert (alone.returncode, "axis 'height': spin-principal does not have it" in alone.stderr) == (2, True)
    done = dropspin("limits", "spin-principal", "drop-ball", "--axis", "height", "--axis", "spin", "-e", "wang", cwd=tmp_path)
    assert done.returncode == 0
    for sentence in ("Left out: spin-principal, it has no axis height.", "Left out: drop-ball, it has no axis spin."):
        assert sentence in done.stdout
        assert sentence in next(tmp_path.rglob("limits.md")).read_text()
