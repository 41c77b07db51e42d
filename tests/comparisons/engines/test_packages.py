"""Packages of npm are found as Node.js finds them, after those of Python's environment; what is missing is named."""

import sys
from importlib.metadata import PackageNotFoundError

import pytest
from support.cli import dropspin

from dropspin.comparisons.engines import registry
from dropspin.comparisons.engines.base import EngineMissing
from dropspin.comparisons.engines.packages import npm_package
from dropspin.comparisons.engines.packages import version as version_of
from dropspin.comparisons.results.provenance import versions

PACKAGE = "@dimforge/rapier3d-compat"


def install(folder, version):
    package = folder / "node_modules" / PACKAGE
    package.mkdir(parents=True)
    (package / "package.json").write_text(f'{{"version": "{version}"}}')
    return package


@pytest.fixture
def folders(tmp_path, monkeypatch):
    """An environment of Python, and a working folder in a project; neither has the package."""
    environment, project, work = tmp_path / "env", tmp_path / "project", tmp_path / "project/work"
    environment.mkdir()
    work.mkdir(parents=True)
    monkeypatch.setattr(sys, "prefix", str(environment))
    monkeypatch.chdir(work)
    return environment, project, work


def test_the_environment_comes_before_the_working_folder_and_the_folders_above_it(folders):
    environment, project, work = folders
    with pytest.raises(PackageNotFoundError):
        npm_package(PACKAGE)
    for folder, version in ((project, "0.1.0"), (work, "0.2.0"), (environment, "0.3.0")):
        assert install(folder, version) == npm_package(PACKAGE)
        assert version_of(PACKAGE) == version


def test_a_run_has_the_version(folders):
    assert versions()[PACKAGE] is None
    install(folders[2], "0.2.0")
    assert versions()[PACKAGE] == "0.2.0"


def test_a_missing_package_and_a_missing_node_are_named(folders, monkeypatch):
    monkeypatch.setattr(registry, "which", lambda name: name)
    with pytest.raises(EngineMissing, match=r"^rapier-js is not installed: npm install @dimforge/rapier3d-compat, in the working folder"):
        registry.engine("rapier-js")
    install(folders[2], "0.2.0")
    assert registry.engine("rapier-js").label == "rapier-js"
    monkeypatch.setattr(registry, "which", lambda name: None)
    with pytest.raises(EngineMissing, match=r"^rapier-js is not installed: it runs in Node\.js, and there is no node on PATH\.$"):
        registry.engine("rapier-js")


def test_list_of_engines_fits_80_columns_and_has_the_command_that_installs_each(folders, monkeypatch):
    def listed():
        done = dropspin("list", "engines", cwd=folders[2])
        assert max(map(len, done.stdout.splitlines())) <= 80
        return {line.split()[0]: line.split(maxsplit=2)[1:] for line in done.stdout.splitlines()}

    assert listed()["wang"][0] == "yes"
    monkeypatch.setattr(registry, "find_spec", lambda name: None)
    monkeypatch.setattr(registry, "which", lambda name: name)
    missing = listed()
    assert missing["mujoco"] == ["no", "pip install mujoco"]
    assert missing["drake"] == ["no", "pip install 'drake>=1.51'"]
    assert missing["havok"] == ["no", "npm install @babylonjs/havok"]
