"""`dropspin limits`."""

import json

import pytest
from support.cli import dropspin


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
    masses = dropspin(*asked[:6], "--axis", "mass", "--json", cwd=tmp_path)
    assert {row["failure_mode"] for row in json.loads(masses.stdout)} == {"sound", "declined"}


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (["--axis", "spinn"], "axis 'spinn' is unknown. Did you mean 'spin'?"),
        (["--axis", "height"], "axis 'height': spin-principal does not have it; it has step, spin"),
        (["-e", "mujocoo"], "engine 'mujocoo' is unknown."),
        (["--dt", "7"], "dt: got 7.0 s"),
        (["--within", "nan"], "within: got nan"),
        (["--pair", "spin,mass"], "No such option"),
        (["--time-limit", "nan"], "is not a finite number of seconds"),
        (["spin-principal"], "two scenes have the same name; a scene's name is its file's name, rename one."),
    ],
)
def test_bad_input_is_refused(asked, message, tmp_path):
    done = dropspin("limits", "spin-principal", *asked, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert list(tmp_path.iterdir()) == []
