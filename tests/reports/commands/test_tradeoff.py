"""`dropspin tradeoff`."""

import json

from support.cli import dropspin

SCENE = """
duration = 0.5
[body]
shape = "box"
half_extents = [0.1, 0.2, 0.3]
mass = 2.0
[start]
angular_velocity = [1.0, 5.0, 0.5]
"""


def test_pareto_front_recommendations_and_files(tmp_path):
    (tmp_path / "short.toml").write_text(SCENE)
    asked = ("tradeoff", "short.toml", "-e", "document[rotation=rk4]", "-e", "document[rotation=exact]", "-e", "document")
    done = dropspin(*asked, "--within", "1e-9", "--within", "1e-30", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    output = " ".join(done.stdout.split())
    assert "orientation error within 1e-09 rad: document[rotation=" in output
    assert "within 1e-30 rad: no tested configuration reaches it; the most accurate is document[rotation=" in output
    assert "Left out: document, it does not converge: orientation error stays at" in output
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "section.json",
        "short.svg",
        "tradeoff.csv",
        "tradeoff.json",
        "tradeoff.md",
    ]
    rows = json.loads((tmp_path / "out" / "tradeoff.json").read_text())
    assert {row["engine"] for row in rows} == {"document[rotation=rk4]", "document[rotation=exact]"}
    assert all(row["cost_best"] <= row["cost"] for row in rows)
    assert any(row["on_pareto_front"] for row in rows)
    assert all(row["cost_per_world"] > 0.0 for row in rows)


def test_a_scene_without_an_exact_solution_is_refused(tmp_path):
    tumbling = "[start]\nposition = [0.0, 1.0, 0.0]\norientation = [0.1, 0.2, 0.3, 0.9]\nangular_velocity = [1.0, 2.0, 3.0]\n"
    floor = "[gravity]\nacceleration = [0.0, -9.81, 0.0]\n[floor]\nrestitution = 0.6\nfriction = 0.3\n"
    (tmp_path / "mine.toml").write_text(SCENE.partition("[start]")[0] + tumbling + floor)
    done = dropspin("tradeoff", "mine.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "mine has no exact solution to compare with" in done.stderr
    assert list(tmp_path.iterdir()) == [tmp_path / "mine.toml"]
