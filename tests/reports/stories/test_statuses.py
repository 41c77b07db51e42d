"""One status for each engine in each scene, and known faults in every count."""

import numpy as np
import pytest
from support import engines as made

import dropspin as ds
from dropspin.comparisons.judging.verdicts import OUTCOMES, VERDICTS
from dropspin.reports.junit import junit_xml
from dropspin.reports.stories.matrix import GLOSSARY
from dropspin.reports.stories.run import overview


@pytest.fixture(scope="module")
def core(core_run):
    return ds.load_results(core_run, arrays=False)


@pytest.mark.parametrize(
    ("scene", "engine", "verdict", "reason", "words"),
    [
        ("spin-asymmetric", "wang", "known", "model error", "known fault (model error)"),
        ("spin-principal-500", "wang", "known", "", "known fault"),
        ("spin-asymmetric", "mujoco", "passed", "", "passed"),
        ("slide-box", "wang", "declined", "declined", "not judged (declined)"),
        ("slide-box", "mujoco", "limited", "limited", "not judged (limited)"),
    ],
)
def test_engine_has_one_status_in_a_scene(core, scene, engine, verdict, reason, words):
    status = overview(core).statuses[scene][engine]
    assert (*status, status.words) == (verdict, reason, words)


def test_every_verdict_has_an_outcome_of_the_glossary():
    assert {verdict: OUTCOMES[verdict][0] for verdict in VERDICTS}.keys() == OUTCOMES.keys()
    assert {outcome for outcome, _ in OUTCOMES.values()} == GLOSSARY.keys()


def test_failure_is_the_status_of_its_scene():
    results = ds.run("spin-principal", made.engine_with("drifting", made.turned_by(0.1)))
    assert overview(results).statuses["spin-principal"]["drifting"] == ("failed", "")


def test_run_in_which_nothing_was_simulated_says_so():
    class Declining(made.Exact):
        name = "declining"

        def declines(self, scene):
            return "no"

    assert overview(ds.run("spin-principal", Declining())).verdict == "No check was made, because no scene was simulated."


def test_error_that_overflows_is_reported(tmp_path):
    """Finite states, whose energy is infinite."""
    faster = np.repeat([1.0, 1e200], [10, 3])
    results = ds.run("spin-principal", made.engine_with("fast", lambda state, time: state * faster))
    assert any("largest error: energy inf % at dt = 1 ms in spin-principal" in sentence for sentence in overview(results).findings)
    assert ds.write_report(results, tmp_path / "run").is_file()


def test_known_faults_are_counted_apart_and_in_the_headline(core):
    """They are neither passed nor failed; in JUnit they are skipped, with the reason. Negligible ones are not in the headline."""
    judged = core.table[core.table["verdict"] == "known"]
    known = judged[judged["value"].abs() > 1e-4]
    summary = overview(core)
    assert len(judged) > len(summary.counts.known) == len(known) > 100
    assert summary.counts.passed == (core.table["verdict"] == "passed").sum()
    assert f"{len(known)} values are known faults: wang in {known['scene'].nunique()} scenes" in summary.verdict
    [sentence] = [one for one in summary.findings if one.startswith("wang (Wang's method): ")]
    faults = sum(by_engine["wang"].outcome == "known fault" for by_engine in summary.statuses.values())
    assert faults > 0
    assert f"known fault in {faults}" in sentence
    assert junit_xml(core).decode().count("known fault: ") == len(judged)
