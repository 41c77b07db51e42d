"""Composed sentences in their edge cases: none, one, two and many things, plurals, undefined values and unknown units."""

import math

import pandas as pd
import pytest

from dropspin.comparisons.conformance.outcomes import CheckResult
from dropspin.comparisons.published.results import Result
from dropspin.comparisons.record.findings import Case, Change
from dropspin.comparisons.record.rerun import Again
from dropspin.comparisons.regressions.attribution import Attribution
from dropspin.comparisons.regressions.changes import EqualMotions, SpeedChange
from dropspin.comparisons.regressions.comparing import Changes
from dropspin.comparisons.regressions.history import DEFINED, History
from dropspin.comparisons.symmetries.findings import STATUSES, Finding
from dropspin.reports.stories import compare, conform, history, log_fit, numbers, record, reproduce, rerun, scene, symmetries
from dropspin.scenarios import load

PASSED, DECLINED = CheckResult("a", "passed", "yes"), CheckResult("b", "declined", "no floor")
FAILED, CRASHED = CheckResult("c", "failed", "wrong"), CheckResult("d", "crashed", "SIGSEGV")
MEASURED, LATER = Case("measured", "", "aa", {}), Case("measured", "", "bb", {})
DECLINES = Case("declined", "no floor", "", {})
SPHERE = {"shape": "sphere", "radius": 0.1, "mass": 1.0}
ELLIPSOID = {"shape": "ellipsoid", "half_extents": [0.1, 0.2, 0.3], "mass": 2.0}
FLOOR = {"restitution": 0.5, "friction": 0.3, "half_extents": [4.0, 2.0], "thickness": 0.1}


def conformance(*results):
    return " ".join(conform.document(results).parts[0].items)


def comparison(*changes, **content):
    table = pd.DataFrame({"change": changes}, dtype=str).assign(engine="a", scene="s", kind="truth", metric="energy_error")
    none = {
        "attributions": {},
        "surroundings": [],
        "other_scenes": [],
        "in_one_only": [],
        "speed": [],
        "motions": [],
        "judged_otherwise": {},
    }
    found = Changes(table, **(none | content))
    return " ".join([*compare._notes(found), compare._verdict(found)])


def changed(release, metric=""):
    return Change("1.0", release, "a", "drop-ball", 1e-3, MEASURED, LATER, metric, 1.0, 2.0)


def moved(new):
    return record.change_sentences([Change("1.0", "2.0", "a", "drop-ball", 1e-3, MEASURED, LATER, "energy_error", 0.1, new)])["2.0"][0]


def again(*cases, **differing):
    return " ".join(rerun._sentences(Again("drop-ball", dict(enumerate(cases)), differing)))


def published(*statuses):
    return reproduce._verdict([Result("s", "t", "q", "1", "1", "a", status, "", math.nan, "") for status in statuses])


def lost(*scenes, difference=0.25):
    return symmetries.sentences([Finding(name, "a", "mirrored", "lost", difference, 3, 0.003, "", "", None) for name in scenes])


def unchanged(*names):
    results = pd.DataFrame([dict.fromkeys(DEFINED, "order") | {"run": run} for run in range(2)])
    return history.document(History(list(names), pd.DataFrame(), results, [], [{} for _ in names[1:]])).parts[1].items[0]


def modelled(**tables):
    return ", ".join(scene.modelled(load({"name": "made", "duration": 1.0} | tables)))


def test_every_status_and_verdict_has_words():
    assert symmetries.MEANINGS.keys() == set(STATUSES)
    assert log_fit.TRANSFERS.keys() == log_fit.NOT_IDENTIFIED.keys() == {"friction", "restitution"}
    assert all(words.keys() == {"equal", "undecided", "different"} for words in log_fit.TRANSFERS.values())


@pytest.mark.parametrize(
    ("statuses", "cell"), [(["kept", "not run"], "✓ 1e-12 (1 of 2)"), (["kept", "kept"], "✓ 1e-12"), (["not run"], "–")]
)
def test_a_symmetry_that_few_scenes_tested_says_so(statuses, cell):
    found = [Finding(f"s{number}", "a", "mirrored", status, 1e-12) for number, status in enumerate(statuses)]
    assert symmetries.worst_table(found).rows == [{"the scene": "mirrored", "a": cell}]


@pytest.mark.parametrize(
    ("sentence", "expected"),
    [
        (conformance(PASSED), "The check does not fail."),
        (conformance(PASSED, DECLINED), "None of 2 checks fails; 1 tested nothing, for the reason given."),
        (conformance(PASSED, DECLINED, DECLINED), "None of 3 checks fails; 2 tested nothing, for the reasons given."),
        (conformance(DECLINED), "The check does not fail; it tested nothing, for the reason given."),
        (conformance(FAILED), "1 of 1 check fails."),
        (conformance(PASSED, FAILED, CRASHED), "2 of 3 checks fail."),
        (conformance(FAILED, FAILED, CRASHED), "2 checks have the same error: wrong 3 of 3 checks fail, with 2 different messages."),
        (comparison("same"), "The result is not worse."),
        (comparison("same", "same"), "None of 2 results is worse."),
        (comparison("worse", "same"), "1 of 2 results is worse, moved or gone."),
        (comparison("worse", "gone"), "2 of 2 results are worse, moved or gone."),
        (comparison("better", attributions={"a": Attribution("engine", "x")}), "a: 1 better. X. The result is not worse."),
        (
            comparison(speed=[SpeedChange("a", "b", 1.5, 0.9, math.inf, 1)]),
            "Speed (reported, not gated): relative to b, a takes 1.50 times as long as before (median of 1 case, 95 % interval unbounded "
            "with so few cases). None of 0 results is worse.",
        ),
        (
            comparison(motions=[EqualMotions("a", 1, 2, "s", 1e-3, 1200), EqualMotions("b", 2, 2)]),
            "Motions equal bit for bit: a 1 of 2, the first difference in s at 1 ms in step 1,200; b 2 of 2. None of 0 results is worse.",
        ),
        (record.changes_in_words([]), "no result changed"),
        (record.changes_in_words([changed("2.0", "energy_error")]), "results changed in 2.0"),
        (record.changes_in_words([changed("2.0"), changed("3.0")]), "no result changed; scenes gained or lost results in 2.0, 3.0"),
        (record.changes_in_words([changed("2.0"), changed("2.0", "m")]), "results changed in 2.0"),
        (moved(0.2), "drop-ball with a: energy error 0.100 → 0.200 at dt\xa0=\xa01\xa0ms"),
        (moved(0.1 + 1e-7), "drop-ball with a: energy error 0.100 changed by 1.00e-07 at dt\xa0=\xa01\xa0ms"),
        (
            again((MEASURED, LATER), (MEASURED, MEASURED), numpy=("1", "2")),
            "At 1 of 2 time steps, the motion or the verdict differs from the record. "
            "Different from the record: numpy 2 (in the record: 1).",
        ),
        (
            again((DECLINES, DECLINES)),
            "Declined: no floor. Every verdict, motion and value equals that of the record, bit for bit. "
            "Adapter, versions and machine are those of the record.",
        ),
        (published("for comparison"), "0 of 0 values are reproduced; 0 differ."),
        (published("reproduced"), "1 of 1 value is reproduced; 0 differ."),
        (published("reproduced", "reproduced", "differs", "not run"), "2 of 3 values are reproduced; 1 differs; 1 was not run."),
        (lost("s")[0], "a, mirrored: in s, the two motions differ from step 3 onwards (t = 0.003 s); the largest difference is 0.25."),
        (lost("s", "t")[0].rpartition("largest ")[2], "difference is 0.25; the motions also differ in 1 other scene."),
        (
            lost("s", "t", "u", difference=math.inf)[0].rpartition("largest ")[2],
            "difference is infinite; the motions also differ in 2 other scenes.",
        ),
        (unchanged("Mon", "Tue"), "No result changed in 2 runs of 1 scene."),
        (modelled(body=SPHERE), "a sphere of 1 kg"),
        (modelled(body=ELLIPSOID, gravity={"acceleration": [0.0, -9.8, 0.0]}), "an ellipsoid of 2 kg, gravity of 9.8 m/s²"),
        (
            modelled(body=SPHERE, floor=FLOOR, start={"position": [0.0, 1.0, 0.0]}),
            "a sphere of 1 kg, a floor up to |x| = 4 m and |z| = 2 m, 0.1 m thick, of restitution 0.5 and friction 0.3",
        ),
        (numbers.with_unit("2", "furlong") + numbers.unit("furlong") + numbers.unit("1"), "2 furlong [furlong]"),
        (numbers.named(["a"], "scene"), "a"),
        (numbers.named(["a", "b"], "scene"), "a and b"),
        (numbers.named(["a", "b", "c", "d"], "scene"), "4 scenes"),
        (numbers.listed([]) + numbers.listed(list("abcde")), "a, b, c, d and 1 more"),
    ],
)  # fmt: skip
def test_sentence(sentence, expected):
    assert sentence == expected


@pytest.mark.parametrize(("now", "ratio"), [(2.0, "0.5"), (4.0000002, "1 + 5e-08"), (3.999, "1 − 0.00025"), (4.4, "1.1"), (-4.0, "1")])
def test_values_that_look_equal_have_another_ratio(now, ratio):
    row = {"scene": "ball", "engine": "mine", "metric": "energy_error", "kind": "truth", "steps": "0.004", "tolerance": 1e-9}
    assert compare._row(row | {"before": 4.0, "value": now, "in_tolerances": 2.0}, 1)["ratio"] == ratio
