"""The single cause with which the asymptotic errors of an engine are consistent: a wrong parameter, a known fault, or none."""

from dataclasses import replace
from itertools import count

import numpy as np
import pandas as pd
import pytest
from support import engines as made
from support.detection_power import FAULTS, faulty_engine
from support.fault_suite import FAULTS as PLANTED
from support.fault_suite import Made, with_body, with_damping, with_gravity, with_restitution
from support.releases import TODAY, WithoutGyroscopicTerm, relabelled

from dropspin.comparisons.faults import parameters as mistakes
from dropspin.comparisons.regressions.baseline import Baseline
from dropspin.comparisons.regressions.causes import _caused, _explained, _sizes, _with, causes
from dropspin.comparisons.regressions.checking import accept, check
from dropspin.comparisons.regressions.parameters import PARAMETERS
from dropspin.comparisons.running.arguments import DEFAULT_DTS
from dropspin.comparisons.running.run import run
from dropspin.reports.markdown import markdown
from dropspin.reports.stories.check import document
from dropspin.reports.stories.failures import failure_parts, failures
from dropspin.reports.stories.run import overview
from dropspin.reports.terminal.rows import print_document
from dropspin.scenarios import DropspinError, load
from dropspin.scenarios.rotations import about, rotate
from dropspin.scenarios.variations import with_values

STEPS = [8e-3, 4e-3, 2e-3]
"""For engines that are exact but for their fault."""

SLOWER = "Coulomb coefficient 1 % too high or gravity 1 % too high or direction of gravity wrong by 0.003 rad"
"""Each slows a sliding box alike."""
OF = {fault.title: fault for fault in FAULTS}
TITLED = {fault.title: fault for fault in PLANTED}


def lasting(name, seconds=2.0):
    """A scene that ends after some seconds at the latest; the faults show well before."""
    scene = load(name)
    return scene.model_copy(update={"duration": min(scene.duration, seconds)})


@pytest.fixture(scope="module", autouse=True)
def _whole_runs():
    """In place of the fixture of the folder: a parameter shows from few starts."""


@pytest.fixture(autouse=True)
def _few_starts(request):
    """Four start phases, for engines that are exact but for their fault."""
    if "mujoco" not in request.node.name:
        request.getfixturevalue("few_start_phases")


def consistent_with(engine, *scenes, steps=STEPS):
    results = run([lasting(name) for name in scenes], engine, steps)
    sentence = next(failure_parts(results, failures(results))).items[0]
    return sentence.replace(f" of {results.engines[0]}: ", ": ", 1) if sentence.startswith("Possible cause") else ""


@pytest.mark.extended
@pytest.mark.parametrize(
    ("title", "engine", "scenes", "size", "words"),
    [
        ("restitution", "exact", ["drop-ball", "drop-ball-lively"], 0.005, "restitution 0.5 % too high"),
        ("restitution", "mujoco", ["drop-ball"], -0.003, "restitution 0.3 % too low"),
        ("linear damping", "exact", ["fall-damped"], -0.01, "linear damping 1 % too low"),
        ("moment of inertia about x", "exact", ["spin-asymmetric"], 0.01, "moment of inertia about x 1 % too high"),
        ("Coulomb coefficient", "exact", ["slide-box"], 0.01, SLOWER),
    ],
)
def test_planted_parameter_is_named(title, engine, scenes, size, words):
    steps = STEPS if engine == "exact" else DEFAULT_DTS
    assert (
        consistent_with(faulty_engine(engine, OF[title], size), *scenes, steps=steps)
        == f"Possible cause of the asymptotic errors: {words}."
    )


def tilted(angle):
    turn = about(np.array([0.0, 0.0, 1.0]), np.array(angle))
    return with_gravity(np.array([rotate(turn, axis) for axis in np.eye(3)]).T)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("change", "scenes", "words"),
    [
        (
            with_gravity(9.81 / 9.8 * np.eye(3)),
            ["drop-ball", "fall-spin"],
            "gravity 0.1 % too high; or gravity is 9.81 m/s² along -y for every scene",
        ),
        (with_gravity(0.99 * np.eye(3)), ["drop-ball", "slide-box", "drop-ball-backspin"], "gravity 1 % too low"),
        (tilted(3e-4), ["drop-ball", "fall-spin", "slide-box"], "direction of gravity wrong by 0.0003 rad"),
        (
            with_body(mass=1.01),
            ["drop-ball", "drop-ball-backspin"],
            "mass 1 % too high or moments of inertia 0.99 % too low or moment of inertia about z 0.99 % too low",
        ),
        (
            with_restitution(lambda e: e * e),
            ["drop-ball", "drop-ball-lively"],
            "restitution appears to be squared; an engine that multiplies the values of two bodies needs 1 for the floor",
        ),
        (
            with_body(moments=lambda m: m[[1, 0, 2]]),
            ["spin-asymmetric", "fall-spin"],
            "the moments of inertia appear to be permuted to (y, x, z)",
        ),
    ],
    ids=["gravity 9.81", "gravity 0.99", "tilt", "mass", "restitution squared", "inertia permuted"],
)
def test_planted_cause_is_named_where_metrics_change_in_steps_and_where_two_causes_are_alike(change, scenes, words):
    """A ball that falls faster than the scene's appears to touch a floor all along, so that its contact gap is 1 m."""
    assert consistent_with(Made(title="planted", change=change), *scenes) == f"Possible cause of the asymptotic errors: {words}."


@pytest.mark.extended
def test_missing_gyroscopic_term_is_named():
    words = "angular velocity stays constant, as without the gyroscopic term or with the inertia of a ball"
    assert consistent_with(WithoutGyroscopicTerm(), "spin-asymmetric", "drop-ball") == f"Possible cause of the asymptotic errors: {words}."


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "title", ["angular velocity reported in the body frame", "friction omitted", "additional angular damping of 1e-3 1/s in free flight"]
)
def test_known_fault_is_named(title):
    words = {
        "angular velocity reported in the body frame": "angular velocity appears to be in the body frame",
        "friction omitted": "friction is omitted",
        "additional angular damping of 1e-3 1/s in free flight": "angular damping 0.001 1/s too high",
    }
    assert words[title] in consistent_with(TITLED[title], "fall-spin", "spin-asymmetric", "drop-ball-backspin")


def test_parameter_that_the_scene_of_the_narrowest_interval_cannot_have_is_named():
    """The ball falls above a floor, where no exact solution has damping; its interval is the narrowest."""
    damped = Made(title="damped", change=lambda scene: with_damping(linear=1e-3)(scene.model_copy(update={"floor": None})))
    fall = lasting("drop-ball", 0.4).model_copy(update={"expect": ()})
    results = run([fall, lasting("fall-spin", 0.1)], damped, STEPS)
    [cause], _, unexamined = causes(results, "damped")
    assert unexamined[cause.parameter.name] == ["drop-ball"]
    assert (
        next(failure_parts(results, failures(results)))
        .items[0]
        .endswith(": linear damping 0.001 1/s too high (not examined in drop-ball).")
    )
    assert (cause.parameter.name, cause.parameter.unit, cause.size) == ("linear damping", "1/s", pytest.approx(1e-3, rel=1e-3))


def test_fault_without_an_effect_is_no_cause():
    """The interval of the energy error begins at what is negligible, so that a cause without any error is near it."""

    class Approaching(made.Exact):
        name = "approaching"

        def prepare(self, scene, dt):
            other = with_values(scene, "floor", restitution=lambda e: e * (1.1 - 100.0 * dt))
            return made.ExactSimulation(other, dt, lambda row, time: row)

    sentence = consistent_with(Approaching(), "drop-ball", steps=[5e-4, 2.5e-4, 1.25e-4])
    assert sentence == "Possible cause of the asymptotic errors: restitution 10 % too high."


@pytest.mark.extended
@pytest.mark.parametrize(
    "engine",
    [faulty_engine("exact", OF["gyroscopic term"], 0.01), made.engine_with("turned", made.turned_by(0.1)), made.Exact()],
    ids=["gyroscopic", "turned", "sound"],
)
def test_fault_of_another_kind_has_no_cause(engine):
    assert causes(run(lasting("spin-asymmetric"), engine, STEPS), engine.label)[:2] == ([], [])


@pytest.mark.extended
def test_cause_that_another_scene_excludes_is_not_named():
    """An inertia that is wrong in one scene alone: in the other one, which passes, that error would show."""
    wrong = with_body(moments=lambda m: m * np.array([1.01, 1.0, 1.0]))
    engine = Made(title="planted", change=lambda scene: wrong(scene) if scene.name == "spin-asymmetric" else scene)
    assert consistent_with(engine, "spin-asymmetric") == "Possible cause of the asymptotic errors: moment of inertia about x 1 % too high."
    assert consistent_with(engine, "spin-asymmetric", "drop-box-corner") == ""


def test_check_prints_the_cause_first(capsys):
    """Before the largest change, in the terminal and in a summary."""
    scenes = [lasting("drop-ball"), lasting("fall-spin")]
    accepted, _ = accept(run(scenes, Made(title="mine"), STEPS), Baseline(), "first", TODAY)
    worse = run(scenes, Made(title="worse", change=with_gravity(1.01 * np.eye(3))), STEPS)
    checked = check(relabelled(worse, "worse", "mine"), accepted)
    found = failures(checked.results, "b.toml")
    print_document(document(checked, found, "out/run", None))
    assert capsys.readouterr().out.startswith("Possible cause of the asymptotic errors of mine: gravity 1 % too high.\n✗ ")
    page = markdown(document(checked, found, "out/run", None))
    assert "\n- Possible cause of the asymptotic errors of mine: gravity 1 % too high.\n- ✗ " in page


def test_sampling_excludes_no_cause():
    """Whether the last sample before the impact is one of every second sample or not, the energy gain until then is known to a step."""
    ball, [gravity] = lasting("drop-ball", 0.8), [parameter for parameter in PARAMETERS if parameter.name == "gravity"]
    for size in np.linspace(0.01, 0.03, 8):
        fault = _with(gravity, size)
        gain = _caused(ball, fault, 4e-5).error("energy_gain")
        row = {"metric": "energy_gain", "unit": "1", "verdict": "failed", "cause": "model", "value": gain}
        widths, compared = _explained(ball, fault, [row | {"lower": gain - 2e-6, "upper": gain + 2e-6}], [], 2e-3)
        assert len(widths) == compared == 1, size


@pytest.mark.parametrize(("half_width", "drift", "named"), [(1e-6, 1e-5, True), (4e-6, 1e-5, False), (1e-6, 0.0, False)])
def test_cause_of_one_error_that_is_hardly_known_or_of_one_that_rounding_excludes_is_not_named(half_width, drift, named):
    """A gravity that is wrong by 0.0015 % displaces a ball by 1.5e-5 m, and changes its energy in the first flight by 8.4e-6."""
    ends = {
        "position_error": (1.5e-5, half_width, "failed", "model"),
        "energy_drift": (drift, 3e-6 if drift else 3e-8, "passed", "rounding"),
    }
    rows = [
        {"metric": metric, "verdict": verdict, "cause": cause, "value": value, "lower": value - width, "upper": value + width}
        for metric, (value, width, verdict, cause) in ends.items()
    ]
    results = run(load("drop-ball"), made.Exact(), STEPS)
    of_kind = results.table["kind"] == "asymptotic_error"
    shared = results.table[of_kind & results.table["metric"].isin(ends)].sort_values("metric", ascending=False).reset_index(drop=True)
    table = shared.assign(**pd.DataFrame(rows))
    found = causes(replace(results, table=table), "exact").parameters
    assert ("gravity" in [wrong.parameter.name for wrong in found]) == named


def test_cause_with_a_bounce_that_does_not_occur_is_excluded():
    """Without gravity a ball keeps its energy and its height, as with a restitution of 1."""
    hovering = Made(title="hovering", change=with_gravity(np.zeros((3, 3))))
    found = causes(run([lasting("drop-ball")], hovering, STEPS), "hovering")
    assert not found.parameters
    assert [fault.message for fault in found.faults if "restitution" in fault.message] == []
    assert "gravity is omitted" in {fault.message for fault in found.faults}


def test_moments_that_no_body_has_explain_no_error():
    """The largest moment of a thin plate is almost the sum of the other two."""
    plate = load({"duration": 1.0, "body": {"shape": "box", "half_extents": [0.3, 0.001, 0.2], "mass": 1.0}})
    [about_y] = [parameter for parameter in PARAMETERS if parameter.name == "moment of inertia about y"]
    with pytest.raises(DropspinError, match="no body has the moments of inertia"):
        about_y.change(plate, 0.01)
    assert about_y.change(plate, -0.01).body.inertia_tensor[1, 1] == pytest.approx(0.99 * plate.body.inertia_tensor[1, 1])


def test_changes_of_mass_and_of_size_keep_the_products_of_inertia():
    inertia = ((0.004, 0.001, 0.0005), (0.001, 0.004, 0.0008), (0.0005, 0.0008, 0.004))
    box = {"shape": "box", "half_extents": [0.1, 0.08, 0.06], "mass": 1.0, "inertia": inertia}
    start, floor = {"position": [0.0, 1.0, 0.0]}, {"restitution": 0.5, "friction": "none"}
    scene = load({"duration": 1.0, "body": box, "start": start, "floor": floor, "gravity": {"acceleration": [0.0, -9.8, 0.0]}})
    [mass] = [one for one in PARAMETERS if one.name == "mass"]
    np.testing.assert_array_equal(mass.change(scene, 0.1).body.inertia_tensor, inertia)
    of_faults = mistakes.PARAMETERS["inertia"]
    np.testing.assert_array_equal(
        of_faults["inertia is twice as large, relative to the mass"](scene).body.inertia_tensor, 2.0 * np.array(inertia)
    )
    [without] = [change for words, change in of_faults.items() if words.startswith("products of inertia are omitted")]
    np.testing.assert_array_equal(without(scene).body.inertia_tensor, 0.004 * np.eye(3))


def test_fault_is_found_beside_a_body_for_which_it_is_impossible():
    """A body with a displaced centre of mass cannot be a uniform solid."""
    body = {"shape": "box", "mass": 2.0, "half_extents": [0.05, 0.03, 0.02], "inertia": [0.002, 0.003, 0.004]}
    spin = {"duration": 0.5, "start": {"angular_velocity": [0.5, 5.0, 1.0]}}
    displaced = load({"name": "displaced", **spin, "body": {**body, "center_of_mass": [0.0, 0.0, 0.004]}})

    def as_solid(scene):
        return scene if any(scene.body.center_of_mass) else with_values(scene, "body", inertia="solid")

    results = run([load({"name": "plain", **spin, "body": body}), displaced], Made(title="solid", change=as_solid), STEPS)
    assert "inertia is that of the solid shape for every scene" in [fault.message for fault in causes(results, "solid").faults]


def test_cause_with_which_the_exact_solution_ends_at_once_explains_nothing():
    """A box that starts just above the floor would be below it if it were twice as large."""
    turned = [-0.42504026148056717, 0.10642986962035506, 0.8305845078704521, 0.34371912117123177]
    spin = [0.22763970144050116, 0.3568204760763351, 0.15517512976495293]
    scene = load(
        {
            "duration": 2.0,
            "body": {"shape": "box", "mass": 1.0, "half_extents": [0.13575393696063415, 0.17184731602586736, 0.12686801406673318]},
            "start": {"position": [0.0, 0.4379931077872551, 0.0], "orientation": turned, "angular_velocity": spin},
            "gravity": {"acceleration": [0.0, -5.095086225478851, 0.0]},
            "floor": {"restitution": 0.0018427941945932558, "friction": "none"},
        }
    )
    [twice] = [fault for fault in mistakes.FAULT_MODELS if fault.message.startswith("the body is twice as large")]
    assert np.isnan(_caused(scene, twice, 2e-3).error("energy_drift"))


def test_restitution_above_1_is_no_cause():
    """No scene can have it; of 0.9999, a size that is small enough is tried."""
    elastic = with_values(load("drop-ball"), "floor", restitution=1.0)
    assert np.isnan(_caused(elastic, _with(PARAMETERS[0], 1e-3), 2e-3).error("bounce_height_error"))
    assert _caused(elastic, _with(PARAMETERS[0], -1e-3), 2e-3).error("bounce_height_error") == pytest.approx(-2e-3, rel=0.01)
    nearly = with_values(load("drop-ball"), "floor", restitution=0.9999)
    failed = pd.DataFrame([{"metric": "restitution_error", "unit": "1", "value": 5e-5, "lower": 4.9e-5, "upper": 5.1e-5}])
    assert list(_sizes(nearly, PARAMETERS[0], failed, 2e-3)) == pytest.approx([5e-5, -5e-5], rel=0.01)


def test_engine_that_does_not_repeat_its_motion_has_no_cause_and_a_sentence_on_it():
    """Every second simulation has a restitution that is 2 % too low: on the mean, 1 %."""
    runs = count()
    alternating = Made(title="alternating", change=with_restitution(lambda e: 0.98 * e if next(runs) % 2 else e))
    results = run([lasting("drop-ball"), lasting("fall-spin")], alternating, STEPS)
    assert overview(results).conclusion[0] == (
        "alternating does not repeat its own motion in drop-ball, so that a part of its errors is random; "
        "dropspin symmetries shows where it differs."
    )
    assert causes(results, "alternating").parameters == []
    [row] = results.table[results.table["basis"] == "not_repeated"].to_dict("records")
    assert (row["scene"], row["dt"], row["verdict"], row["metric"]) == ("drop-ball", STEPS[0], "limited", "")


def test_engine_whose_rounding_differs_from_run_to_run_has_a_cause():
    """As of threads that add in another order."""
    noise = np.random.default_rng(1)
    engine = Made(
        title="threaded",
        change=with_restitution(lambda e: 0.98 * e),
        distort=lambda rows, times, dt, truth: rows * (1.0 + 2e-16 * noise.integers(-1, 2, rows.shape)),
    )
    assert consistent_with(engine, "drop-ball", "fall-spin") == "Possible cause of the asymptotic errors: restitution 2 % too low."
