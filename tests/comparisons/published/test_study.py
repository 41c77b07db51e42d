"""The study of published results: the sources are complete, what is claimed is reproduced, and a changed digit or method is seen."""

import csv
import math
from itertools import groupby

import mpmath
import numpy as np
import pytest

from dropspin.comparisons.published import formulas, study
from dropspin.comparisons.published.formulas import FORMULAS, kane, nesc_brick
from dropspin.comparisons.published.quantities import quantity
from dropspin.comparisons.published.sources import DATA, source_names, sources
from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.reports.stories.reproduce import exit_code
from dropspin.scenarios import Trajectory, UnknownName


def only(name, tool, case="", **changes):
    """A source with one group and, of it, one case; changes are of the group."""
    [source] = sources([name])
    group = next(one for one in source.groups if one.tool == tool)
    cases = tuple(one for one in group.cases if case in ("", one.case))
    return source.model_copy(update={"formula": "", "groups": (group.model_copy(update={"cases": cases, **changes}),)})


def reproduced(monkeypatch, *chosen):
    """The results for sources that need not be those of the files."""
    monkeypatch.setattr(study, "sources", lambda names: list(chosen))
    return study.reproduce()


@pytest.mark.parametrize("name", source_names())
def test_every_source_is_complete(name):
    """Its scenes are valid, its quantities exist, and each case has a digit for each quantity."""
    [source] = sources([name])
    assert source.formula in ("", *FORMULAS)
    assert source.formula or source.groups or source.data
    for scene in source.scenes:
        source.scene(scene)
    for group in source.groups:
        assert group.scene in source.scenes
        assert group.by or group.why_not
        assert all(callable(quantity(one)) for one in group.quantities)
        assert all(len(case.printed) == len(group.quantities) for case in group.cases)


def test_unknown_names_suggest_the_nearest():
    with pytest.raises(UnknownName, match=r"source 'nesc-brik' is unknown\. Did you mean 'nesc-brick'"):
        sources(["nesc-brik"])
    with pytest.raises(UnknownName, match="quantity 'max E' is unknown"):
        quantity("max E")


@pytest.mark.extended
@pytest.mark.parametrize(
    ("name", "tool", "case"),
    [
        ("gazebo-boxes", "ODE", "1 ms"),
        ("gazebo-boxes", "Bullet", "1 ms"),
        ("gazebo-boxes", "Simbody", "1 ms"),
        ("simbenchmark-bouncing", "ODE", "10 ms"),
        ("simbenchmark-bouncing", "Bullet multibody", "10 ms"),
        ("fmi-bouncing-ball", "FMU", ""),
        ("jolt-unit-tests", "elastic rebound", ""),
        ("mujoco-free-body", "implicitfast", ""),
    ],
)
def test_digits_of_others_are_reproduced_by_an_engine(name, tool, case, monkeypatch):
    results = reproduced(monkeypatch, only(name, tool, case))
    assert {one.status for one in results} == {"reproduced"}
    assert all(one.here == one.published for one in results if not set(one.published) & set("<>±"))


@pytest.mark.parametrize("name", [one for one in source_names() if sources([one])[0].formula])
def test_exact_solutions_reproduce_formulas_and_rates(name):
    [source] = sources([name])
    statuses = [one.status for one in FORMULAS[source.formula](source)]
    assert set(statuses) <= {"reproduced", "error of the source"}
    assert len(statuses) > 3


def test_the_bouncing_ball_rests_where_the_method_of_the_source_does_as_dt_vanishes():
    """Explicit Euler as in the FMU's model.c, which compares the speed of the rebound with 0.1 m/s: the error is the method's."""
    [source] = sources(["fmi-bouncing-ball"])
    [rest] = [one for one in FORMULAS[source.formula](source) if one.quantity == "at rest from [s]"]

    def steps_to_rest(dt):
        height, speed, steps = 1.0, 0.0, 0
        while True:
            height, speed, steps = height + dt * speed, speed - 9.81 * dt, steps + 1
            if height <= 0.0:
                height, speed = 0.0, -0.7 * speed
                if speed < 0.1:
                    return steps

    assert math.ceil(steps_to_rest(1e-3) / 10) == round(100 * float(rest.published))  # rows are 10 ms apart
    errors = [dt * steps_to_rest(dt) - float(rest.here) for dt in (1e-3, 1e-4, 1e-5)]
    assert [round(error, 4) for error in errors] == [0.1049, 0.0069, 0.0006]


def test_errors_of_the_five_tools_of_the_brick():
    """Those measured by integration with a tolerance of 1e-13, at all 301 times instead of the whole seconds."""
    errors = {one.tool: abs(one.difference) for one in nesc_brick(*sources(["nesc-brick"])) if one.status == "error of the source"}
    all_times = {"sim 01": 3.6e-10, "sim 02": 1.24e-3, "sim 04": 3.3e-10, "sim 05": 5.8e-5, "sim 06": 4.74e-3}
    assert errors.keys() == all_times.keys()
    assert all(0.8 * all_times[tool] < error <= 1.01 * all_times[tool] for tool, error in errors.items())


def test_the_two_tools_agree_with_each_other_to_the_decimals_that_are_claimed():
    [source] = sources(["nesc-brick"])
    with (DATA / source.parameters["rates"]).open(encoding="utf-8") as file:
        table = {tool: [list(row.values())[2:] for row in rows] for tool, rows in groupby(csv.DictReader(file), lambda row: row["tool"])}
    first, second = (np.array(table[tool], dtype=float) for tool in source.parameters["agree"])
    assert np.abs(first - second).max() < 0.5 * 10.0 ** -source.parameters["decimals"]
    assert all(len(rows) == 31 for rows in table.values())


def test_kanes_formula_solves_the_equations_of_motion():
    """Integrated in 30 digits: Euler's equations, and q' = q ω/2."""
    [source] = sources(["drake-free-body"])
    scene = source.scene("cylinder")
    transverse, _, axial = (mpmath.mpf(str(one)) for one in source.scenes["cylinder"]["body"]["inertia"])

    def rates(t, y):
        x, y_, z, w, p, q, r = y
        k = (transverse - axial) / transverse
        turning = [w * p + y_ * r - z * q, w * q + z * p - x * r, w * r + x * q - y_ * p, -x * p - y_ * q - z * r]
        return [*(one / 2 for one in turning), k * q * r, -k * p * r, mpmath.mpf(0)]

    with mpmath.workdps(30):
        state = mpmath.odefun(rates, 0, [0, 0, 0, 1, *map(mpmath.mpf, scene.start.angular_velocity)])(1)
    assert [float(one) for one in state] == pytest.approx(list(kane(scene, 1.0).values())[:7], abs=1e-14)


CHANGED_DIGIT = {"printed": ("0.0130709", "0.012462", "0.049")}


@pytest.mark.extended
@pytest.mark.parametrize(
    ("name", "tool", "case", "changes"),
    [
        ("gazebo-boxes", "ODE", "1 ms", {"by": "wang[rotation=implicit-gyroscopic]"}),
        ("gazebo-boxes", "ODE", "1 ms", {"by": "mujoco"}),  # the rotation by the exponential map: 0.0130698
        ("gazebo-boxes", "Bullet", "1 ms", {"by": "wang[rotation=implicit-gyroscopic]"}),
        ("simbenchmark-bouncing", "ODE", "10 ms", {"by": "pybullet[coordinates=multibody]"}),
        ("fmi-bouncing-ball", "FMU", "", {"by": "mujoco[integrator=rk4]"}),
        ("newton-verification", "e = 0.5", "", {"by": "pybullet[profile=default]"}),
    ],
)
def test_another_method_differs(name, tool, case, changes, monkeypatch):
    results = reproduced(monkeypatch, only(name, tool, case, **changes))
    assert "differs" in {one.status for one in results}
    assert exit_code(results, named=False) == 1


def test_a_changed_digit_differs(monkeypatch):
    source = only("gazebo-boxes", "ODE", "1 ms")
    [group] = source.groups
    cases = (group.cases[0].model_copy(update=CHANGED_DIGIT),)
    results = reproduced(monkeypatch, source.model_copy(update={"groups": (group.model_copy(update={"cases": cases}),)}))
    assert [one.status for one in results] == ["differs", "reproduced", "reproduced"]
    assert results[0].difference == pytest.approx(-1e-7, rel=0.05)
    assert exit_code(results, named=False) == 1


def test_the_moments_of_inertia_must_be_rounded_as_in_the_source(monkeypatch):
    source = only("gazebo-boxes", "ODE", "1 ms")
    box = dict(source.scenes["box"])
    box["body"] = {key: value for key, value in box["body"].items() if key != "inertia"}
    [first, *_] = reproduced(monkeypatch, source.model_copy(update={"scenes": {"box": box}}))
    assert (first.status, first.here) == ("differs", "0.0130709")


def test_a_changed_rate_of_the_brick_differs(monkeypatch, tmp_path):
    text = (DATA / "nesc-brick.csv").read_text(encoding="utf-8")
    changed = text.replace("04,10.0,-2.41890222177", "04,10.0,-2.41890322177")
    assert changed != text
    (tmp_path / "nesc-brick.csv").write_text(changed, encoding="utf-8")
    monkeypatch.setattr(formulas, "DATA", tmp_path)
    found = {(one.tool, one.here): one.status for one in nesc_brick(*sources(["nesc-brick"]))}
    assert found["sim 04", "92 equal"] == "differs"
    assert found["sim 01", "93 equal"] == "reproduced"


def test_a_wrong_constant_of_a_formula_differs(monkeypatch):
    monkeypatch.setattr(formulas, "housner_ratio", lambda alpha: (1.0 - 1.4999999 * math.sin(alpha) ** 2) ** 2)
    assert "differs" in {one.status for one in formulas.housner_block(*sources(["housner-block"]))}


@pytest.mark.parametrize("why_not", ["", "other digits"])
def test_a_missing_engine_costs_its_rows_only(why_not, monkeypatch):
    """The reason why its values differ is not stated: it has none."""
    monkeypatch.setattr("dropspin.comparisons.engines.registry.find_spec", lambda name: None)
    results = reproduced(monkeypatch, only("fmi-bouncing-ball", "FMU", by="drake", why_not=why_not), *sources(["housner-block"]))
    assert {(one.status, one.verdict) for one in results[:4]} == {("not run", "missing")}
    assert results[0].reason.startswith("drake is not installed")
    assert {one.status for one in results[4:]} == {"reproduced", "error of the source"}
    assert exit_code(results, named=False) == 0
    assert exit_code(results, named=True) == 3


def test_a_value_that_no_engine_gives_is_not_reproducible(monkeypatch):
    results = reproduced(monkeypatch, only("simbenchmark-bouncing", "RaiSim"))
    assert {(one.status, one.verdict, one.reason) for one in results} == {("not reproducible", "", "dropspin has no adapter for RaiSim")}
    assert exit_code(results, named=True) == 0


@pytest.mark.parametrize("why_not", ["", "other digits"])
def test_an_engine_that_breaks_down_has_exit_code_3(why_not, monkeypatch):
    monkeypatch.setattr(study, "sources", lambda names: [only("gazebo-boxes", "DART", "1 ms", by="wang", why_not=why_not)])
    monkeypatch.setattr(study, "_measured", breaking)
    results = study.reproduce(resources=ResourceLimits(processor_time=5.0))
    assert {(one.status, one.verdict, one.here) for one in results} == {("not run", "crashed", "")}
    assert "RuntimeError: broken" in results[0].reason
    assert exit_code(results, named=False) == 3


def breaking(*arguments):
    raise RuntimeError("broken")


def test_an_older_version_of_an_engine_is_not_claimed(monkeypatch):
    [result, _] = reproduced(monkeypatch, only("mujoco-free-body", "implicitfast", by="mujoco", since="99.1"))[:2]
    assert result.status == "not reproducible"
    assert result.reason.startswith("it needs version 99.1 or later; ")


def test_rebound_of_a_ball_that_does_not_turn_is_undefined():
    [source] = sources(["newton-verification"])
    states = np.zeros((3, 13))
    states[:, 1] = [1.0, 0.9, 0.8]
    assert math.isnan(quantity("rebound height [m]")(source.scene("rebound-5"), Trajectory.from_states(np.arange(3.0), states)))
