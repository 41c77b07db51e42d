"""`import dropspin as ds`: what a notebook calls first, and what wrong arguments end in."""

import dataclasses
import inspect
import re
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from support import engines as made

import dropspin as ds

FALL = {"duration": 0.5, "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0}, "gravity": {"acceleration": [0.0, -9.8, 0.0]}}


@pytest.fixture(scope="module")
def results():
    """One scene, one engine, one time step."""
    return ds.run("drop-ball", "mujoco", dt=4e-3)


def test_run_takes_one_or_several_names_or_objects(results):
    """The rows are the same, but for the time they took."""
    again = ds.run([ds.load("drop-ball")], [ds.engine("mujoco")], dt=[4e-3])
    pd.testing.assert_frame_equal(again.table.drop(columns="time_per_step"), results.table.drop(columns="time_per_step"))


def test_a_mapping_and_a_path_are_scenes(tmp_path):
    """For `run`, `simulate` and `measure`; a file's scene has its name."""
    ball = FALL | {"start": {"position": np.array([0.0, 1.0, 0.0])}}
    (tmp_path / "ball.toml").write_text(
        "duration = 0.5\nbody = {shape = 'sphere', radius = 0.1, mass = 1.0}\nstart = {position = [0, 1, 0]}\n"
        "gravity = {acceleration = [0, -9.8, 0]}\n"
    )
    found = ds.run([ball, tmp_path / "ball.toml"], "mujoco", dt=1e-2).table.set_index("scene")
    assert set(found.index) == {"scene", "ball"}
    np.testing.assert_array_equal(found.loc["scene", "value"], found.loc["ball", "value"])
    assert set(ds.run(ball, "mujoco", dt=1e-2).table["scene"]) == {"scene"}
    errors = ds.measure(ball, ds.simulate(ball, "mujoco", dt=1e-2))
    assert errors["energy_error"] == found.loc["scene"].set_index("metric").loc["energy_error", "value"]


def test_run_measures_every_combination_at_the_default_time_steps():
    found = ds.run(["spin-principal", "fall-spin"], ["mujoco", "pybullet"])
    measured = found.table.dropna(subset=["dt"])
    combinations = measured.loc[~measured["engine"].str.contains(" "), ["scene", "engine", "dt"]].drop_duplicates()
    own = combinations[combinations["engine"].isin(found.engines)]
    assert len(own) == 2 * 2 * len(ds.DEFAULT_DTS)


def test_the_table_has_a_row_for_each_measurement(results):
    assert {"scene", "engine", "metric", "dt", "value", "verdict", "reason", "tolerance"} <= set(results.table.columns)
    assert set(results.table["scene"]) == {"drop-ball"}
    assert set(results.table["engine"]) == {"mujoco"}
    assert set(results.table["dt"]) == {4e-3}


def test_repr_of_results_has_scenes_engines_steps_and_checks(results):
    passed = (results.table["verdict"] == "passed").sum()
    assert repr(results) == f"<Results: drop-ball with mujoco at dt = 4 ms: {passed} checks passed, 0 failed>"


def table_of(html):
    """The table in a text that is well-formed as XML, its first column as index."""
    header, *rows = ([cell.text for cell in row] for row in ElementTree.fromstring(f"<div>{html}</div>").iter("tr"))
    return pd.DataFrame([row[1:] for row in rows], index=[row[0] for row in rows], columns=header[1:])


@pytest.mark.extended
def test_notebook_shows_status_and_leading_error_of_each_engine():
    """Scenes by engines; also of a scene without an exact solution, an engine that declines it, and names with markup."""
    named = ds.load(FALL | {"name": "<b>fall</b>"})
    unsolved = ds.load("drop-box-flat")
    sideways = unsolved.starting_at(unsolved.initial_state + np.eye(13)[7])
    sideways = sideways.model_copy(update={"floor": unsolved.floor.model_copy(update={"friction": 0.3}), "expect": ()})
    found = ds.run([named, sideways, ds.load("spin-principal")], ["wang", "mujoco"], dt=[8e-3, 4e-3, 2e-3])
    shown = table_of(found._repr_html_())
    assert list(shown.columns) == ["leading error", "wang", "mujoco"]
    assert list(shown["leading error"]) == ["position error", "–", "orientation error"]
    for scene, unit in (("<b>fall</b>", "m"), ("spin-principal", "rad")):
        for engine in found.engines:
            status, error, shown_unit = re.fullmatch(r"(.+), (\S+) (\w+)", shown.loc[scene, engine]).groups()
            metric = f"{shown.loc[scene, 'leading error'].replace(' ', '_')}"
            rows = found.table[(found.table["scene"] == scene) & (found.table["engine"] == engine) & (found.table["metric"] == metric)]
            [value] = rows.loc[rows["dt"] == 2e-3, "value"]
            assert float(error) == pytest.approx(abs(value), rel=0.05)
            assert (status, shown_unit) == ("passed", unit)
    assert shown.loc["drop-box-flat", "wang"] == "not judged (declined)"
    assert shown.loc["drop-box-flat", "mujoco"] == "not judged (no exact solution)"
    assert "<b>" not in found._repr_html_()
    assert found.leading_errors("drop-box-flat").empty
    with pytest.raises(ds.UnknownName, match=r"'spin-principle' is unknown\. Did you mean 'spin-principal'"):
        found.leading_errors("spin-principle")


def test_a_trajectory_as_a_table(results):
    """A column for each component, the time as index."""
    motion = ds.simulate("drop-ball", "mujoco", dt=1e-2)
    frame = motion.to_frame()
    assert frame.index.name == "t"
    np.testing.assert_array_equal(frame.index, motion.t)
    np.testing.assert_array_equal(frame.to_numpy(), motion.states)
    assert list(frame.columns) == [
        *("position_x", "position_y", "position_z"),
        *("orientation_x", "orientation_y", "orientation_z", "orientation_w"),
        *("velocity_x", "velocity_y", "velocity_z"),
        *("angular_velocity_x", "angular_velocity_y", "angular_velocity_z"),
    ]
    np.testing.assert_array_equal(frame["angular_velocity_z"], motion.angular_velocity[:, 2])


def test_repr_of_a_trajectory_is_one_line():
    motion = ds.truth_for(ds.load("spin-principal"))(np.linspace(0.0, 0.5, 6))
    assert repr(motion) == "<Trajectory: 6 states from t = 0 s to 0.5 s>"
    assert repr(motion[:0]) == "<Trajectory: no states>"


@pytest.mark.parametrize(
    ("errors", "start"),
    [
        ([0.025, 0.015, 0.01, 0.0075], "Model error: the asymptotic error is 0.005 (95 % interval 0.00"),
        ([0.008, 0.004, 0.002, 0.001], "Discretisation error: the asymptotic error is "),
        ([0.008, np.nan, np.nan, 0.001], "Unresolved error: only 2 of 4 time steps are usable; extrapolation needs three that span a"),
        ([0.0, 0.0, 0.0, 0.0], "Rounding error: the asymptotic error is 0 (95 % interval 0 to 0)."),
    ],
)
def test_repr_of_an_error_budget_is_a_sentence(errors, start):
    """The cause, the asymptotic error with its interval, and the order if there is one."""
    found = ds.error_budget([8e-3, 4e-3, 2e-3, 1e-3], errors)
    assert repr(found).startswith(start)
    assert repr(found).endswith(".")
    assert (f", the order {found.order:.2f} (" in repr(found)) == np.isfinite(found.order) == (found.cause in ("model", "discretisation"))


def test_an_engine_may_have_its_name_from_its_constructor():
    class Named(made.Exact):
        def __init__(self, name):
            super().__init__()
            object.__setattr__(self, "name", name)

    assert ds.run("spin-principal", Named("flyer"), dt=0.01).engines == ("flyer",)
    with pytest.raises(ds.DropspinError, match=r"Named\.name is 'wang', which is a built-in engine"):
        ds.run("spin-principal", Named("wang"), dt=0.01)


@pytest.mark.parametrize("dt", [np.float32(0.01), [np.float32(0.01)], np.array([0.01])])
def test_a_time_step_may_be_a_number_of_numpy(dt):
    assert ds.run("spin-principal", "wang", dt=dt).table["dt"].dropna().unique() == pytest.approx([0.01])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: ds.load("drop-bal"),
            "scene 'drop-bal' is not in the catalogue and no file of that name exists. Did you mean 'drop-ball'?",
        ),
        (lambda: ds.load(3), "scene: got 3 (int); give a catalogue name, a path or a mapping."),
        (lambda: ds.load(None), "scene: got None (NoneType); give a catalogue name, a path or a mapping."),
        (lambda: ds.run("mujoco", "drop-ball"), "scene 'mujoco' is an engine; give the scene first and the engine second."),
        (lambda: ds.run("mujoco[integrator=rk4]", "drop-ball"), "scene 'mujoco[integrator=rk4]' is an engine; give the scene first"),
        (lambda: ds.simulate("mujoco", "drop-ball", 1e-2), "scene 'mujoco' is an engine; give the scene first and the engine second."),
        (
            lambda: ds.run(3, "mujoco"),
            "scenes: got 3 (int); give a Scenario, a name such as 'drop-ball', a file's path, a mapping, or a list of",
        ),
        (lambda: ds.run([3], "mujoco"), "scene: got 3 (int); give a name such as 'drop-ball', a file's path, a mapping, or a Scenario."),
        (lambda: ds.run("drop-ball", None), "engines: got None (NoneType); give an Engine, a name such as 'mujoco', or a list of these."),
        (lambda: ds.run("drop-ball", [3]), "engine: got 3 (int); give a name such as 'mujoco', or an Engine."),
        (
            lambda: ds.run("drop-ball", made.engine_with("a b", None)),
            "engine: Distorted.name is 'a b'; give it a name for results, of letters",
        ),
        (
            lambda: ds.run("drop-ball", made.engine_with("wang", None)),
            "engine: Distorted.name is 'wang', which is a built-in engine; results need",
        ),
        (lambda: ds.run("drop-ball", "mujocco"), "engine 'mujocco' is unknown. Did you mean 'mujoco'?"),
        (lambda: ds.run("drop-ball", "mujoco", dt="fast"), "dt: got 'fast' (str); give a number of seconds, or a list of these."),
        (lambda: ds.run("drop-ball", "mujoco", dt=["fast"]), "dt: got 'fast' (str); a time step is a number of seconds."),
        (lambda: ds.run("drop-ball", "mujoco", dt=True), "dt: got True (bool); a time step is a number of seconds."),
        (lambda: ds.run("drop-ball", "mujoco", dt=[]), "dt: got none; give at least one."),
        (lambda: ds.run({"duration": 1.0}, "mujoco"), "scene['body']: missing; it has no default."),
        (
            lambda: ds.run([{"name": "a"} | FALL] * 2, "mujoco"),
            "two scenes have the same name (a, a); rename a file, or give a mapping a 'name'.",
        ),
        (lambda: ds.run([], "mujoco"), "scenes: got none; give at least one."),
        (lambda: ds.truth_for("drop-ball"), "scene: got 'drop-ball' (str); give a Scenario, as load() returns it."),
        (lambda: ds.measure("drop-ball", 3), "motion: got a int; give a Trajectory, such as simulate() returns."),
        (lambda: ds.load_results("absent"), "absent: not the folder of a run, or damaged (absent/run.json: No such file"),
    ],
)
def test_a_wrong_argument_ends_in_one_sentence(call, message):
    """Which argument, what was given, what to give; of type DropspinError."""
    with pytest.raises(ds.DropspinError) as error:
        call()
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


def callables():
    """The public functions and classes, and the public methods of the classes, by name."""
    found = {name: getattr(ds, name) for name in ds.__all__ if callable(getattr(ds, name))}
    classes = {name: public for name, public in found.items() if inspect.isclass(public)}
    methods = ((f"{name}.{part}", getattr(public, part)) for name, public in classes.items() for part in vars(public) if part[0] != "_")
    without_signature = {name for name, public in classes.items() if issubclass(public, Exception)}
    return {name: public for name, public in (found | dict(methods)).items() if callable(public) and name not in without_signature}


@pytest.mark.parametrize("name", callables())
def test_docstring_describes_every_argument_and_what_is_returned(name):
    """Of a function its arguments and what it returns; of a dataclass its fields; a method has a text."""
    public = callables()[name]
    text = inspect.getdoc(public)
    assert text
    described = set(re.findall(r"^ +(\w+): ", text, re.MULTILINE))
    if dataclasses.is_dataclass(public):
        assert {field.name for field in dataclasses.fields(public)} <= described
    elif hasattr(public, "_fields"):
        assert set(public._fields) <= described
    elif hasattr(public, "model_fields"):
        assert set(public.model_fields) == described
    elif not inspect.isclass(public) and "." not in name:
        signature = inspect.signature(public)
        assert set(signature.parameters) <= described
        assert ("Returns:" in text) == (signature.return_annotation is not None)


@pytest.mark.parametrize("name", callables())
def test_signature_shows_no_anonymous_function_and_no_address(name):
    """As `help` prints it."""
    assert not re.search("lambda|0x", str(inspect.signature(callables()[name])))
