"""Releases of packages of npm: listed, and installed into an environment of their own. npm is replaced: no test needs it, or a network."""

from pathlib import Path
from threading import Event

import pytest

from dropspin.comparisons.record import environments
from dropspin.comparisons.record.environments import measured
from dropspin.comparisons.record.plan import Plan
from dropspin.comparisons.running.driving import Breakdown
from dropspin.scenarios import DropspinError

NPM = Plan.model_validate(
    {
        "dts": [0.01],
        "scenes": ["spin-principal"],
        "engines": {"wang": {"package": "@scope/engine", "oldest": "1.0", "labels": ["wang"]}},
    }
)
NO_VERSION = """npm error code ETARGET
npm error notarget No matching version found for @scope/engine@9.9.
npm error A complete log of this run can be found in: /home/someone/.npm/_logs/debug-0.log
"""


def test_releases_of_npm_are_those_from_the_oldest_on_without_prereleases(monkeypatch):
    output = '["0.0.0-103586e-20221016", "0.3.1", "0.8.0-alpha.0", "0.9.0", "0.10.0"]'
    monkeypatch.setattr(environments, "which", lambda name: name)
    monkeypatch.setattr(environments, "run", lambda command, stopping: (0, output))
    assert environments.releases("@scope/engine", "0.3.1") == ["0.3.1", "0.9.0", "0.10.0"]
    with pytest.raises(DropspinError, match="oldest release"):
        environments.releases("@scope/engine", "0.8.0-alpha.0")


def test_prereleases_are_those_after_the_newest_release(monkeypatch):
    """On npm those with a dist-tag, which the index has for a prerelease of an earlier release too."""
    tags = '{"latest": "0.10.0", "next": "0.11.0-beta.2", "canary": "0.11.0-alpha.7", "old": "0.10.0-rc.1"}'
    monkeypatch.setattr(environments, "which", lambda name: name)
    monkeypatch.setattr(environments, "run", lambda command, stopping: (0, tags))
    assert environments.prereleases("@scope/engine", "0.10.0") == ["0.11.0-alpha.7", "0.11.0-beta.2"]
    listed = "engine (1.1.0)\nAvailable versions: 1.2.0rc2, 1.2.0rc1, 1.1.0, 1.1.0rc1, 1.0.0\n"
    monkeypatch.setattr(environments, "run", lambda command, stopping: (0, listed))
    assert environments.prereleases("engine", "1.1.0") == ["1.2.0rc1", "1.2.0rc2"]
    assert environments.prereleases("engine", "1.2.0rc2") == []


@pytest.mark.extended
def test_a_release_of_npm_is_installed_into_its_environment(monkeypatch):
    """There it is found before one in the working folder."""

    def npm_writes(version):
        def replaced(command, stopping):
            if command[0] != "npm":
                return real(command, stopping)
            assert command[-1] == "@scope/engine@9.9"
            package = Path(command[command.index("--prefix") + 1], "node_modules/@scope/engine")
            package.mkdir(parents=True)
            (package / "package.json").write_text(f'{{"version": "{version}"}}')
            return 0, ""

        return replaced

    real = environments.run
    monkeypatch.setattr(environments, "which", lambda name: name)
    monkeypatch.setattr(environments, "run", npm_writes("9.9"))
    found = measured(NPM, "wang", "9.9", 60.0, Event())
    assert {row["verdict"] for row in found["rows"]} == {"measured"}
    assert found["versions"].endswith(", @scope/engine 9.9")
    monkeypatch.setattr(environments, "run", npm_writes("9.8"))
    with pytest.raises(Breakdown, match=r"^not runnable: exit code 1: version 9\.8 is imported instead of 9\.9$"):
        measured(NPM, "wang", "9.9", 60.0, Event())


def test_npm_that_fails_or_is_absent_is_named(monkeypatch):
    monkeypatch.setattr(environments, "which", lambda name: name)
    monkeypatch.setattr(environments, "run", lambda command, stopping: (1, NO_VERSION))
    with pytest.raises(Breakdown, match=r"^not installable: No matching version found for @scope/engine@9\.9\.$"):
        measured(NPM, "wang", "9.9", 60.0, Event())
    with pytest.raises(DropspinError, match="npm cannot list the releases of @scope/engine: No matching version"):
        environments.releases("@scope/engine", "1.0")
    monkeypatch.setattr(environments, "which", lambda name: None)
    with pytest.raises(DropspinError, match=r"record needs npm for @scope/engine, .*install Node\.js"):
        environments.releases("@scope/engine", "1.0")
