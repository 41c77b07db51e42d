"""The gate on the command line: check, accept, compare and history, what they write for CI servers, and the examples for two of these."""

import datetime
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import xml.etree.ElementTree as ET
from pathlib import Path

import pandas as pd
import pytest
import xmlschema
import yaml

import comparisons
import scenarios
from reports.junit import junit_xml
from reports.views.check import Held, accepted_sentences, sentences

ROOT = Path(__file__).parents[2]
DROPSPIN = Path(sys.executable).with_name("dropspin")
ENGINE, LABEL = "my_engine:MyEngine", "my-engine"
MY_ENGINE = '''
import os
from comparisons.engines.base import Engine
from comparisons.engines.registry import engine


class MyEngine(Engine):
    """An engine whose library changes under it."""

    name = "my-engine"

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
RUN = ("run", "spin-principal", "drop-ball", "-e", ENGINE)


def called(*command, cwd, **environment):
    return subprocess.run(command, cwd=cwd, env=os.environ | environment, capture_output=True, text=True, timeout=900, check=False)


def dropspin(*arguments, cwd, **environment):
    return called(DROPSPIN, *arguments, cwd=cwd, **environment)


@pytest.fixture(scope="module")
def repository(tmp_path_factory):
    """A user's repository with an engine, three runs of three releases of it, and the first one's figures accepted."""
    folder = tmp_path_factory.mktemp("repository")
    (folder / "my_engine.py").write_text(MY_ENGINE)
    codes = {
        release: dropspin(*RUN, "-o", f"out/{release}", cwd=folder, RELEASE=release).returncode
        for release in ("good", "failing", "crashing")
    }
    assert codes == {"good": 0, "failing": 1, "crashing": 3}
    accepted = dropspin("accept", "out/good", "--reason", "first measured", cwd=folder)
    assert accepted.returncode == 0, accepted.stderr
    assert f"Accepted of 2 scenes with {LABEL}: " in accepted.stdout
    assert "Written: dropspin-baseline.toml, " in accepted.stdout
    return folder


@pytest.fixture(scope="module")
def schema(tmp_path_factory):
    """The schema that Jenkins' xUnit plugin reads JUnit by; pytest's source distribution has it, as pytest's own tests read it."""
    folder = tmp_path_factory.mktemp("schema")
    fetched = called(
        sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--no-binary=:all:", "pytest==8.4.2", "-d", str(folder), cwd=folder
    )
    assert fetched.returncode == 0, fetched.stderr
    with tarfile.open(folder / "pytest-8.4.2.tar.gz") as archive:
        text = archive.extractfile("pytest-8.4.2/testing/example_scripts/junit-10.xsd")
        assert text is not None
        return xmlschema.XMLSchema(text.read().decode())


CODES = {"good": 0, "failing": 1, "crashing": 3}


@pytest.mark.parametrize("release", CODES)
def test_check(release, repository, schema, tmp_path):
    """Exit code, JUnit that CI servers read, a summary, and every failure with its command."""
    done = dropspin(
        "check", f"out/{release}", "--baseline", "dropspin-baseline.toml", "--junit", str(tmp_path / "deep/junit.xml"),
        "--summary", str(tmp_path / "summary.md"), cwd=repository,
    )  # fmt: skip
    assert done.returncode == CODES[release]
    schema.validate(tmp_path / "deep/junit.xml")
    [suite] = ET.parse(tmp_path / "deep/junit.xml").getroot()
    failed, broken = int(suite.attrib["failures"]), int(suite.attrib["errors"])
    assert {"good": failed == broken == 0, "failing": failed > 20 and broken == 0, "crashing": failed == broken == 3}[release]
    assert len({(case.attrib["classname"], case.attrib["name"]) for case in suite.iter("testcase")}) == int(suite.attrib["tests"])
    summary = (tmp_path / "summary.md").read_text()
    assert len(summary) < 65_536  # what a comment on GitHub may be
    assert summary.startswith(f"## dropspin: {'✓' if release == 'good' else '✗'}")
    told = " ".join(done.stdout.split())
    if release == "good":
        assert "accepted figures hold." in told
    if release == "failing":
        first = told.split("✗")[1]
        assert "drop-ball · my-engine" in first
        assert "restitution error is 0.005, accepted -" in first
        assert "first measured; worse by 1.67e+05 times its tolerance" in first
        assert "Again: dropspin run drop-ball -e my_engine:MyEngine --dt 0.00" in first
        assert "--baseline dropspin-baseline.toml" in first
        assert "Since they were accepted: my-engine good → failing." in told
        assert "most of all restitution error in drop-ball" in told
    if release == "crashing":
        assert f"drop-ball · {LABEL} · 0.004 s: crashed. its process was ended by SIGABRT" in told
        assert "If that is as it should be" not in told


def test_the_command_that_does_it_again(repository, tmp_path):
    """Is one command, ends as the check did, and measures the same figure."""
    found = json.loads(dropspin("check", "out/failing", "--baseline", "dropspin-baseline.toml", "--json", cwd=repository).stdout)
    [row] = [row for row in found if row["kind"] == "baseline" and row["metric"] == "restitution_error" and row["dt"] == 0.004]
    command = f"dropspin run drop-ball -e {ENGINE} --dt 0.004 --baseline dropspin-baseline.toml -o out/again"
    checked = dropspin("check", "out/failing", "--baseline", "dropspin-baseline.toml", "--junit", str(tmp_path / "j.xml"), cwd=repository)
    assert checked.returncode == 1
    assert command in (tmp_path / "j.xml").read_text()
    done = dropspin(*command.split()[1:], "--json", cwd=repository, RELEASE="failing")
    shutil.rmtree(repository / "out/again")
    assert done.returncode == 1
    [again] = [one for one in json.loads(done.stdout) if one["kind"] == "baseline" and one["metric"] == "restitution_error"]
    assert (again["value"], again["verdict"]) == (row["value"], "failed")


def test_a_run_can_be_held_against_accepted_figures_at_once(repository, tmp_path):
    """With the same words and the same exit code as a check."""
    for release, code, said in (("good", 0, "accepted figures hold."), ("failing", 1, "accepted figures fail.")):
        done = dropspin(*RUN, "--baseline", "dropspin-baseline.toml", "-o", str(tmp_path / release), cwd=repository, RELEASE=release)
        assert done.returncode == code
        assert said in " ".join(done.stdout.split())


def test_a_run_of_what_was_never_accepted_is_kept(repository, tmp_path):
    """Bad input, but nothing is lost: it can be accepted."""
    command = ("run", "fall-spin", "-e", ENGINE, "--dt", "0.004", "--baseline", "dropspin-baseline.toml", "-o", str(tmp_path / "new"))
    done = dropspin(*command, "--json", cwd=repository)
    assert done.returncode == 2
    assert "dropspin-baseline.toml: none of the" in done.stderr
    assert f"The run is written: {tmp_path / 'new'}." in done.stderr
    assert {row["scene"] for row in json.loads(done.stdout)} == {"fall-spin"}
    (tmp_path / "b.toml").write_text((repository / "dropspin-baseline.toml").read_text())
    accepted = dropspin("accept", str(tmp_path / "new"), "--baseline", str(tmp_path / "b.toml"), "--reason", "new", cwd=repository)
    assert accepted.returncode == 0
    assert dropspin("check", str(tmp_path / "new"), "--baseline", str(tmp_path / "b.toml"), cwd=repository).returncode == 0


def test_a_crash_is_nothing_to_accept(repository, tmp_path):
    """What was accepted before stays, to the last byte; where there is nothing else, nothing is written."""
    (tmp_path / "b.toml").write_text((repository / "dropspin-baseline.toml").read_text())
    done = dropspin("accept", "out/crashing", "--baseline", str(tmp_path / "b.toml"), "--reason", "x", cwd=repository)
    assert done.returncode == 0
    assert "gone" not in done.stdout
    assert "what was accepted of them before stays" in done.stdout
    assert (tmp_path / "b.toml").read_text() == (repository / "dropspin-baseline.toml").read_text()
    dropspin("run", "drop-ball", "-e", ENGINE, "-o", str(tmp_path / "dead"), cwd=repository, RELEASE="crashing")
    done = dropspin("accept", str(tmp_path / "dead"), "--baseline", str(tmp_path / "none.toml"), "--reason", "x", cwd=repository)
    assert done.returncode == 2
    assert "nothing to accept: no engine measured a figure" in done.stderr
    assert not (tmp_path / "none.toml").exists()


def test_an_engine_that_cannot_be_imported_any_more(repository, schema, tmp_path):
    """Has lost what was accepted of it, and CI is told in every form."""
    (tmp_path / "my_engine.py").write_text("import no_such_library")
    done = dropspin(*RUN, "-o", "out", cwd=tmp_path)
    assert done.returncode == 3
    shutil.copy(repository / "dropspin-baseline.toml", tmp_path)
    files = ("--junit", "junit.xml", "--summary", "summary.md")
    done = dropspin("check", "out", "--baseline", "dropspin-baseline.toml", *files, cwd=tmp_path)
    assert done.returncode == 3
    assert "accepted figures are gone, missing: " in " ".join(done.stdout.split())
    schema.validate(tmp_path / "junit.xml")
    assert (tmp_path / "summary.md").read_text().startswith("## dropspin: ✗")


def expecting(metric):
    harsh = {"metric": metric, "below": 1e-12, "reason": "none is that exact"}
    return scenarios.load(scenarios.load("drop-ball").model_dump(exclude={"expect"}, exclude_none=True) | {"expect": [harsh]})


@pytest.mark.parametrize(
    ("metric", "accepted", "told"),
    [
        ("penetration", [], ["1 check fails as it was known to.", "All 11 accepted figures hold."]),
        (
            "energy_error_raw",
            ["1 check fails without a figure that can be held, and cannot be accepted as known."],
            ["1 of 1 checks fail. All 11 accepted figures hold."],
        ),
    ],
)
def test_known_failures_are_told(metric, accepted, told):
    """Neither as if nothing were expected, nor as if what cannot be held could be."""
    found = comparisons.run([expecting(metric)], ["mujoco"], [4e-3])
    base, change = comparisons.accept(found, comparisons.Baseline(), "known", datetime.date(2026, 3, 1), known_failures=True)
    assert accepted_sentences(found, change, known_failures=True)[1:] == accepted
    assert sentences(comparisons.check(found, base), Held(base, "b.toml", "out")) == told


def test_annotations_are_for_github(repository):
    """Commands that its runner reads, only there, and no more than it shows."""
    quiet = dropspin("check", "out/failing", "--baseline", "dropspin-baseline.toml", cwd=repository)
    assert "::error" not in quiet.stdout
    loud = dropspin("check", "out/failing", "--baseline", "dropspin-baseline.toml", cwd=repository, GITHUB_ACTIONS="true")
    commands = [line for line in loud.stdout.splitlines() if line.startswith("::")]
    assert 0 < len(commands) <= 10
    assert commands[0].startswith("::error title=drop-ball my-engine::drop-ball · ")


def test_compare(repository, tmp_path):
    """What got worse and whose it is; nothing between a run and itself; the same in Markdown and in JSON."""
    done = dropspin("compare", "out/good", "out/failing", "--summary", str(tmp_path / "summary.md"), cwd=repository)
    assert done.returncode == 1
    told = " ".join(done.stdout.split())
    assert "The engine's: my-engine good → failing, its settings (restitution)." in told
    assert "Worse: " in told
    assert "| drop-ball | my-engine | restitution error |" in (tmp_path / "summary.md").read_text()
    data = json.loads(dropspin("compare", "out/good", "out/failing", "--json", cwd=repository).stdout)
    assert data["put_down_to"][LABEL]["culprit"] == "engine"
    assert {figure["scene"] for figure in data["figures"]} == {"drop-ball"}
    same = dropspin("compare", "out/good", "out/good", cwd=repository)
    assert same.returncode == 0
    assert same.stdout.splitlines()[-1].startswith("None of ")


def test_history(repository, tmp_path):
    """A folder of runs: when figures moved, whose it is, a table and a plot for each scene."""
    done = dropspin("history", "out", "-o", str(tmp_path / "history"), cwd=repository)
    assert done.returncode == 0, done.stderr
    assert "moved in failing, after good. The engine's" in " ".join(done.stdout.split())
    names = {path.name for path in (tmp_path / "history").iterdir()}
    assert names == {"history.csv", "history.json", "history.md", "drop-ball.svg", "spin-principal.svg"}
    rows = json.loads((tmp_path / "history/history.json").read_text())
    assert {row["run"] for row in rows} == {"good", "failing", "crashing"}
    assert "![drop-ball](drop-ball.svg)" in (tmp_path / "history/history.md").read_text().splitlines()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["check", "absent"], "absent: not the folder of a run"),
        (["check", "out/good", "--baseline", "absent.toml"], "absent.toml: No such file or directory"),
        (["check", "out/good", "--baseline", "my_engine.py"], "my_engine.py: not TOML"),
        (["check", "out/good", "--baseline", "out"], "out: is a directory; a baseline is one TOML file"),
        (["check", "out/good", "--junit", "my_engine.py/x"], "my_engine.py"),
        (["accept", "out/good"], "Missing option '--reason'"),
        (["accept", "out/good", "--reason", " "], "--reason is empty"),
        (["accept", "out/good", "--reason", "a\nb"], "say it in one line"),
        (["compare", "out/good", "out/good", "--fail-speed", "20%"], "takes two engines"),
        (["accept", "--reason", "x"], "Missing argument 'RUN...'"),
        (["accept", "out/good", "--reason", "x", "--baseline", "my_engine.py"], "my_engine.py: not TOML"),
        (["accept", "out/good", "--reason", "x", "--baseline", "my_engine.py/b.toml"], "my_engine.py/b.toml: cannot be written"),
        (["compare", "out/good"], "Missing argument 'NEW'"),
        (["compare", "out/good", "absent"], "absent: not the folder of a run"),
        (["compare", "out/good", "out/good", "--fail-speed", "fast"], "'fast' is no share of time"),
        (["compare", "out/good", "out/good", "--fail-speed", "-5%"], "is no share of time"),
        (["history", "out/good"], "a history takes two runs or more"),
        (["history", "absent"], "absent: no run, and no folder of runs"),
    ],
    ids=lambda case: " ".join(case) if isinstance(case, list) else "",
)
def test_bad_usage(arguments, message, repository):
    """Exit code 2, one reason, no traceback, nothing written."""
    before = sorted(repository.rglob("*"))
    done = dropspin(*arguments, cwd=repository)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    assert sorted(repository.rglob("*")) == before


def test_the_page_s_python_runs():
    """As it stands."""
    [block] = re.findall(r"^```python\n(.*?)^```", (ROOT / "docs/gate.md").read_text(), re.DOTALL | re.MULTILINE)
    names: dict[str, object] = {}
    exec(block, names)
    assert set(names["changes"].figures["change"]) == {"same"}


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("run.json", b'{"provenance": {}}', "is a run of another version of dropspin"),
        ("run.json", b"[]", "is a run of another version of dropspin"),
        ("run.json", b"{", "not the folder of a run"),
        ("run.json", b"\xff\xfe", "not the folder of a run"),
        ("results.parquet", b"PAR1", "not the folder of a run"),
        ("tolerances.parquet", None, "not the folder of a run"),
    ],
)
def test_folders_that_are_no_runs(file, content, message, repository, tmp_path):
    """Older, cut off, or of something else: one line that says so."""
    shutil.copytree(repository / "out/good", tmp_path / "run")
    (tmp_path / "run" / file).unlink()
    if content is not None:
        (tmp_path / "run" / file).write_bytes(content)
    done = dropspin("check", "run", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert message in done.stderr
    assert done.stderr.count("\n") == 1


def without_names(run):
    content = json.loads((run / "run.json").read_text())
    del content["provenance"]["names"], content["provenance"]["asked"]["dts"]
    (run / "run.json").write_text(json.dumps(content))


def shorter(run):
    pd.read_parquet(run / "tolerances.parquet").iloc[1:].to_parquet(run / "tolerances.parquet", index=False)


def of_another(run):
    frame = pd.read_parquet(run / "results.parquet")
    frame.assign(scene="fall-spin").to_parquet(run / "results.parquet", index=False)


@pytest.mark.parametrize(
    ("damage", "message"),
    [(without_names, "lacks dts, names"), (shorter, "not of one run"), (of_another, "not of one run")],
)
def test_runs_that_are_not_whole(damage, message, repository, tmp_path):
    """Each file can be read, and they do not belong together: one line that says so."""
    shutil.copytree(repository / "out/good", tmp_path / "run")
    damage(tmp_path / "run")
    done = dropspin("check", "run", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert message in done.stderr


def test_names_that_xml_cannot_write(schema, tmp_path):
    """A scene may be called anything that a file may."""
    named = expecting("penetration").model_copy(update={"name": "ctl\x01\x0c"})
    (tmp_path / "junit.xml").write_bytes(junit_xml(comparisons.run([named], ["mujoco"], [4e-3])))
    schema.validate(tmp_path / "junit.xml")


def scripts():
    """The lines that each example has its CI server run."""
    github = yaml.safe_load((ROOT / "docs/ci/github.yml").read_text())
    steps = [step["run"] for step in github["jobs"]["accuracy"]["steps"] if "run" in step]
    gitlab = yaml.safe_load((ROOT / "docs/ci/gitlab.yml").read_text())
    return {"github": steps, "gitlab": gitlab["accuracy"]["script"]}


def run_example(lines, folder, release, **environment):
    """As the servers do it: one line after the other, until one fails."""
    summary = folder / "step-summary.md"
    given = {"ENGINE": ENGINE, "GITHUB_STEP_SUMMARY": str(summary), "RELEASE": release, "CI": "true"}
    return called("bash", "-e", "-o", "pipefail", "-c", "\n".join(lines), cwd=folder, **given, **environment)


def judged_as(release, folder, done, schema):
    assert done.returncode == CODES[release], done.stdout + done.stderr
    schema.validate(folder / "out/junit.xml")
    [summary] = [path for path in (folder / "step-summary.md", folder / "out/summary.md") if path.exists()]
    assert summary.read_text().startswith(f"## dropspin: {'✓' if release == 'good' else '✗'}")


@pytest.mark.parametrize("server", ["github", pytest.param("gitlab", marks=pytest.mark.slow)])
@pytest.mark.parametrize("release", CODES)
def test_the_examples_judge(server, release, repository, schema, tmp_path):
    """A good, a failing and a crashing engine, by the examples' own lines; two scenes, and what is installed here."""
    for name in ("my_engine.py", "dropspin-baseline.toml"):
        (tmp_path / name).write_text((repository / name).read_text())
    install, *lines = scripts()[server]
    assert install == "pip install dropspin"
    lines = [line.replace("dropspin run", "dropspin run spin-principal drop-ball") for line in lines]
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    judged_as(release, tmp_path, run_example(lines, tmp_path, release, PATH=path), schema)


@pytest.mark.slow
def test_the_examples_work_on_a_clean_machine(schema, tmp_path):
    """Word by word: installed from nothing, first measured and accepted as their comments say, then all three kinds of engine."""
    built = called(sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(tmp_path / "wheels"), str(ROOT), cwd=tmp_path)
    assert built.returncode == 0, built.stderr
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "clean"], check=True)
    clean = {"PATH": f"{tmp_path / 'clean/bin'}{os.pathsep}/usr/bin{os.pathsep}/bin", "PIP_FIND_LINKS": str(tmp_path / "wheels")}
    folder = tmp_path / "repository"
    folder.mkdir()
    (folder / "my_engine.py").write_text(MY_ENGINE)
    lines = scripts()["github"]
    first = [lines[0], f"dropspin run -e {ENGINE} -o out/run", "dropspin accept out/run --reason 'first measured'"]
    assert run_example(first, folder, "good", **clean).returncode == 0
    for release in CODES:
        (folder / "step-summary.md").unlink(missing_ok=True)
        judged_as(release, folder, run_example(lines, folder, release, **clean), schema)
