"""`dropspin reproduce`."""

import json

import pytest
from support.cli import TERMINAL, assert_refused, dropspin

from dropspin.comparisons.published import study
from dropspin.comparisons.published.results import Result


def test_table_notes_and_files(tmp_path):
    """At 80 columns; the section is part of a report."""
    done = dropspin("reproduce", "fmi-bouncing-ball", "nesc-brick", cwd=tmp_path, **TERMINAL)
    assert done.returncode == 0, done.stderr
    lines = [line.rstrip() for line in done.stdout.splitlines()]
    assert max(map(len, lines)) <= 80
    [row] = [line for line in lines if "0.9514405000000001" in line]
    assert row.split() == ["-", "height", "at", "0.1", "s", "0.9514405000000001", "0.9514405000000001", "reproduced"]
    [row] = [line for line in lines if "-5.254456882280352" in line]
    assert row.split()[-4:] == ["-5.254456882280352", "-5.253216650960", "error", "-1.2e-03"]
    assert "FMU, wang: the simulation starts with the velocity that the ball had one time" in lines
    assert lines[-2:] == ["6 of 6 values are reproduced; 0 differ.", "Written: out/reproduce/reproduce.md"]
    folder = tmp_path / "out/reproduce"
    assert {path.name for path in folder.iterdir()} == {"section.json", *(f"reproduce.{kind}" for kind in ("csv", "json", "md"))}
    assert "| - height at 0.1 s | 0.9514405000000001 | 0.9514405000000001 | reproduced |" in (folder / "reproduce.md").read_text()
    assert dropspin("run", "spin-principal", "-e", "wang", "--dt", "0.01", "-o", "run", cwd=tmp_path).returncode == 0
    assert dropspin("report", "run", "--add", "out/reproduce", cwd=tmp_path).returncode == 0
    assert "Published results" in (tmp_path / "run/report.html").read_text()


def test_json_has_every_value(tmp_path):
    done = dropspin("reproduce", "housner-block", "--json", cwd=tmp_path)
    rows = json.loads(done.stdout)
    assert [row["status"] for row in rows] == 5 * ["reproduced"] + 2 * ["error of the source"]
    assert rows[0] == {
        "source": "housner-block",
        "tool": "restitution",
        "quantity": "r, tan α = 0.5",
        "published": "0.490000000000",
        "here": "0.490000000000",
        "by": "exact solution",
        "status": "reproduced",
        "reason": "",
        "difference": pytest.approx(0.0, abs=1e-12),
        "verdict": "",
    }


@pytest.mark.parametrize(
    ("names", "status", "verdict", "code", "words"),
    [
        ((), "differs", "", 1, "0 of 1 value is reproduced; 1 differs."),
        ((), "not run", "crashed", 3, "0 of 0 values are reproduced; 0 differ; 1 was not run."),
        ((), "not run", "missing", 0, "0 of 0 values are reproduced; 0 differ; 1 was not run."),
        (("nesc-brick",), "not run", "missing", 3, "0 of 0 values are reproduced; 0 differ; 1 was not run."),
    ],
)
def test_exit_codes(names, status, verdict, code, words, tmp_path, monkeypatch):
    result = Result("nesc-brick", "tool", "quantity", "1.0", "1.1", "engine", status, "a reason.", 0.1, verdict)
    monkeypatch.setattr(study, "reproduce", lambda names, **options: [result])
    done = dropspin("reproduce", *names, cwd=tmp_path)
    assert done.returncode == code
    assert words in done.stdout
    assert f"tool, engine: {status}: a reason." in done.stdout
    assert ("differs by 1.0e-01" in done.stdout) == (status == "differs")


def test_an_unknown_source_is_refused(tmp_path):
    assert_refused(dropspin("reproduce", "nesc-brik", cwd=tmp_path), "source 'nesc-brik' is unknown. Did you mean 'nesc-brick'?")
    assert not (tmp_path / "out").exists()
