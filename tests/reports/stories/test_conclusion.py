"""Each claim of a conclusion is recomputed from the rows of the run, by reading the sentence."""

import math
import re
from functools import lru_cache
from itertools import product

import numpy as np
import pytest

import dropspin as ds
from dropspin.comparisons.measuring.tolerances import scale
from dropspin.comparisons.results.conclusion import CONDITIONS, conclude
from dropspin.comparisons.results.results import Results
from dropspin.comparisons.results.table import Measurement, as_table
from dropspin.reports.plots.colours import in_sentence
from dropspin.reports.stories.conclusion import conclusion

SCENES = {
    name: ds.load(name)
    for name in ("drop-ball", "drop-ball-slipping", "drop-box-edge", "drop-box-turning", "fall-damped", "slide-box", "spin-asymmetric")
}
METRICS = {"energy": "energy_error", "bounce height": "bounce_height_error", "angular momentum": "angular_momentum_error"}
METRICS |= {"orientation": "orientation_error", "position": "position_error"}
UNITS = {"orientation_error": "rad", "position_error": "m"}
ENGINES = ("a", "mujoco[integrator=rk4,cone=elliptic]", "an other", "c")
STEPS = (4e-3, 2e-3, 1e-3, 2.5e-4)
BROKEN = ("broken", "crashed", "timed_out", "diverged")
WITHOUT = {
    "bounce_height_error": {"fall-damped", "slide-box", "spin-asymmetric"},
    "angular_momentum_error": {"drop-ball", "fall-damped", "slide-box"},
}
"""The scenes that a metric does not apply in: without a bounce, and without spin or with damping or friction from the start on."""
COUNT = 60
"""Random runs, a tenth of a second each."""


def random_run(random, within):
    """A run with all that a table may have: breakdowns, declining and missing engines, undefined values, ties, near misses."""
    scenes = list(random.permutation(list(SCENES))[: random.integers(1, 8)])
    engines, steps = ENGINES[: random.integers(1, 5)], STEPS[: random.integers(1, 5)]
    metrics, quality = list(random.permutation(list(METRICS.values()))[: random.integers(1, 6)]), random.uniform(0.0, 3.0, len(engines))
    rows = []
    for scene in scenes:
        for engine, good in zip(engines, quality, strict=True):
            fate = random.choice(["tried", "declined", "missing", "diverged"], p=[0.85, 0.07, 0.04, 0.04])
            for dt in steps[random.random() < 0.1 and len(steps) > 1 :]:
                outcome = random.choice(["tried", "crashed", "timed_out"], p=[0.95, 0.03, 0.02]) if fate == "tried" else fate
                case = {"scene": scene, "engine": engine, "dt": math.nan if outcome == "missing" else dt}
                if outcome != "tried":
                    rows.append(Measurement(**case, verdict=outcome))
                    continue
                rows.append(Measurement(**case, kind="invariant", metric="penetration", unit="m", value=0.0, verdict="measured"))
                rows += [random_error(random, within, good, case, metric) for metric in metrics if random.random() < 0.97]
    return Results(as_table(rows), {name: SCENES[name] for name in scenes}, engines, {}, provenance={"asked": {"within": within}})


def random_error(random, within, good, case, metric):
    unit = UNITS.get(metric, "1")
    largest = within * scale(SCENES[case["scene"]], unit)
    sizes = [0.0, 1.0, 10 ** (1.0 - good * random.random()), math.nan, math.inf]
    value = largest * random.choice([-1.0, 1.0]) * random.choice(sizes, p=[0.1, 0.1, 0.74, 0.03, 0.03])
    tolerance, time = largest * random.choice([math.nan, 0.0, 0.3]), random.choice([math.nan, 1e-6])
    shown = {"value": value, "unit": unit, "tolerance": tolerance, "time_per_step": time}
    return Measurement(**case, kind="truth", metric=metric, verdict="measured", **shown)


@lru_cache(maxsize=1)
def records(run):
    return run.table.to_dict("records")


@lru_cache
def state(run, metric, engine, scene, dt):
    """What the rows say about an engine at a time step: within the tolerance, beyond it, undecided, or not tried."""
    rows = [row for row in records(run) if (row["engine"], row["scene"], row["dt"]) == (engine, scene, dt)]
    if any(row["verdict"] in BROKEN for row in rows):
        return "beyond"
    errors = [row for row in rows if row["metric"] == metric and row["kind"] == "truth"]
    if not errors:
        return "undecided" if any(row["kind"] == "invariant" for row in rows) else ""
    [row] = errors
    largest = run.provenance["asked"]["within"] * scale(SCENES[scene], row["unit"])
    unsure = 0.0 if math.isnan(row["tolerance"]) else row["tolerance"]
    if abs(row["value"]) + unsure <= largest:
        return "within"
    return "beyond" if abs(row["value"]) - unsure > largest else "undecided"


def states(run, metric, engine, scene):
    """By time step at which the engine was tried, smallest first."""
    found = {dt: state(run, metric, engine, scene, dt) for dt in sorted(STEPS)}
    return {dt: one for dt, one in found.items() if one}


def scenes_of(run, metric):
    """The scenes that test a metric: those with an error of any engine, and those in which it applies and engines only broke down.

    Where an engine broke down, an error that is undefined for all others is one too: it may be defined for that engine.
    """
    exact = [row for row in records(run) if row["kind"] == "truth"]
    broken = {row["scene"] for row in records(run) if row["verdict"] in BROKEN}
    with_errors = {row["scene"] for row in exact if row["metric"] == metric and (row["scene"] in broken or not math.isnan(row["value"]))}
    return with_errors | broken - {row["scene"] for row in exact} - WITHOUT.get(metric, set())


def named(text, scenes):
    """Whether a list names these scenes, or their number if they are more than three."""
    return set(re.split(", | and ", text)) == set(scenes) if len(scenes) <= 3 else text == f"{len(scenes)} scenes"


STEP = r"at (?:(?P<dt>\S+) ms(?P<less> or less)?|the finest step of each scene)"
SIZE = r"(?:up to )?\S+ (?:%|rad)(?: in [a-z-]+)?"
SAID = re.compile(rf"(?P<no>not |undecided for )?(?P<engines>.+?)(?: {STEP}| \((?P<size>{SIZE})\))?(?: in (?P<scenes>.+))?")
USED = re.compile(
    rf"{STEP}(?:, except (?:with (?P<condition>.+) \((?P<covered>\d+) scenes(?:, {SIZE})?\))?"
    rf"(?: and )?(?:in (?P<named>.+?)(?: \({SIZE}\))?)?)?"
    r"(?:, undecided in (?P<undecided>.+?))?(?:, no result in (?P<absent>\d+) scenes?|, (?P<declined>\d+) scenes? declined)?"
)


def verify_size(run, metric, engine, text, beyond):
    """The size of the largest error in some scenes, each of which has one."""
    rows = [row for row in records(run) if (row["metric"], row["engine"]) == (metric, engine) and row["scene"] in beyond]
    finest = {scene: min(states(run, metric, engine, scene)) for scene in beyond}
    at_finest = [row for row in rows if row["dt"] == finest[row["scene"]]]
    sizes = {row["scene"]: abs(row["value"]) / scale(SCENES[row["scene"]], row["unit"]) for row in at_finest}
    broken = [row for row in records(run) if row["engine"] == engine and row["verdict"] in BROKEN and row["dt"] == finest.get(row["scene"])]
    said = re.findall(r"[(, ](up to )?([^\s(]+) (%|rad)(?: in ([a-z-]+))?\)", text)
    if not beyond or broken:
        assert not said
        return
    [[up_to, size, unit, worst]] = said
    assert bool(up_to) == (len(beyond) > 1)
    assert float(size) == pytest.approx((100.0 if unit == "%" else 1.0) * max(sizes.values()), rel=0.06)
    assert not worst or sizes[worst] == max(sizes.values())


def verify_use(run, metric, engine, clause):
    """A clause that recommends an engine."""
    said = USED.fullmatch(clause)
    assert said, clause
    tested = scenes_of(run, metric)
    of = {scene: states(run, metric, engine, scene) for scene in tested}
    finest = {scene: found[min(found)] for scene, found in of.items() if found}
    kinds = {kind: {scene for scene, one in finest.items() if one == kind} for kind in ("within", "beyond", "undecided")}
    assert len(tested) >= 3
    assert len(kinds["within"]) >= 3
    assert len(kinds["within"]) > len(kinds["beyond"] | kinds["undecided"])
    common = sorted(set.intersection(*(set(of[scene]) for scene in kinds["within"])))  # no step is named that was not tried
    held = [all(one == "within" for scene in kinds["within"] for at, one in of[scene].items() if at <= step) for step in common]
    dt = 1e-3 * float(said["dt"])
    assert dt in STEPS
    assert dt == max(step for step, has_held in zip(common, held, strict=True) if has_held)
    assert bool(said["less"]) == (dt > common[0])
    covered = {scene for scene in tested if said["condition"] and CONDITIONS[said["condition"]](SCENES[scene])} & set(finest)
    assert covered <= kinds["beyond"]
    assert len(covered) == int(said["covered"] or 0)
    rest = kinds["beyond"] - covered
    assert named(said["named"], rest) if rest else said["named"] is None
    assert named(said["undecided"], kinds["undecided"]) if kinds["undecided"] else said["undecided"] is None
    absent = tested - set(finest)
    assert int(said["absent"] or said["declined"] or 0) == len(absent)
    declining = {row["scene"] for row in records(run) if (row["engine"], row["verdict"]) == (engine, "declined")}
    assert bool(said["declined"]) == (bool(absent) and absent <= declining)
    verify_size(run, metric, engine, clause, kinds["beyond"])


def verify_count(run, metric, engine, within, scenes, declined, without, size):
    """The numbers of scenes of an engine that is not recommended: within the tolerance, with a result, and without one."""
    tested = scenes_of(run, metric)
    of = [found for scene in tested if (found := states(run, metric, engine, scene))]
    kept = [found for found in of if found[min(found)] == "within"]
    assert (len(kept), len(of), len(tested)) == (within, scenes, scenes + declined + without)
    beyond = {scene for scene in tested if (found := states(run, metric, engine, scene)) and found[min(found)] == "beyond"}
    verify_size(run, metric, engine, size, beyond)
    assert len(kept) < 3 or 2 * len(kept) <= len(of) or len(set(map(tuple, kept))) > 1


def verify_statement(run, metric, sentence):
    """A sentence on fewer than three scenes."""
    tested = scenes_of(run, metric)
    assert len(tested) < 3
    said = set()
    for clause in sentence.split("; "):
        parts = SAID.fullmatch(clause)
        scenes = re.split(" and ", parts["scenes"]) if parts["scenes"] else tested
        for engine in [engine for engine in run.engines if engine in re.split(r", (?![a-z]+=)| and ", parts["engines"])]:
            for scene in scenes:
                found = states(run, metric, engine, scene)
                expected = {"not ": "beyond", "undecided for ": "undecided", None: "within"}[parts["no"]]
                assert found[min(found)] == expected
                said.add((engine, scene))
                if parts["dt"]:
                    dt = 1e-3 * float(parts["dt"])
                    assert dt in found
                    assert all(one == "within" for step, one in found.items() if step <= dt)
    assert said == {(engine, scene) for engine in run.engines for scene in tested if states(run, metric, engine, scene)}


@pytest.mark.sample(10)
@pytest.mark.parametrize("seed", range(COUNT))
def test_each_claim_is_that_of_the_rows(seed):
    random = np.random.default_rng(seed)
    run = random_run(random, random.choice([0.01, 1e-3, 0.5]))
    within = run.provenance["asked"]["within"]
    sentences = [sentence.replace(in_sentence(ENGINES[1]), ENGINES[1]) for sentence in map(str, conclusion(run))]
    assert 1 <= len(sentences) <= 5
    for sentence in sentences:
        size = rf"within (?:{100 * within:g} %(?: of the lengths of the scene)?|{within:g} rad)"
        if used := re.fullmatch(rf"For (.+) {size} use (.+)\.", sentence):
            metric = METRICS[used[1]]
            clauses = used[2].split("; ")
            not_used = [clause.removeprefix("not ") for clause in clauses if clause.startswith("not ")]
            for clause in clauses[: len(clauses) - len(not_used)]:
                [engine] = [engine for engine in run.engines if clause.startswith(f"{engine} at ")]
                verify_use(run, metric, engine, clause.removeprefix(f"{engine} "))
            verify_counts(run, metric, not_used)
        elif none := re.fullmatch(rf"For (.+) {size} no engine is recommended: (.+)\.", sentence):
            verify_counts(run, METRICS[none[1]], none[2].split("; "))
        elif few := re.fullmatch(rf"(.+) {size}: (.+)\.", sentence):
            verify_statement(run, METRICS[few[1].lower()], few[2])
        else:
            assert re.match("1 s of motion|No recommendation: it takes 3 scenes", sentence)


@pytest.mark.parametrize(("verdict", "tests"), [("measured", 1), ("failed", 3)])
def test_scene_in_which_an_error_is_undefined_for_every_engine_tests_nothing(verdict, tests):
    """Such as a flight that is too short to be measured; a bounce that should occur and does not is a failed test."""
    rows = []
    for scene, engine in product(("drop-ball", "drop-box-edge", "drop-box-turning"), "ab"):
        case = {"scene": scene, "engine": engine, "dt": 1e-3, "kind": "truth", "metric": "energy_error", "unit": "1"}
        error = {"value": 1e-4, "tolerance": 0.0, "verdict": "passed"} if scene == "drop-ball" else {"value": math.nan, "verdict": verdict}
        rows.append(Measurement(**case, **error))
    run = Results(as_table(rows), SCENES, ("a", "b"), {}, provenance={"asked": {"within": 0.01}})
    assert {answer.scenes for answer in conclude(run)} == {tests}


def test_scenes_in_which_the_only_engine_broke_down_are_exceptions():
    rows = []
    for scene in SCENES:
        for dt in STEPS:
            case = {"scene": scene, "engine": "a", "dt": dt}
            exact = {"kind": "truth", "metric": "energy_error", "unit": "1", "value": 0.0, "tolerance": 0.0, "verdict": "measured"}
            rows.append(Measurement(**case, verdict="diverged") if scene == "drop-ball" else Measurement(**case, **exact))
    run = Results(as_table(rows), SCENES, ("a",), {}, provenance={"asked": {"within": 0.01}})
    assert any(str(sentence) == "For energy within 1 % use a at 4 ms or less, except in drop-ball." for sentence in conclusion(run))


@pytest.mark.parametrize(
    ("ends", "cause", "is_recommended"),
    [
        ((0.018, 0.022), "model", False),
        ((0.018, 0.022), "setting", False),
        ((0.018, 0.022), "unresolved", True),
        ((0.009, 0.022), "model", True),
        ((0.004, 0.006), "model", True),
    ],
)
def test_an_error_that_grows_beyond_the_tolerance_at_smaller_steps_is_not_recommended(ends, cause, is_recommended):
    """As 0.02 - 10 dt: 0.01 at 1 ms, and 0.018 at 0.2 ms."""
    rows = []
    for scene in ("drop-ball", "drop-box-edge", "slide-box"):
        case = {"scene": scene, "engine": "a", "metric": "energy_error", "unit": "1"}
        rows += [Measurement(**case, dt=dt, kind="truth", value=0.009, tolerance=0.0, verdict="measured") for dt in STEPS]
        interval = {"lower": ends[0], "upper": ends[1]}
        rows.append(Measurement(**case, kind="asymptotic_error", value=0.5 * sum(ends), cause=cause, verdict="failed", **interval))
    run = Results(as_table(rows), SCENES, ("a",), {}, provenance={"asked": {"within": 0.01}})
    none = "no engine is recommended: a (within 1 % in 0 of 3 scenes, up to 2.0 % in drop-ball)."
    assert str(conclusion(run)[0]) == f"For energy within 1 % {'use a at 4 ms or less.' if is_recommended else none}"


def verify_counts(run, metric, clauses):
    """Clauses on engines that are not recommended."""
    for clause in clauses:
        of_judged = rf"(?: \(within \S+ (?:%|rad) in (\d+) of (\d+) scenes?((?:, {SIZE})?)\))?"
        said = re.fullmatch(rf"(.+?){of_judged}(?:, (?:(\d+) scenes? declined|no result in (\d+) scenes?))?", clause)
        engine, within, scenes, size, *absent = said.groups()
        assert engine in run.engines
        counts = [int(count or 0) for count in (within, scenes, *absent)]
        assert bool(said[3]) == bool(counts[1])
        verify_count(run, metric, engine, *counts, f"{size})")
