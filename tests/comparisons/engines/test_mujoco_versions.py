"""MuJoCo's adapter with other versions: by their numbers alone, and in slow tests with those versions installed."""

import csv
import json
import subprocess
import sys

import numpy as np
import pytest

from dropspin import scenarios
from dropspin.comparisons.calibration import calibrate
from dropspin.comparisons.engines import mujoco_engine
from dropspin.comparisons.engines.mapping import EXPLICIT_GYROSCOPIC, IMPLICIT_GYROSCOPIC, MIDPOINT_GYROSCOPIC
from dropspin.comparisons.engines.mujoco_engine import flight_of
from dropspin.comparisons.engines.packages import numbers_of
from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.regressions.comparing import compare
from dropspin.comparisons.regressions.history import history
from dropspin.comparisons.results.store import load_results
from dropspin.comparisons.running.driving import simulate
from dropspin.scenarios.mechanics import kinetic_energy

FREE_BODY = """
duration = 5.0
[body]
shape = "box"
half_extents = [0.1, 0.2, 0.3]
mass = 1.0
[start]
angular_velocity = [1.0, 2.0, 3.0]
"""
PUBLISHED = {EXPLICIT_GYROSCOPIC: 1.0868946, MIDPOINT_GYROSCOPIC: 1.0, IMPLICIT_GYROSCOPIC: 0.9260083}
"""E/E₀ at the end of that scene, MuJoCo's own free-body test, in steps of 10 ms."""


@pytest.fixture
def installed(monkeypatch):
    """Replaces the installed version's number, so that the adapter uses only features of that version."""
    return lambda version: monkeypatch.setattr(mujoco_engine, "VERSION", numbers_of(version))


def energy_ratio(tmp_path, name):
    (tmp_path / "free-body.toml").write_text(FREE_BODY)
    scene = scenarios.load(tmp_path / "free-body.toml")
    energies = kinetic_energy(scene, simulate(scene, name, 0.01))
    return energies[-1] / energies[0]


def test_free_body_energies_are_the_published_ones(tmp_path):
    """Each integrator by its discretisation in the installed version; Bullet's is the implicit one, RK4 keeps E to 2e-10."""
    for integrator in ("euler", "implicit", "implicitfast"):
        expected = PUBLISHED[flight_of(integrator, mujoco_engine.VERSION)]
        assert energy_ratio(tmp_path, f"mujoco[integrator={integrator}]") == pytest.approx(expected, abs=5e-8)
    assert energy_ratio(tmp_path, "mujoco[integrator=rk4]") == pytest.approx(1.0 - 1.73e-10, abs=1e-12)
    assert energy_ratio(tmp_path, "pybullet") == pytest.approx(PUBLISHED[IMPLICIT_GYROSCOPIC], abs=5e-4)


@pytest.mark.parametrize(
    ("version", "implicit", "implicitfast"),
    [
        ("3.2.4", IMPLICIT_GYROSCOPIC, EXPLICIT_GYROSCOPIC),
        ("3.6.0", IMPLICIT_GYROSCOPIC, EXPLICIT_GYROSCOPIC),
        ("3.7.0", MIDPOINT_GYROSCOPIC, MIDPOINT_GYROSCOPIC),
        ("3.8.0", MIDPOINT_GYROSCOPIC, MIDPOINT_GYROSCOPIC),
        ("3.8.1", IMPLICIT_GYROSCOPIC, MIDPOINT_GYROSCOPIC),
        ("3.10.0", IMPLICIT_GYROSCOPIC, MIDPOINT_GYROSCOPIC),
        ("3.11.0.dev5", IMPLICIT_GYROSCOPIC, IMPLICIT_GYROSCOPIC),
        ("4.0.0", IMPLICIT_GYROSCOPIC, IMPLICIT_GYROSCOPIC),
    ],
)
def test_discretisation_depends_on_the_version(version, implicit, implicitfast, installed):
    """Gyroscopic terms as in the changelog; RK4's rotations are classical from 4.0 on."""
    installed(version)
    tumble, ball = scenarios.load("spin-asymmetric"), scenarios.load("drop-ball-backspin")
    claimed = {name: engine(f"mujoco[integrator={name}]").discretisation(tumble) for name in mujoco_engine.INTEGRATORS}
    runge_kutta = claimed.pop("rk4")
    assert claimed == {"euler": EXPLICIT_GYROSCOPIC, "implicit": implicit, "implicitfast": implicitfast}
    assert (runge_kutta == "classical Runge-Kutta") == (version == "4.0.0")
    by_midpoint = engine("mujoco[integrator=implicitfast]").discretisation(ball).startswith(MIDPOINT_GYROSCOPIC)
    assert by_midpoint == (implicitfast == MIDPOINT_GYROSCOPIC)  # also of a ball that the floor spins


def test_calibrated_boxes_need_the_exact_diagonal(installed):
    """The refusal names the installed version, the version needed, and what to do."""
    box, flight = scenarios.load("drop-box-flat"), scenarios.load("spin-asymmetric")
    installed("3.9.0")
    assert engine("mujoco").declines(box) is None
    installed("3.8.1")
    for name in ("mujoco", "mujoco[kappa=0.002]", "mujoco[spring_steps=20]", "mujoco[integrator=rk4]"):
        refusal = engine(name).declines(box)
        assert "MuJoCo 3.8.1 is installed" in refusal
        assert "from 3.9 on" in refusal
        assert "profile=default" in refusal
    assert engine("mujoco[profile=default]").declines(box) is None
    assert engine("mujoco").declines(flight) is None
    installed("3.2.3")
    for scene, name in ((flight, "mujoco"), (box, "mujoco[profile=default]")):
        assert "MuJoCo 3.2.3 is installed" in engine(name).declines(scene)
        assert "update mujoco to 3.2.4 or later" in engine(name).declines(scene)


@pytest.mark.parametrize("name", ["mujoco", "mujoco[spring_steps=20]", "mujoco[integrator=rk4,spring_steps=20]"])
@pytest.mark.parametrize("scene_name", ["drop-ball", "drop-ball-backspin"])
def test_balls_move_the_same_without_the_exact_diagonal(name, scene_name, installed):
    """The same bits with and without the flags that a version lacks."""
    scene = scenarios.load(scene_name)
    with_all = simulate(scene, name, 2e-3)
    installed("3.3.5")
    np.testing.assert_array_equal(simulate(scene, name, 2e-3).states, with_all.states)


@pytest.mark.extended
def test_only_flags_of_the_version_are_set(installed):
    """In settings and in programs to paste; without a contact, none but autoreset."""
    import mujoco

    def flags(scene_name):
        with engine("mujoco").prepare(scenarios.load(scene_name), 1e-3) as simulation:
            model = simulation.model
            exact = bool(model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_DIAGEXACT)
            no_islands = bool(model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_ISLAND)
            assert exact == ("diagexact" in simulation.settings)
            assert no_islands == ("island" in simulation.settings)
            return {"cone", "jacobian", "diagexact", "island", "autoreset"} & set(simulation.settings)

    assert flags("spin-asymmetric") == {"autoreset"}
    assert flags("drop-ball") == {"cone", "jacobian", "diagexact", "island", "autoreset"}
    for version, lacking in (("3.8.1", {"diagexact"}), ("3.3.5", {"diagexact", "island"})):
        installed(version)
        assert flags("spin-asymmetric") == {"autoreset"}
        assert flags("drop-ball") == {"cone", "jacobian", "diagexact", "island", "autoreset"} - lacking
        programs = engine("mujoco").programs(scenarios.load("drop-ball"), 1e-3)
        for text in programs.values():
            assert not [name for name in lacking if name in text.lower()]
            assert "autoreset" in text.lower()
        mujoco.MjModel.from_xml_string(programs["mjcf"])
    assert calibrate(engine("mujoco"), 0.7, 2e-3).measured[0].value == pytest.approx(0.7, abs=1e-5)


def test_versions_without_threaded_rollouts_have_no_batches(installed):
    members = [scenarios.load("drop-ball"), scenarios.load("drop-ball-lively")]
    assert engine("mujoco").prepare_batch(members, 1e-3) is not None
    installed("3.2.6")
    assert engine("mujoco").prepare_batch(members, 1e-3) is None


def older(version, folder):
    """Install a version from the package index into a folder of its own."""
    there = folder / version
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "--no-deps", "--target", there, f"mujoco=={version}"], check=True)
    return there


def with_version(there, *arguments, cwd):
    """Run the command with the packages in a folder first on the path."""
    program = f"import sys; sys.path.insert(0, {str(there)!r}); from dropspin.reports.commands.main import main; main()"
    return subprocess.run([sys.executable, "-P", "-c", program, *arguments], cwd=cwd, capture_output=True, text=True, check=False)


@pytest.mark.slow
@pytest.mark.parametrize("version", ["3.2.4", "3.6.0", "3.10.0"])
def test_installed_older_versions_reproduce_published_energies(version, tmp_path):
    """E/E₀ as published; provenance names the version that ran; boxes are declined where the flag diagexact is missing."""
    there = older(version, tmp_path)
    (tmp_path / "free-body.toml").write_text(FREE_BODY)

    def run(out, *arguments):
        done = with_version(there, "run", *arguments, "-o", out, cwd=tmp_path)
        assert done.returncode in (0, 1), done.stdout + done.stderr  # 1 where a default profile misses what is expected
        stored = json.loads((tmp_path / out / "run.json").read_text())
        rows = list(csv.DictReader((tmp_path / out / "results.csv").read_text().splitlines()))
        return stored["provenance"], rows

    implicitfast = "mujoco[integrator=implicitfast]"
    gyroscopic = flight_of("implicitfast", numbers_of(version))
    for scene in ("free-body.toml", "spin-asymmetric"):
        provenance, rows = run(f"out-{scene}", scene, "-e", implicitfast, "--dt", "0.01")
        [drift] = [float(row["value"]) for row in rows if row["metric"] == "energy_drift"]
        if scene == "free-body.toml":
            assert 1.0 + drift == pytest.approx(PUBLISHED[gyroscopic], abs=5e-8)
        else:
            assert {EXPLICIT_GYROSCOPIC: drift > 1e-3, MIDPOINT_GYROSCOPIC: abs(drift) < 1e-11}[gyroscopic]
        assert provenance["versions"]["mujoco"] == version
        assert {settings["version"] for settings in provenance["settings"][implicitfast].values()} == {version}
    _, rows = run("floor", "drop-box-flat", "drop-ball", "-e", "mujoco", "-e", "mujoco[profile=default]")
    verdicts = {(scene, name): set() for scene in ("drop-ball", "drop-box-flat") for name in ("mujoco", "mujoco[profile=default]")}
    for row in rows:
        verdicts[row["scene"], row["engine"]].add(row["verdict"])
    assert verdicts["drop-ball", "mujoco"] == {"passed", "measured"}
    assert verdicts["drop-box-flat", "mujoco"] == ({"passed", "measured"} if version == "3.10.0" else {"declined"})
    for scene in ("drop-ball", "drop-box-flat"):
        assert {"measured", "failed"} <= verdicts[scene, "mujoco[profile=default]"] <= {"measured", "failed", "passed"}


@pytest.mark.slow
def test_changes_between_versions_are_attributed_to_the_engine(tmp_path):
    """`compare` and `history` over five versions: implicitfast changed in two of them, the attitude of Runge-Kutta at 4.0.0."""
    (tmp_path / "free-body.toml").write_text(FREE_BODY)
    implicitfast, rk4 = "mujoco[integrator=implicitfast]", "mujoco[integrator=rk4]"
    versions = ["3.6.0", "3.7.0", "3.10.0", "3.11.0", "4.0.0"]
    for version in versions:
        there = older(version, tmp_path)
        engines = [word for name in (implicitfast, rk4, "wang") for word in ("-e", name)]
        done = with_version(there, "run", "free-body.toml", *engines, "--dt", "0.01", "-o", f"runs/{version}", cwd=tmp_path)
        assert done.returncode == 0, done.stdout + done.stderr
    runs = {version: load_results(tmp_path / "runs" / version) for version in versions}
    changes = compare(runs["3.6.0"], runs["4.0.0"])
    assert changes.attributions[implicitfast].origin == "engine"
    assert "mujoco 3.6.0 → 4.0.0" in changes.attributions[implicitfast].message
    assert "wang" not in changes.attributions
    found = history(runs)
    moves = [(found.names[move.run], move.engine) for move in found.moves]
    assert moves == [("3.7.0", implicitfast), ("3.11.0", implicitfast), ("4.0.0", rk4)]
    drifts = found.results[(found.results["metric"] == "energy_drift") & (found.results["engine"] == implicitfast)]
    ratios = 1.0 + drifts.sort_values("run")["value"]
    np.testing.assert_allclose(ratios, [1.0868946, 1.0, 1.0, 0.9260083, 0.9260083], atol=5e-8)
