"""`dropspin calibrate`."""

import json

import pytest
from support.cli import dropspin


@pytest.mark.extended
def test_settings_and_texts_to_paste(tmp_path, monkeypatch):
    """The table, the settings and the texts; one text alone; everything as JSON."""
    monkeypatch.setattr("dropspin.comparisons.calibration.LARGEST_STEP", 0.01)  # the search for the largest stable step takes seconds
    asked = ("calibrate", "--restitution", "0.7", "--dt", "0.01")
    done = dropspin(*asked, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "[0.0, -170.0]" in done.stdout
    assert "To paste, as mjcf:" in done.stdout
    alone = dropspin(*asked, "-e", "pybullet", "--as", "urdf", cwd=tmp_path)
    assert alone.stdout.startswith("<?xml")
    found = json.loads(dropspin(*asked, "--json", cwd=tmp_path).stdout)
    assert found["settings"]["solref"] == [0.0, -170.0]
    assert {one["name"]: one["value"] for one in found["measured"]}["restitution"] == pytest.approx(0.7, abs=1e-4)
    assert set(found["programs"]) == {"python", "mjcf"}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--dt", "0.002"], "Missing option '--restitution'"),
        (["--restitution", "2", "--dt", "0.002"], "2.0 is not in the range"),
        (["--restitution", "0.5", "--dt", "1"], "dt: got 1.0 s"),
        (["--restitution", "0.5", "--dt", "0.002", "--friction", "some"], "friction: got 'some'; give none, infinite or a coefficient."),
        (["--restitution", "0.5", "--dt", "0.002", "--as", "urdf"], "mujoco's language 'urdf' is unknown"),
        (["--restitution", "0.5", "--dt", "0.002", "-e", "wang"], "wang has no settings to calibrate"),
    ],
)
def test_a_calibration_that_is_impossible_is_refused(given, message, tmp_path):
    done = dropspin("calibrate", *given, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
