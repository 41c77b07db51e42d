"""Changes are attributed to the engine, its adapter, its settings, or the surroundings."""

import pytest

from dropspin.comparisons.regressions.attribution import ACCEPTED, attribute, changed_settings
from dropspin.comparisons.regressions.baseline import Acceptance

STAMP = {
    "versions": {"dropspin": "1", "numpy": "2", "numba": "3", "scipy": "4"},
    "python": "3.11.7",
    "cpu": "A",
    "platform": "Linux",
    "code": "c",
    "adapters": {"candidate": "a"},
    "names": {"candidate": "old:Ball"},
    "settings": {"candidate": {"drop-ball dt=0.001": {"version": "1.0", "solref": 1}}},
}


def settings(version, solref):
    return {"settings": {"candidate": {"drop-ball dt=0.001": {"version": version, "solref": solref}}}}


UNKNOWN = "the cause cannot be isolated, because it is not recorded whether the motions of candidate differ"

UNKNOWN_CHANGE = "no recorded property differs; the engine is not deterministic, or has changed without a new version"


@pytest.mark.parametrize(
    ("now", "unmoved", "origin", "message"),
    [
        (
            {},
            [],
            "nothing",
            UNKNOWN_CHANGE,
        ),
        (settings("1.1", 1), [], "engine", "attributed to the engine: candidate 1.0 → 1.1"),
        (settings("1.0", 2), [], "settings", "attributed to its settings: its settings (solref)"),
        (settings("1.1", 2), [], "engine", "attributed to the engine: candidate 1.0 → 1.1, its settings (solref)"),
        ({"adapters": {"candidate": "b"}}, [], "adapter", "attributed to its adapter: the code of candidate's adapter"),
        ({"names": {"candidate": "new:Half"}}, [], "adapter", "attributed to its adapter: old:Ball → new:Half"),
        ({"names": {"candidate": "a/old.py:Ball[x=1]"}}, [], "nothing", UNKNOWN_CHANGE),
        ({"names": {"candidate": "candidate"}}, [], "nothing", UNKNOWN_CHANGE),
        ({"cpu": "B"}, [], "surroundings", "attributed to the surroundings: processor A → B"),
        ({"code": "d"}, [], "either", f"dropspin's own code; {UNKNOWN}"),
        ({"versions": STAMP["versions"] | {"dropspin": "2"}}, [], "either", f"dropspin 1 → 2; {UNKNOWN}"),
        (
            {"code": "d", "adapters": {"candidate": "b"}},
            [],
            "either",
            "the code of candidate's adapter, dropspin's own code; "
            "the cause cannot be isolated, because the results of every engine changed",
        ),
        ({"versions": STAMP["versions"] | {"numpy": "2.1"}}, [], "surroundings", "attributed to the surroundings: numpy 2 → 2.1"),
        (
            {"cpu": "B"},
            ["other"],
            "nothing",
            "no recorded property of candidate differs; the engine is not deterministic, or has changed without a new version; "
            "processor A → B differ, but the results of other are the same",
        ),
        ({"cpu": "B", "code": "d"}, ["other"], "surroundings", "attributed to the surroundings: dropspin's own code"),
        (
            {"cpu": "B", "adapters": {"candidate": "b"}},
            ["other"],
            "adapter",
            "attributed to its adapter: the code of candidate's adapter; processor A → B differ too, but the results of other are the same",
        ),
        (
            {"cpu": "B", "adapters": {"candidate": "b"}},
            [],
            "either",
            "the code of candidate's adapter, processor A → B; the cause cannot be isolated, because the results of every engine changed",
        ),
        ({"settings": {}}, [], "absent", "it has no measurements in the later run: it broke down, declined, or is missing"),
    ],
)
def test_changes_are_attributed_to_what_differs(now, unmoved, origin, message):
    """The engine's version before its adapter before its settings; the surroundings unless an unmoved engine rules them out."""
    found = attribute(STAMP, STAMP | now, "candidate", unmoved)
    assert found.origin == origin
    assert found.message == message


@pytest.mark.parametrize(
    ("recorded", "unmoved", "message"),
    [
        ({"cpu": "A"}, [], "attributed to the surroundings: processor A → B"),
        (
            {},
            [],
            "no recorded property differs; the engine is not deterministic, or has changed without a new version, "
            "or has run on another processor, which older baselines do not record",
        ),
        ({}, ["other"], "no recorded property differs; the engine is not deterministic, or has changed without a new version"),
    ],
    ids=["known", "unknown", "excluded"],
)
def test_processor_of_accepted_results_is_compared_and_where_it_is_not_recorded_may_be_the_cause(recorded, unmoved, message):
    content = {"date": "2026-03-01", "reason": "first", "versions": STAMP["versions"] | {"python": "3.11.7", "candidate": "1.0"}}
    accepted = Acceptance.model_validate(content | {"code": "c", "adapters": STAMP["adapters"]} | recorded)
    assert attribute(accepted.stamp_of("candidate"), STAMP | {"cpu": "B"}, "candidate", unmoved).message == message


def test_library_that_measured_the_same_motions_otherwise_is_not_excluded_by_an_unmoved_engine():
    found = attribute(STAMP, STAMP | {"versions": STAMP["versions"] | {"numpy": "2.1"}}, "candidate", ["other"], "same")
    assert found.message == "attributed to the surroundings: numpy 2 → 2.1"


def test_changed_code_of_a_built_in_adapter_is_a_correction_of_dropspin():
    stamp = STAMP | {"adapters": {"pybullet": "a"}, "settings": {"pybullet": STAMP["settings"]["candidate"]}}
    found = attribute(stamp, stamp | {"code": "d", "adapters": {"pybullet": "b"}}, "pybullet", [])
    assert found.origin == "dropspin"
    assert found.message.endswith("as far as it is recorded: the code of pybullet's adapter, dropspin's own code")


def test_changed_motions_of_wang_s_method_are_a_change_of_dropspin_not_a_correction():
    stamp = STAMP | {"settings": {"wang": STAMP["settings"]["candidate"]}}
    found = attribute(stamp, stamp | {"code": "d"}, "wang", [], "different")
    assert (found.origin, found.message) == ("dropspin", "a change of dropspin, of which wang is a part: dropspin's own code")


def test_settings_that_differ_from_accepted_ones_are_in_the_order_of_these():
    """Not in that of a set, which is another one in each process."""
    accepted = {f"setting-{number}": "1" for number in range(40)}
    old, new = ({"settings": {"made": settings}} for settings in ({ACCEPTED: accepted}, {"case": dict.fromkeys(accepted, 2)}))
    assert list(changed_settings(old, new, "made")) == list(accepted)
