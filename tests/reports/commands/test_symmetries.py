"""`dropspin symmetries`."""

import json

import pytest
from support.cli import dropspin

from dropspin.comparisons.measuring.symmetries import NAMES


def test_table_sentences_and_files(tmp_path):
    """An engine that keeps every symmetry, one that loses some, and one that declines the scene; the section is part of a report."""
    asked = ("symmetries", "slide-box", "--dt", "0.004", "-e", "wang", "-e", "mujoco[profile=default]", "-e", "wang[law=coulomb]")
    done = dropspin(*asked, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].split() == ["the", "scene", "wang", "mujoco[profile=default]", "wang[law=coulomb]"]
    table = {name: next(line for line in lines if line.startswith(name))[len(name) :].split() for name in ("turned by 1 rad", "again")}
    assert table["turned by 1 rad"][:3] == ["–", "✗", "1e+00"]
    assert table["turned by 1 rad"][3] == "✓"
    assert table["again"] == ["–", "✓", "0", "✓", "0"]
    lost = "mujoco[profile=default], turned by 1 rad: in slide-box, the two motions differ from step "
    assert any(line.startswith(lost) for line in lines)
    assert any(line.startswith("Not run: wang in slide-box: law=note has no Coulomb coefficient") for line in lines)
    assert "✓ kept up to rounding" in done.stdout
    assert lines[-2:] == [
        "Written: out/symmetries/symmetries.md",
        "Replay of the worst lost symmetry of each engine: out/symmetries/symmetries.html",
    ]
    folder = tmp_path / "out/symmetries"
    assert {path.name for path in folder.iterdir()} == {"section.json", *(f"symmetries.{kind}" for kind in ("csv", "html", "json", "md"))}
    assert "mujoco[profile=default], " in (folder / "symmetries.html").read_text()
    rows = json.loads((folder / "symmetries.json").read_text())
    assert {row["symmetry"] for row in rows if not row["symmetry"].startswith("with ")} <= set(NAMES)
    [turned] = [row for row in rows if row["engine"].startswith("mujoco") and row["symmetry"] == "turned by 1 rad"]
    assert turned["status"] == "lost"
    assert turned["time"] == pytest.approx(0.004 * turned["step"])
    assert dropspin("run", "drop-ball", "-e", "wang", "--dt", "0.01", "-o", "run", cwd=tmp_path).returncode == 0
    assert dropspin("report", "run", "--add", "out/symmetries", cwd=tmp_path).returncode == 0
    assert "Symmetries and repeated runs" in (tmp_path / "run/report.html").read_text()


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (["drop-bal"], "Did you mean 'drop-ball'"),
        (["drop-ball", "drop-ball"], "two scenes have the same name"),
        (["drop-ball", "-e", "mujocoo"], "engine 'mujocoo' is unknown."),
        (["drop-ball", "--dt", "7"], "dt: got 7.0 s"),
    ],
)
def test_bad_input_is_refused(asked, message, tmp_path):
    done = dropspin("symmetries", *asked, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert not (tmp_path / "out").exists()
