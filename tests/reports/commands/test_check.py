"""`dropspin check` and `dropspin accept`."""

import datetime
import json
import re
import shutil
import xml.etree.ElementTree as ET

import pytest
from support.cli import dropspin

from dropspin.comparisons.regressions.baseline import Baseline
from dropspin.comparisons.regressions.checking import accept, check
from dropspin.comparisons.running.run import run
from dropspin.reports.junit import junit_xml
from dropspin.reports.stories.check import accepted_sentences, sentences
from dropspin.scenarios import load

ENGINE, LABEL = "my_engine:MyEngine", "my-engine"
RUN = ("run", "spin-principal", "drop-ball", "-e", ENGINE, "--dt", "0.008", "--dt", "0.004", "--dt", "0.002")
BASELINE = ("--baseline", "dropspin-baseline.toml")
pytestmark = pytest.mark.usefixtures("all_start_phases")  # results are compared with those of `repository`


@pytest.mark.sample(1)
@pytest.mark.parametrize("release", ["good", "failing", "crashing"])
def test_check_judges_a_run_and_writes_junit_and_a_summary(release, repository, exit_codes, junit_schema, tmp_path):
    """Exit code, JUnit that CI servers read, a summary, and every failure with its command."""
    done = dropspin(
        "check", f"out/{release}", *BASELINE, "--junit", tmp_path / "deep/junit.xml", "--summary", tmp_path / "summary.md", cwd=repository
    )
    assert done.returncode == exit_codes[release]
    junit_schema.validate(tmp_path / "deep/junit.xml")
    [suite] = ET.parse(tmp_path / "deep/junit.xml").getroot()
    failed, broken = int(suite.attrib["failures"]), int(suite.attrib["errors"])
    assert {"good": failed == broken == 0, "failing": failed > 15 and broken == 0, "crashing": failed == broken == 3}[release]
    assert len({(case.attrib["classname"], case.attrib["name"]) for case in suite.iter("testcase")}) == int(suite.attrib["tests"])
    summary = (tmp_path / "summary.md").read_text()
    assert len(summary) < 65_536  # what a comment on GitHub may be
    assert summary.startswith(f"## dropspin: {'✓' if release == 'good' else '✗'}")
    output = " ".join(done.stdout.split())
    if release == "good":
        assert re.search(r"All \d+ accepted results hold\.$", output)
    if release == "failing":
        first = output.split("✗")[1]
        assert first.startswith(" drop-ball · my-engine · 0.008 s: restitution error is 0.005, accepted ")
        assert "first measured; worse by 0.005, 1.67e+05 times its tolerance (and 2 other time steps); " in first
        assert re.search(r"; \d+ other results of this scene fail \(", first)
        command = "dropspin run drop-ball -e my_engine:MyEngine --dt 0.008 --dt 0.004 --dt 0.002 --baseline dropspin-baseline.toml"
        assert f"Reproduce: {command} -o out/again" in first
        assert (output.count("✗"), output.count("Reproduce: "), output.count("dropspin accept")) == (1, 1, 1)
        assert "worse, moved or gone. Attributed to the engine: my-engine good → failing." in output
        assert f'If the changes are intended: dropspin accept out/failing {" ".join(BASELINE)} --reason "…"' in output
    if release == "crashing":
        assert f"drop-ball · {LABEL} · 0.008 s: crashed. its process was ended by SIGABRT" in output
        assert output.count("✗") == 1
        assert "If the changes are intended" not in output


def test_check_reads_by_default_the_baseline_that_accept_writes_by_default(repository, tmp_path):
    """And the output says whether there was one."""
    assert dropspin("check", "out/crashing", cwd=repository).stdout == dropspin("check", "out/crashing", *BASELINE, cwd=repository).stdout
    with_baseline = dropspin("check", "out/good", cwd=repository).stdout
    assert "Checked: the expectations of the scenes, and the accepted results in dropspin-baseline.toml." in with_baseline
    without = dropspin("check", repository / "out/crashing", "--summary", "summary.md", cwd=tmp_path)
    assert "Checked: the expectations of the scenes only, without a baseline." in without.stdout
    assert "without a baseline" in (tmp_path / "summary.md").read_text()
    left_out = dropspin("check", "out/crashing", "--no-baseline", cwd=repository)
    assert (left_out.returncode, left_out.stdout) == (without.returncode, without.stdout)


def test_accepted_results_that_a_run_does_not_cover_are_named(repository, tmp_path):
    """A scene that was removed leaves the check without a failure, unless the check is to be complete."""
    command = ("run", "drop-ball", "-e", ENGINE, "--dt", "0.008", "--dt", "0.004", "--dt", "0.002", "-o", tmp_path / "run")
    dropspin(*command, cwd=repository)
    done = dropspin("check", tmp_path / "run", *BASELINE, cwd=repository)
    assert done.returncode == 0
    words = r"\d+ accepted results are not covered by this run: spin-principal with my-engine\."
    assert re.search(words, " ".join(done.stdout.split()))
    files = "--junit", tmp_path / "junit.xml", "--summary", tmp_path / "summary.md"
    complete = dropspin("check", tmp_path / "run", *BASELINE, "--complete", *files, cwd=repository)
    assert [path.name for path in tmp_path.iterdir()] == ["run"]  # a file would say that all checks pass
    assert (complete.returncode, complete.stdout) == (2, done.stdout)
    assert re.search(f"{words} Run them, or leave out --complete", complete.stderr)
    assert dropspin("check", "out/good", *BASELINE, "--complete", cwd=repository).returncode == 0
    without = dropspin("check", tmp_path / "run", "--complete", cwd=tmp_path)
    assert (without.returncode, "--complete needs a baseline" in without.stderr) == (2, True)


@pytest.mark.extended
def test_run_that_the_default_baseline_does_not_cover_is_refused_with_the_remedy(repository, tmp_path):
    for extra, reason in ((), "none of the "), (("--quick",), "a quick run has too few starts"):
        dropspin("run", "fall-spin", "-e", "wang", "--dt", "0.01", *extra, "-o", tmp_path / "run", cwd=repository)
        done = dropspin("check", tmp_path / "run", cwd=repository)
        assert done.returncode == 2
        assert done.stderr.startswith(f"dropspin: dropspin-baseline.toml: {reason}")
        assert "With --no-baseline, only the expectations of the scenes are checked." in done.stderr
        assert dropspin("check", tmp_path / "run", "--no-baseline", cwd=repository).returncode == 0
    both = dropspin("check", tmp_path / "run", *BASELINE, "--no-baseline", cwd=repository)
    assert (both.returncode, "give only one of them" in both.stderr) == (2, True)


@pytest.mark.extended
def test_the_command_that_reproduces_a_failure_measures_the_same_value(repository, tmp_path):
    """It is one command and ends as the check did."""
    checked = dropspin("check", "out/failing", *BASELINE, "--json", "--junit", tmp_path / "j.xml", cwd=repository)
    [row] = [
        row
        for row in json.loads(checked.stdout)
        if row["kind"] == "baseline" and row["metric"] == "restitution_error" and row["dt"] == 0.004
    ]
    command = f"dropspin run drop-ball -e {ENGINE} --dt 0.004 --baseline dropspin-baseline.toml -o out/again"
    assert checked.returncode == 1
    assert command in (tmp_path / "j.xml").read_text()
    for name in ("my_engine.py", "dropspin-baseline.toml"):
        shutil.copy(repository / name, tmp_path)
    done = dropspin(*command.split()[1:], "--json", cwd=tmp_path, RELEASE="failing")
    assert done.returncode == 1
    [again] = [one for one in json.loads(done.stdout) if one["kind"] == "baseline" and one["metric"] == "restitution_error"]
    assert (again["value"], again["verdict"]) == (row["value"], "failed")


@pytest.mark.sample(1)
@pytest.mark.parametrize(("release", "code", "verdict"), [("good", 0, "accepted results hold."), ("failing", 1, "accepted results fail.")])
def test_a_run_is_checked_at_once_with_a_baseline(release, code, verdict, repository, tmp_path):
    """With the same words and the same exit code as a check; here of one of the accepted time steps."""
    command = ("run", "drop-ball", "-e", ENGINE, "--dt", "0.004", *BASELINE, "-o", tmp_path / "run")
    done = dropspin(*command, cwd=repository, RELEASE=release)
    assert done.returncode == code
    assert verdict in " ".join(done.stdout.split())
    assert (ET.parse(tmp_path / "run" / "junit.xml").find(".//failure") is not None) == bool(code)


@pytest.mark.extended
def test_a_run_of_which_nothing_was_accepted_is_kept(repository, tmp_path):
    """Bad input, but the run is not lost: it can be accepted."""
    command = ("run", "fall-spin", "-e", ENGINE, "--dt", "0.004", *BASELINE, "-o", tmp_path / "new")
    done = dropspin(*command, "--json", cwd=repository)
    assert done.returncode == 2
    assert "dropspin: dropspin-baseline.toml: none of the " in done.stderr
    assert f"The run is written: {tmp_path / 'new'}." in done.stderr
    assert {row["scene"] for row in json.loads(done.stdout)} == {"fall-spin"}
    shutil.copy(repository / "dropspin-baseline.toml", tmp_path / "b.toml")
    accepted = dropspin("accept", tmp_path / "new", "--baseline", tmp_path / "b.toml", "--reason", "new", cwd=repository)
    assert accepted.returncode == 0
    assert dropspin("check", tmp_path / "new", "--baseline", tmp_path / "b.toml", cwd=repository).returncode == 0


@pytest.mark.extended
def test_a_crash_cannot_be_accepted(repository, tmp_path):
    """What was accepted before stays, to the last byte; where no engine was measured, no file is written."""
    shutil.copy(repository / "dropspin-baseline.toml", tmp_path / "b.toml")
    done = dropspin("accept", "out/crashing", "--baseline", tmp_path / "b.toml", "--reason", "x", cwd=repository)
    assert done.returncode == 0
    assert "gone" not in done.stdout
    assert "3 engine runs broke down; the results accepted for them before stay in the baseline." in done.stdout
    assert (tmp_path / "b.toml").read_text() == (repository / "dropspin-baseline.toml").read_text()
    dropspin("run", "drop-ball", "-e", ENGINE, "--dt", "0.01", "-o", tmp_path / "dead", cwd=repository, RELEASE="crashing")
    done = dropspin("accept", tmp_path / "dead", "--baseline", tmp_path / "none.toml", "--reason", "x", cwd=repository)
    assert done.returncode == 2
    assert "there is nothing to accept, because no engine was measured; " in done.stderr
    assert not (tmp_path / "none.toml").exists()


@pytest.mark.extended
@pytest.mark.parametrize("fault", ["raise RuntimeError('no')", "import no_such_library"], ids=["broken", "missing"])
def test_summary_counts_an_engine_that_could_not_be_used(fault, tmp_path):
    (tmp_path / "my_engine.py").write_text(fault)
    (tmp_path / "spin.toml").write_text('duration = 0.1\n[body]\nshape = "sphere"\nradius = 0.1\nmass = 1.0\n')
    assert dropspin("run", "spin.toml", "-e", ENGINE, "-e", "wang", "--dt", "0.01", "-o", "out", cwd=tmp_path).returncode == 3
    assert dropspin("check", "out", "--summary", "summary.md", cwd=tmp_path).returncode == 3
    rows = [line.split("|")[1:-1] for line in (tmp_path / "summary.md").read_text().splitlines() if line.startswith("| ")]
    assert [cell.strip() for cell in rows[0]] == ["engine", "passed", "failed", "known", "limited", "broke down or missing"]
    assert {row[0].strip().replace("\\", ""): int(row[-1]) for row in rows[1:]} == {ENGINE: 1, "wang": 0}


@pytest.mark.extended
def test_an_engine_that_can_no_longer_be_imported_loses_its_accepted_results(repository, junit_schema, tmp_path):
    """CI learns of it in every form."""
    (tmp_path / "my_engine.py").write_text("import no_such_library")
    done = dropspin(*RUN, "-o", "out", cwd=tmp_path)
    assert done.returncode == 3
    shutil.copy(repository / "dropspin-baseline.toml", tmp_path)
    done = dropspin("check", "out", *BASELINE, "--junit", "junit.xml", "--summary", "summary.md", cwd=tmp_path)
    assert done.returncode == 3
    assert "✗ spin-principal · my_engine:MyEngine · 0.008 s: missing. my_engine:MyEngine needs the module no_such_library" in done.stdout
    assert "66 of 66 accepted results fail." in done.stdout
    junit_schema.validate(tmp_path / "junit.xml")
    assert (tmp_path / "summary.md").read_text().startswith("## dropspin: ✗")


def expecting(metric):
    harsh = {"metric": metric, "below": 1e-12, "reason": "none is that exact"}
    return load(load("drop-ball").model_dump(exclude={"expect"}, exclude_none=True) | {"expect": [harsh]})


@pytest.mark.parametrize(
    ("metric", "accepted", "outcome"),
    [
        ("penetration", [], ["1 known failure is not counted as failed.", "All 15 accepted results hold."]),
        (
            "energy_error_raw",
            ["1 failing check has no comparable result and cannot be accepted."],
            ["1 of 1 check fails. All 15 accepted results hold."],
        ),
    ],
)
def test_known_failures_are_counted_apart(metric, accepted, outcome):
    """Neither hidden, nor promised where a failure has no result that can be compared."""
    found = run(expecting(metric), "mujoco", 4e-3)
    base, change = accept(found, Baseline(), "known", datetime.date(2026, 3, 1), known_failures=True)
    assert accepted_sentences(found, change, known_failures=True)[1:] == accepted
    assert sentences(check(found, base), "out", "b.toml") == outcome


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["check", "absent"], "absent: not the folder of a run"),
        (["check", "out/good", "--baseline", "absent.toml"], "absent.toml: No such file or directory"),
        (["check", "out/good", "--baseline", "my_engine.py"], "my_engine.py: not TOML"),
        (["check", "out/good", "--baseline", "out"], "out: is a directory; a baseline is one file"),
        (["check", "out/good", "--junit", "my_engine.py/x"], "my_engine.py"),
        (["accept", "out/good"], "Missing option '--reason'"),
        (["accept", "out/good", "--reason", " "], "--reason is empty; give the reason why these results are accepted."),
        (["accept", "out/good", "--reason", "a\nb"], "is not printable text of at most 4096 characters."),
        (["accept", "--reason", "x"], "Missing argument 'RUN...'"),
        (["accept", "out/good", "--reason", "x", "--baseline", "my_engine.py"], "my_engine.py: not TOML"),
        (["accept", "out/good", "--reason", "x", "--baseline", "my_engine.py/b.toml"], "my_engine.py/b.toml: cannot be written"),
        (["compare", "out/good"], "Missing argument 'NEW'"),
        (["compare", "out/good", "absent"], "absent: not the folder of a run"),
        (["compare", "out/good", "out/good", "--fail-speed", "20%"], "No such option"),
        (["compare", "history", "out/good"], "a history needs two or more runs, got 1; give more, or a folder of runs."),
        (["compare", "history", "absent"], "absent: neither a run nor a folder of runs; "),
    ],
    ids=lambda case: " ".join(case) if isinstance(case, list) else "",
)
def test_bad_usage_writes_nothing(arguments, message, repository, tmp_path):
    """Exit code 2, one reason, no traceback; in a copy, because unfinished files of another worker's command may be in the repository."""
    own = shutil.copytree(repository, tmp_path / "repository")
    before = sorted(own.rglob("*"))
    done = dropspin(*arguments, cwd=own)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.replace("│", " ").split())
    assert "Traceback" not in done.stderr + done.stdout
    assert sorted(own.rglob("*")) == before


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("run.json", b'{"provenance": {}}', "has a format of another version of dropspin, which this version cannot read"),
        ("run.json", b"[]", "has a format of another version of dropspin, which this version cannot read"),
        ("run.json", b"{", "not the folder of a run"),
        ("run.json", b"\xff\xfe", "not the folder of a run"),
        ("results.parquet", b"PAR1", "not the folder of a run"),
        ("results.parquet", None, "not the folder of a run"),
    ],
)
def test_a_folder_that_is_not_a_run_is_refused(file, content, message, repository, tmp_path):
    """Older, cut off, or of something else: one line that says so."""
    shutil.copytree(repository / "out/good", tmp_path / "run")
    (tmp_path / "run" / file).unlink()
    if content is not None:
        (tmp_path / "run" / file).write_bytes(content)
    done = dropspin("check", "run", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert message in done.stderr
    assert done.stderr.count("\n") == 1


def test_junit_replaces_characters_that_xml_lacks(junit_schema, tmp_path):
    """A scene may have any name that a file may have."""
    named = expecting("penetration").model_copy(update={"name": "ctl\x01\x0c"})
    (tmp_path / "junit.xml").write_bytes(junit_xml(run(named, "mujoco", 1e-2)))
    junit_schema.validate(tmp_path / "junit.xml")
