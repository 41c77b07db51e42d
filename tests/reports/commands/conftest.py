"""A user's repository with an engine and three runs of it, for check, accept, compare and history."""

import shutil
from pathlib import Path

import pytest
import xmlschema
from support.brief_runs import all_starts
from support.cli import dropspin

from dropspin.comparisons.running.run import run
from dropspin.reports.run_folder import write_report
from dropspin.scenarios import load

MY_ENGINE = '''
import os
from dropspin import Engine, engine


class MyEngine(Engine):
    """An engine whose library changes under it."""

    name = "my-engine"

    def declines(self, scene):
        return engine("pybullet").declines(scene)

    def prepare(self, scene, dt):
        release = os.environ.get("RELEASE", "good")
        if release == "crashing" and scene.floor is not None:
            os.abort()
        if release == "failing" and scene.floor is not None:
            floor = scene.floor.model_copy(update={"restitution": 1.01 * scene.floor.restitution})
            scene = scene.model_copy(update={"floor": floor})
        simulation = engine("pybullet").prepare(scene, dt)
        simulation.settings = dict(simulation.settings) | {"version": release}
        return simulation
'''
RUN = ("run", "spin-principal", "drop-ball", "-e", "my_engine:MyEngine", "--dt", "0.008", "--dt", "0.004", "--dt", "0.002")


@pytest.fixture(scope="session")
def exit_codes():
    """By release of the engine, the exit code of its run and of a check of it."""
    return {"good": 0, "failing": 1, "crashing": 3}


@pytest.fixture(scope="session")
def repository(shared, exit_codes):
    """An engine, a run of each of its three releases, and the first one's results accepted; tests only read it."""

    def make(folder):
        (folder / "my_engine.py").write_text(MY_ENGINE)
        # As many start phases as in the processes that judge them by the examples for CI servers.
        with all_starts():
            runs = {release: dropspin(*RUN, "-o", f"out/{release}", cwd=folder, RELEASE=release) for release in exit_codes}
        codes = {release: done.returncode for release, done in runs.items()}
        assert codes == exit_codes
        accepted = dropspin("accept", "out/good", "--reason", "first measured", cwd=folder)
        assert accepted.returncode == 0, accepted.stderr
        assert "Accepted for 2 scenes with my-engine: " in accepted.stdout
        assert "Written: dropspin-baseline.toml, " in accepted.stdout

    return shared("repository", make)


@pytest.fixture(scope="session")
def junit_schema():
    """The schema by which Jenkins' xUnit plugin reads JUnit XML; pytest validates its own files by it too."""
    return xmlschema.XMLSchema(str(Path(__file__).parents[1] / "junit-10.xsd"))


ENSEMBLE = {
    "name": "few",
    "duration": 0.2,
    "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0},
    "floor": {"restitution": 0.5, "friction": 0.3},
    "gravity": {"acceleration": [0.0, -9.81, 0.0]},
    "start": {"position": [0.0, 0.15, 0.0]},
    "ensemble": {"size": 3, "seed": 1},
}


@pytest.fixture(scope="session")
def small():
    """A run of two scenes, one of them an ensemble."""
    spin = load("spin-principal").model_dump(exclude_none=True, exclude={"expect"}) | {"duration": 0.2}
    return run([spin, ENSEMBLE], ["wang", "mujoco"], 1e-2)


@pytest.fixture(scope="session")
def small_folder(small, tmp_path_factory):
    """The run, written."""
    return write_report(small, tmp_path_factory.mktemp("out") / "run").parent


@pytest.fixture
def copied(small_folder, tmp_path):
    """A copy of the run, in a folder of its own."""
    return shutil.copytree(small_folder, tmp_path / "run")
