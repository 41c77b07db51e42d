"""The engine `wang` was called `document` in earlier versions; that name is accepted and read everywhere."""

import pytest

import dropspin as ds
from dropspin.comparisons.regressions.baseline import load_baseline

BASELINE = """format = 3
accepted.abcdef0 = {date = 2026-01-01, reason = "first measured", versions = {dropspin = "0.1.0"}}
scenes.drop-ball = "0123456789ab"
results.drop-ball."document[rotation=rk4]"."0.004".energy_drift = {value = 0.0, tolerance = 1e-9, by = "abcdef0"}
"""


def test_option_of_a_command_or_a_function():
    assert ds.engine("document").label == "wang"
    assert ds.engine("document[rotation=rk4]").label == "wang[rotation=rk4]"


def test_expectation_of_a_scene():
    own = {"metric": "energy_error", "engine": "document[rotation=rk4]", "below": 1.0, "reason": "why"}
    scene = ds.load(ds.load("spin-asymmetric").model_dump(exclude={"expect"}, exclude_none=True) | {"expect": [own]})
    assert scene.expect[0].engine == "wang[rotation=rk4]"


def test_baseline(tmp_path):
    (tmp_path / "accepted.toml").write_text(BASELINE)
    assert set(load_baseline(tmp_path / "accepted.toml").results["engine"]) == {"wang[rotation=rk4]"}


def test_baseline_with_both_names_is_refused(tmp_path):
    """As after a merge of two branches."""
    lines = BASELINE.splitlines(keepends=True)
    (tmp_path / "accepted.toml").write_text("".join([*lines, lines[-1].replace("document", "wang")]))
    with pytest.raises(ds.DropspinError, match="results of drop-ball: an engine is listed by two names"):
        load_baseline(tmp_path / "accepted.toml")


def test_an_adapter_cannot_take_the_name(tmp_path, monkeypatch):
    (tmp_path / "takes_a_name.py").write_text("import dropspin as ds\n\n\nclass Mine(ds.Engine):\n    name = 'document'\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ds.DropspinError, match="which is a built-in engine"):
        ds.engine("takes_a_name:Mine")
