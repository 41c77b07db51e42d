"""Corrections of dropspin: a result that moved while the engine's motions are the same is no change of the engine."""

import re
from dataclasses import replace

import pytest
from support.releases import SCENES, TODAY, Candidate, TooLively, failing, relabelled

from dropspin.comparisons.measuring.metrics import METRICS, metrics_for
from dropspin.comparisons.regressions.attribution import CORRECTION, attribute
from dropspin.comparisons.regressions.baseline import Baseline, load_baseline, write_baseline
from dropspin.comparisons.regressions.changes import digests_of
from dropspin.comparisons.regressions.checking import accept, check
from dropspin.comparisons.regressions.comparing import compare
from dropspin.comparisons.running import start_phases
from dropspin.comparisons.running.run import run
from dropspin.reports.stories.check import sentences

BALL = SCENES[0]
STEPS = [8e-3, 4e-3, 2e-3]


def corrected(monkeypatch):
    """Another definition of a metric, as by a later version of dropspin."""
    metric = METRICS["bounce_height_error"]
    changed = replace(metric, measure=lambda case: metric.measure(case) + 0.01)
    monkeypatch.setitem(METRICS, "bounce_height_error", changed)
    monkeypatch.setattr(start_phases, "metrics_for", metrics_for.__wrapped__)  # which remembers the metrics of a scene


def stamped(results, **changes):
    return replace(results, provenance=results.provenance | changes)


@pytest.fixture(scope="module")
def earlier():
    """A run by an earlier version, with other code."""
    found = run(BALL, Candidate(), STEPS)
    return stamped(found, code="0123456789ab", versions=found.provenance["versions"] | {"dropspin": "0.0.9"})


@pytest.fixture(scope="module")
def accepted(earlier, tmp_path_factory):
    """Its results, accepted, written and read again."""
    path = tmp_path_factory.mktemp("baseline") / "accepted.toml"
    write_baseline(accept(earlier, Baseline(), "first measured", TODAY)[0], path)
    return load_baseline(path)


def said(checked, baseline):
    return " ".join(sentences(checked, "out/run", "accepted.toml"))


def test_changed_metric_with_the_same_motions_is_a_correction_of_dropspin(accepted, monkeypatch):
    """It still fails, until it is accepted again; each failing row and the summary name dropspin."""
    corrected(monkeypatch)
    checked = check(run(BALL, Candidate(), STEPS), accepted)
    failed = failing(checked)
    assert set(failed["metric"]) == {"bounce_height_error"}
    assert checked.results.exit_code() == 1
    assert failed["reason"].str.endswith(f"times its tolerance; {CORRECTION}").all()
    [cause] = {cause for _, cause in checked.attributions}
    assert cause.origin == "dropspin"
    assert re.search(
        r"candidate: \d+ results are worse, moved or gone\. A correction of dropspin, not a change of the engine, "
        r"whose motions are the same bit for bit: dropspin 0\.0\.9 → \S+, dropspin's own code\.",
        said(checked, accepted),
    )


@pytest.mark.extended
def test_changed_metric_does_not_excuse_a_changed_engine(accepted, monkeypatch):
    """Its version and adapter are the same, but its motions are others."""
    corrected(monkeypatch)
    found = relabelled(run(BALL, TooLively(), STEPS), "too-lively", "candidate")
    found = stamped(found, adapters={"candidate": accepted.acceptances[next(iter(accepted.acceptances))].adapters["candidate"]})
    checked = check(found, accepted)
    failed = failing(checked)
    assert {"bounce_height_error", "restitution_error"} <= set(failed["metric"])
    assert not failed["reason"].str.contains(CORRECTION).any()
    assert {cause.origin for _, cause in checked.attributions} == {"either"}
    assert "the motions of candidate differ too" in said(checked, accepted)
    assert CORRECTION not in said(checked, accepted)


@pytest.mark.extended
def test_results_of_changed_motions_are_no_corrections_beside_those_of_the_same_motions(accepted, monkeypatch):
    """The results at a time step whose motions are the same are corrections; those at another are not."""
    corrected(monkeypatch)
    found = run(BALL, Candidate(), STEPS)
    motions = {BALL.name: {"candidate": {**found.provenance["motions"][BALL.name]["candidate"], "0.008": "00000000"}}}
    failed = failing(check(stamped(found, motions=motions), accepted)).set_index("dt")["reason"].str.endswith(CORRECTION)
    assert dict(failed.dropna()[[0.004, 0.002]]) == {0.004: True, 0.002: True}
    assert not failed[0.008]


@pytest.mark.extended
def test_baseline_without_hashes_is_compared_by_its_versions(accepted, monkeypatch):
    """As written by versions that recorded none: without those of the motions no cause can be isolated, and the sentence says so."""
    corrected(monkeypatch)
    plain = {key: one.model_copy(update={"code": None, "adapters": {}}) for key, one in accepted.acceptances.items()}
    old = replace(accepted, acceptances=plain, motions={})
    checked = check(run(BALL, Candidate(), STEPS), old)
    assert {cause.origin for _, cause in checked.attributions} == {"either"}
    text = said(checked, old)
    assert "the cause cannot be isolated, because it is not recorded whether the motions of candidate differ" in text
    assert "dropspin's own code" not in text
    newer = check(stamped(run(BALL, Candidate(), STEPS), settings=with_version("1.1")), old)
    assert {cause.origin for _, cause in newer.attributions} == {"either"}


def with_version(version):
    return {"candidate": {"drop-ball dt=0.008": {"version": version}}}


@pytest.mark.extended
def test_compare_uses_the_same_motions(earlier, monkeypatch):
    corrected(monkeypatch)
    found = compare(earlier, run(BALL, Candidate(), STEPS))
    assert found.attributions["candidate"].origin == "dropspin"
    assert "whose motions are the same bit for bit" in found.attributions["candidate"].message


@pytest.mark.extended
def test_hashes_belong_to_the_acceptance_of_a_result(accepted, tmp_path):
    """A result that is replaced has the hash of its new motions; one that stays has that of the motions from which it was measured."""
    lively = relabelled(run(BALL, TooLively(), STEPS), "too-lively", "candidate")
    later = accept(lively, accepted, "livelier", TODAY)[0]
    [first], [second] = accepted.acceptances, later.acceptances.keys() - accepted.acceptances.keys()
    assert set(later.results["by"]) == {first, second}
    assert later.motions == {first: accepted.motions[first], second: digests_of(lively.provenance)}
    write_baseline(later, tmp_path / "accepted.toml")
    assert load_baseline(tmp_path / "accepted.toml").motions == later.motions


@pytest.mark.parametrize(
    ("engine", "adapter", "motions", "origin"),
    [
        ("pybullet", "a", "same", "dropspin"),
        ("pybullet", "b", "different", "dropspin"),  # its adapter is a part of dropspin
        ("pybullet", "a", "different", "either"),
        ("wang", "a", "different", "dropspin"),  # it is a part of dropspin itself
        ("mine", "b", "different", "either"),
        ("mine", "b", "same", "dropspin"),
    ],
)
def test_motions_decide_what_a_change_of_dropspin_explains(engine, adapter, motions, origin):
    stamp = {"versions": {"dropspin": "1"}, "python": "3.11", "cpu": "A", "platform": "Linux", "code": "c"}
    stamp |= {"adapters": {engine: "a"}, "settings": {engine: {"at": {"version": "1.0"}}}}
    later = stamp | {"versions": {"dropspin": "2"}, "code": "d", "adapters": {engine: adapter}}
    assert attribute(stamp, later, engine, [], motions).origin == origin


def test_changed_motions_of_an_engine_that_is_part_of_dropspin_are_no_correction():
    stamp = {"versions": {"dropspin": "1"}, "python": "3.11", "cpu": "A", "platform": "Linux", "code": "c", "adapters": {}}
    stamp |= {"settings": {"wang": {"at": {"version": "1.0"}}}}
    found = {motions: attribute(stamp, stamp | {"code": "d"}, "wang", [], motions).is_correction for motions in ("same", "different")}
    assert found == {"same": True, "different": False}
