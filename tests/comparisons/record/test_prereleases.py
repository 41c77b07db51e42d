"""`dropspin record --pre`. pip is replaced: no test needs a network."""

import pytest
from support.cli import dropspin
from support.small_record import rows

from dropspin.comparisons.record import study
from dropspin.comparisons.running.driving import Breakdown

VALUES = {"1.1.0": 12.7, "1.2.0rc1": 1e-3}


@pytest.fixture
def values(monkeypatch):
    """The errors of each release, of an index that has two releases and a prerelease of MuJoCo, and none of other engines."""
    of_release = dict(VALUES)

    def measured(plan, engine, release, time_limit, stopping):
        if release not in of_release:
            raise Breakdown("broken", "not runnable: exit code 1")
        return {"rows": list(rows("mujoco", of_release[release])), "versions": f"mujoco {release}"}

    monkeypatch.setattr(study, "measured", measured)
    monkeypatch.setattr(study, "releases", lambda package, oldest: ["1.0.0", "1.1.0"])
    monkeypatch.setattr(study, "prereleases", lambda package, newest: ["1.2.0b1", "1.2.0rc1"] if package == "mujoco" else [])
    return of_release


def test_newest_prerelease_is_compared_with_the_newest_release(values, tmp_path):
    done = dropspin("record", "--pre", "-o", "own", cwd=tmp_path)
    assert done.returncode == 1
    note = (tmp_path / "own/prereleases.md").read_text()
    assert note.startswith("## Changes in 1 of 1 compared engine\n")
    assert "mujoco, from 1.1.0 to 1.2.0rc1" in note
    assert "spin-asymmetric with mujoco: orientation error 0.0127 → 1.00e-06 rad" in note.replace("\xa0", " ")
    assert "`dropspin record --pre -e mujoco --release 1.1.0 --release 1.2.0rc1`" in note
    assert "Without a prerelease after the newest release: pybullet, rapier," in note
    assert "mujoco, from 1.1.0 to 1.2.0rc1" in done.stdout


def test_prerelease_without_a_change_passes_and_one_without_results_fails(values, tmp_path):
    values["1.2.0rc1"] = VALUES["1.1.0"]
    done = dropspin("record", "--pre", "-e", "mujoco", "-o", "own", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "mujoco: no result changed from 1.1.0 to 1.2.0rc1." in done.stdout
    del values["1.2.0rc1"]
    done = dropspin("record", "--pre", "-e", "mujoco", "-o", "other", cwd=tmp_path)
    assert done.returncode == 1
    assert "1.2.0rc1 has no results: not runnable: exit code 1" in done.stdout
