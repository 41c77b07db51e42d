"""The examples for CI servers in docs/ci, run line by line as the servers do."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[3]
ENGINE = "my_engine:MyEngine"


def called(*command, cwd, **environment):
    return subprocess.run(command, cwd=cwd, env=os.environ | environment, capture_output=True, text=True, timeout=900, check=False)


def scripts():
    """The lines that each example has its CI server run."""
    github = yaml.safe_load((ROOT / "docs/ci/github.yml").read_text())
    steps = [step["run"] for step in github["jobs"]["accuracy"]["steps"] if "run" in step]
    gitlab = yaml.safe_load((ROOT / "docs/ci/gitlab.yml").read_text())
    return {"github": steps, "gitlab": gitlab["accuracy"]["script"]}


def run_example(lines, folder, release, **environment):
    """One line after the other, until one fails."""
    summary = folder / "step-summary.md"
    given = {"ENGINE": ENGINE, "GITHUB_STEP_SUMMARY": str(summary), "RELEASE": release, "CI": "true"}
    return called("bash", "-e", "-o", "pipefail", "-c", "\n".join(lines), cwd=folder, **given, **environment)


def assert_outcome(release, folder, done, exit_codes, junit_schema):
    assert done.returncode == exit_codes[release], done.stdout + done.stderr
    junit_schema.validate(folder / "out/junit.xml")
    [summary] = [path for path in (folder / "step-summary.md", folder / "out/summary.md") if path.exists()]
    assert summary.read_text().startswith(f"## dropspin: {'✓' if release == 'good' else '✗'}")


@pytest.mark.parametrize("server", ["github", pytest.param("gitlab", marks=pytest.mark.slow)])
@pytest.mark.parametrize("release", ["failing", *(pytest.param(release, marks=pytest.mark.slow) for release in ("good", "crashing"))])
def test_an_example_judges_a_good_a_failing_and_a_crashing_engine(server, release, repository, exit_codes, junit_schema, tmp_path):
    """By the example's own lines, with one scene and one time step, and what is installed here."""
    for name in ("my_engine.py", "dropspin-baseline.toml"):
        shutil.copy(repository / name, tmp_path)
    install, *lines = scripts()[server]
    assert install == "pip install dropspin"
    lines = [line.replace("dropspin run", "dropspin run drop-ball --dt 0.004") for line in lines]
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    assert_outcome(release, tmp_path, run_example(lines, tmp_path, release, PATH=path), exit_codes, junit_schema)


@pytest.mark.slow
def test_an_example_works_on_a_clean_machine(repository, exit_codes, junit_schema, tmp_path):
    """Word by word: installed from nothing, first measured and accepted as the comments say, then all three releases of the engine."""
    built = called(sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(tmp_path / "wheels"), str(ROOT), cwd=tmp_path)
    assert built.returncode == 0, built.stderr
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "clean"], check=True)
    clean = {"PATH": f"{tmp_path / 'clean/bin'}{os.pathsep}/usr/bin{os.pathsep}/bin", "PIP_FIND_LINKS": str(tmp_path / "wheels")}
    folder = tmp_path / "repository"
    folder.mkdir()
    shutil.copy(repository / "my_engine.py", folder)
    lines = scripts()["github"]
    first = [lines[0], f"dropspin run -e {ENGINE} -o out/run", "dropspin accept out/run --reason 'first measured'"]
    assert run_example(first, folder, "good", **clean).returncode == 0
    for release in exit_codes:
        (folder / "step-summary.md").unlink(missing_ok=True)
        assert_outcome(release, folder, run_example(lines, folder, release, **clean), exit_codes, junit_schema)
