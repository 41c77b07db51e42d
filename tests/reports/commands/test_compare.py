"""`dropspin compare` and `dropspin compare history`."""

import json
import re
from pathlib import Path

import pytest
from support.cli import dropspin

GATE = Path(__file__).parents[3] / "docs" / "gate.md"


def test_compare_says_what_got_worse_and_why(repository, tmp_path):
    """The change and what it is attributed to; the same in Markdown and in JSON; no change between a run and itself."""
    done = dropspin("compare", "out/good", "out/failing", "--summary", tmp_path / "summary.md", cwd=repository)
    assert done.returncode == 1
    output = " ".join(done.stdout.split())
    assert "Attributed to the engine: my-engine good → failing, its settings (restitution)." in output
    assert re.search(r"Worse: \d+ results scene engine .* drop-ball my-engine restitution error \d ms \S+ 5\.00e-03 ", output)
    headings = re.findall(r"^(?:Worse|Gone|Moved|Better|Undefined|New): ", done.stdout, re.MULTILINE)
    assert len(re.findall(r"(?m)^drop-ball +my-engine ", done.stdout)) == len(headings) > 0  # one row for each kind of change
    assert output.count("Reproduce: dropspin run drop-ball -e my_engine:MyEngine --dt 0.008 --dt 0.004 --dt 0.002 -o out/again") == 1
    assert "| drop-ball | my-engine | restitution error |" in (tmp_path / "summary.md").read_text()
    data = json.loads(dropspin("compare", "out/good", "out/failing", "--json", cwd=repository).stdout)
    assert data["attributed_to"]["my-engine"]["origin"] == "engine"
    assert {result["scene"] for result in data["results"]} == {"drop-ball"}
    same = dropspin("compare", "out/good", "out/good", cwd=repository)
    assert same.returncode == 0
    assert same.stdout.splitlines()[-1].startswith("None of ")


@pytest.mark.extended
def test_history_finds_the_run_in_which_results_moved(repository, tmp_path):
    """The run, what the move is attributed to, a table and a plot for each scene."""
    done = dropspin("compare", "history", "out", "-o", tmp_path / "history", cwd=repository)
    assert done.returncode == 0, done.stderr
    assert "changed from good to failing. Attributed to the engine" in " ".join(done.stdout.split())
    names = {path.name for path in (tmp_path / "history").iterdir()}
    assert names == {"history.csv", "history.json", "history.md", "drop-ball.svg", "spin-principal.svg"}
    rows = json.loads((tmp_path / "history/history.json").read_text())
    assert {row["run"] for row in rows} == {"good", "failing", "crashing"}
    assert "![drop-ball](drop-ball.svg)" in (tmp_path / "history/history.md").read_text().splitlines()


@pytest.mark.extended
def test_the_python_of_the_documentation_runs(tmp_path, monkeypatch):
    """In an empty folder: it writes a baseline into the working directory."""
    monkeypatch.chdir(tmp_path)
    [block] = re.findall(r"^```python\n(.*?)^```", GATE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    names: dict[str, object] = {}
    exec(block, names)
    assert set(names["changes"].results["change"]) == {"same"}
    assert (tmp_path / "dropspin-baseline.toml").exists()
