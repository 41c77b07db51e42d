"""The examples for CI servers in docs/ci, and the action at the root that one of them uses, run step by step as the servers do."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[3]
ENGINE = "my_engine:MyEngine"
HERE = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
ACTION = yaml.safe_load((ROOT / "action.yml").read_text())
GITHUB = yaml.safe_load((ROOT / "docs/ci/github.yml").read_text())
GITLAB = yaml.safe_load((ROOT / "docs/ci/gitlab.yml").read_text())


def called(*command, cwd, **environment):
    return subprocess.run(command, cwd=cwd, env=os.environ | environment, capture_output=True, text=True, timeout=900, check=False)


def github_steps(**inputs):
    """The text and the environment of each step of the action, with the inputs of the example and others."""
    [used] = [step for step in GITHUB["jobs"]["accuracy"]["steps"] if step["uses"].startswith("OWNER/dropspin@")]
    values = {name: declared["default"] for name, declared in ACTION["inputs"].items()} | used["with"] | inputs
    steps = [step for step in ACTION["runs"]["steps"] if "run" in step]
    return [
        (step["run"], {name: values[value.removeprefix("${{ inputs.").removesuffix(" }}")] for name, value in step.get("env", {}).items()})
        for step in steps
    ]


def gitlab_steps(line=lambda line: line):
    return [("\n".join(map(line, GITLAB["accuracy"]["script"])), {"DROPSPIN": str(ROOT), "ENGINE": ENGINE, "CI": "true"})]


def run_steps(steps, folder, release, **environment):
    """One step after the other, each in a shell of its own, until one fails."""
    files = {name: str(folder / name) for name in ("GITHUB_OUTPUT", "GITHUB_STEP_SUMMARY")}
    given = {**files, "GITHUB_ACTION_PATH": str(ROOT), "RELEASE": release, **environment}
    for text, of_step in steps:
        done = called("bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", text, cwd=folder, **given, **of_step)
        if done.returncode:
            break
    return done


def copied(repository, folder):
    for name in ("my_engine.py", "dropspin-baseline.toml"):
        shutil.copy(repository / name, folder)


def assert_outcome(release, folder, done, exit_codes, junit_schema):
    """Returns the summary."""
    assert done.returncode == exit_codes[release], done.stdout + done.stderr
    junit_schema.validate(folder / "out/junit.xml")
    [summary] = [path for path in (folder / "GITHUB_STEP_SUMMARY", folder / "out/summary.md") if path.exists()]
    assert summary.read_text().startswith(f"## dropspin: {'✓' if release == 'good' else '✗'}")
    return summary.read_text()


@pytest.mark.extended
@pytest.mark.parametrize("release", ["failing", *(pytest.param(release, marks=pytest.mark.slow) for release in ("good", "crashing"))])
def test_action_judges_an_engine_and_names_the_cause_of_a_regression(release, repository, exit_codes, junit_schema, tmp_path):
    """With one scene, and what is installed here."""
    copied(repository, tmp_path)
    _, *steps = github_steps(engines=f"{ENGINE}\n", scenes="drop-ball\n")
    summary = assert_outcome(release, tmp_path, run_steps(steps, tmp_path, release, PATH=HERE), exit_codes, junit_schema)
    assert ("restitution 1 % too high" in summary) == (release == "failing")
    outputs = dict(line.split("=") for line in (tmp_path / "GITHUB_OUTPUT").read_text().splitlines())
    assert outputs.keys() == ACTION["outputs"].keys()
    assert all((tmp_path / path).is_file() for path in outputs.values())


def test_texts_of_inputs_are_no_commands(tmp_path):
    planted = "$(touch planted)`touch planted`'; touch planted; \""
    _, measure, _ = github_steps(engines=planted, scenes=planted, **{"time-steps": planted}, output=f"out{planted}")
    done = run_steps([measure], tmp_path, "good", PATH=HERE)
    assert done.returncode == 1
    assert "is not a valid float" in done.stderr
    assert list(tmp_path.iterdir()) == []
    assert not any("${{" in step["run"] for step in ACTION["runs"]["steps"] if "run" in step)


@pytest.mark.parametrize(("complete", "given"), [("true", True), ("True", True), ("false", False)])
def test_action_can_ask_for_every_accepted_result(complete, given, tmp_path):
    (tmp_path / "dropspin").write_text("#!/bin/sh\necho $*\n")
    (tmp_path / "dropspin").chmod(0o755)
    *_, judge = github_steps(complete=complete)
    done = run_steps([judge], tmp_path, "good", PATH=f"{tmp_path}{os.pathsep}{HERE}")
    assert done.stdout.startswith("check out/run --baseline dropspin-baseline.toml --junit out/junit.xml --summary ")
    assert done.stdout.endswith(" --complete\n") == given


@pytest.mark.parametrize(
    ("writes", "code", "judged"), [(True, 0, True), (True, 1, True), (True, 3, True), (False, 1, False), (False, 2, False)]
)
def test_action_judges_failed_runs_that_are_written_and_removes_no_files(writes, code, judged, tmp_path):
    """An older run is not judged in place of one that was not written."""
    (tmp_path / "run").mkdir()
    (tmp_path / "run/run.json").touch()
    (tmp_path / "dropspin").write_text(f"#!/bin/sh\n{'sleep 0.1; touch run/run.json' * writes}\nexit {code}\n")
    (tmp_path / "dropspin").chmod(0o755)
    _, measure, _ = github_steps(output=".")
    assert (run_steps([measure], tmp_path, "good", PATH=f"{tmp_path}{os.pathsep}{HERE}").returncode == 0) == judged
    assert (tmp_path / "run/run.json").is_file()


def test_actions_of_others_are_named_by_their_commits():
    texts = [path.read_text() for path in (ROOT / "action.yml", *(ROOT / "docs/ci").glob("*.yml"))]
    used = {name for text in texts for name in re.findall(r"uses: (\S+)", text)} - {"OWNER/dropspin@COMMIT"}
    assert used
    assert all(re.fullmatch(r"[\w/-]+@[0-9a-f]{40}", name) for name in used)


@pytest.mark.slow
@pytest.mark.parametrize("release", ["good", "failing", "crashing"])
def test_gitlab_example_judges_an_engine(release, repository, exit_codes, junit_schema, tmp_path):
    """With one scene and one time step, and what is installed here."""
    copied(repository, tmp_path)

    def line(text):
        return text.replace("dropspin run", "dropspin run drop-ball --dt 0.004").replace("pip install", "test -d")

    assert_outcome(release, tmp_path, run_steps(gitlab_steps(line), tmp_path, release, PATH=HERE), exit_codes, junit_schema)


@pytest.mark.slow
def test_action_works_on_a_clean_machine(repository, exit_codes, junit_schema, tmp_path):
    """Installed from nothing, first measured and accepted as the example's comment says, then all three releases of the engine."""
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "clean"], check=True)
    clean = {"PATH": f"{tmp_path / 'clean/bin'}{os.pathsep}/usr/bin{os.pathsep}/bin"}
    folder = tmp_path / "repository"
    folder.mkdir()
    shutil.copy(repository / "my_engine.py", folder)
    steps = github_steps(engines=ENGINE, scenes="drop-ball")
    first = f"dropspin run drop-ball -e {ENGINE} -o out/run; dropspin accept out/run --reason 'first measured'"
    assert run_steps([steps[0], (first, {})], folder, "good", **clean).returncode == 0
    for release in exit_codes:
        (folder / "GITHUB_STEP_SUMMARY").unlink(missing_ok=True)
        assert_outcome(release, folder, run_steps(steps, folder, release, **clean), exit_codes, junit_schema)
