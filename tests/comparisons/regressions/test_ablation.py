"""Settings that changed since results were accepted: the one that explains the change is named."""

import datetime
from dataclasses import replace

import pytest

from dropspin.comparisons.engines import pybullet_settings
from dropspin.comparisons.regressions import ablation
from dropspin.comparisons.regressions.ablation import with_explaining_settings
from dropspin.comparisons.regressions.baseline import Baseline, load_baseline, write_baseline
from dropspin.comparisons.regressions.checking import accept, check
from dropspin.comparisons.running.run import run
from dropspin.reports.stories.failures import settings_that_explain
from dropspin.scenarios import load


@pytest.mark.extended
def test_check_names_the_setting_of_the_adapter_that_changed_its_results(monkeypatch, tmp_path):
    """Of two settings whose calibrated values change, that which moves the rebound; the baseline keeps the accepted values."""
    ball = load("drop-ball").model_copy(update={"duration": 0.8})
    accepted, _ = accept(run(ball, ["pybullet", "mujoco"], 4e-3), Baseline(), "first", datetime.date(2026, 3, 1))
    write_baseline(accepted, tmp_path / "baseline.toml")
    accepted = load_baseline(tmp_path / "baseline.toml")
    again = run(ball, ["pybullet", "mujoco"], 4e-3)
    assert with_explaining_settings(check(again, accepted), accepted, imports=True).results.table.equals(
        check(again, accepted).results.table
    )
    for name, value in (("contactERP", 0.3), ("numSolverIterations", 400)):
        monkeypatch.setitem(pybullet_settings.WORLD, name, pybullet_settings.WORLD[name]._replace(calibrated=value))
    changed = run(ball, ["pybullet", "mujoco"], 4e-3)
    checked = check(changed, accepted)
    [(engine, cause)] = checked.attributions
    assert (engine, cause.origin) == ("pybullet", "settings")
    assert "contactERP, numSolverIterations" in cause.message or "numSolverIterations, contactERP" in cause.message
    rows = with_explaining_settings(checked, accepted, imports=False).results.table.query("kind == 'setting'")
    assert dict(zip(rows["truth"], rows["value"], strict=True)) == {"contactERP=0.3": pytest.approx(1.0, abs=1e-6)}
    [sentence] = settings_that_explain(with_explaining_settings(checked, accepted, imports=False).results, "pybullet")
    assert sentence.startswith("drop-ball: contactERP=0.3 explains 100 % of the ")
    named = replace(checked.results, provenance=checked.results.provenance | {"names": {"pybullet": "not_imported:Engine"}})
    monkeypatch.setattr(ablation, "engine_entry", lambda name: pytest.fail(f"imported {name}"))
    assert with_explaining_settings(replace(checked, results=named), accepted, imports=False).results.table.equals(named.table)


def test_changed_setting_that_takes_none_of_a_change_away_explains_nothing():
    """The impedance of contacts changed, which moves the rebound little, and the error by something else."""
    ball = load("drop-ball").model_copy(update={"duration": 0.8})
    found = run(ball, "mujoco", 4e-3)
    accepted, _ = accept(found, Baseline(), "first", datetime.date(2026, 3, 1))
    [(key, acceptance)] = accepted.acceptances.items()
    settings = {"mujoco": acceptance.settings["mujoco"] | {"solimp": "0.99989 0.99989 0.001 0.5 2"}}
    smaller = accepted.results["value"].where(accepted.results["metric"] != "energy_error", 0.0)
    results = accepted.results.assign(value=smaller)
    lower = replace(accepted, acceptances={key: acceptance.model_copy(update={"settings": settings})}, results=results)
    checked = check(found, lower)
    [(_, cause)] = checked.attributions
    assert "solimp" in cause.message
    assert with_explaining_settings(checked, lower, imports=True).results.table.query("kind == 'setting'").empty


def test_setting_that_is_reported_in_other_words_than_its_option_has_explains_nothing():
    """Such as the number of a word in an enumeration."""
    ball = load("drop-ball").model_copy(update={"duration": 0.8})
    found = run(ball, "mujoco", 4e-3)
    accepted, _ = accept(found, Baseline(), "first", datetime.date(2026, 3, 1))
    cases = {case: settings | {"cone": 7} for case, settings in found.provenance["settings"]["mujoco"].items()}
    table = found.table.assign(value=found.table["value"].mask(found.table["metric"] == "energy_error", 0.5))
    worse = replace(found, table=table, provenance=found.provenance | {"settings": {"mujoco": cases}})
    checked = check(worse, accepted)
    [(_, cause)] = checked.attributions
    assert "cone" in cause.message
    assert with_explaining_settings(checked, accepted, imports=True).results.table.equals(checked.results.table)
