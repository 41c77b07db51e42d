"""Which changed settings explain an error: planted changes of one and of two settings, and functions of which the shares are known."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import pytest
from support.fault_suite import with_restitution
from support.sampled import Sampled, undistorted

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.engines.options import NumericOption
from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.engines.settings import Setting
from dropspin.comparisons.running.ablation import explaining, shares, written_out
from dropspin.comparisons.running.driving import simulate
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.comparisons.running.run import measure, run
from dropspin.reports.stories.failures import settings_that_explain as settings_of
from dropspin.scenarios import load

pytestmark = pytest.mark.filterwarnings("ignore:contacts slip at", "ignore:in maximal coordinates")


def settings_that_explain(label, scene_name, metric, duration=None):
    """By setting, its share of the error of an engine, from one start at 1 ms."""
    scene = load(scene_name)
    scene = scene.model_copy(update={"duration": duration or scene.duration})
    entry = engine_entry(label)
    options = written_out(entry, scene, 1e-3)
    written = type(entry.adapter)(options)
    changed = [name for name in options if name not in written.calibrated.options]
    return explaining(written, dict.fromkeys(changed), lambda chosen: measure(scene, simulate(scene, chosen, 1e-3))[metric])


BOUNCE, DRIFT = ("drop-ball", "bounce_height_error", 0.9), ("fall-spin", "energy_drift", 0.3)


@pytest.mark.extended
@pytest.mark.parametrize(
    ("planted", "harmless", "where"),
    [
        ("pybullet[floor_restitution=0]", "", BOUNCE),
        ("pybullet[linearDamping=0.04]", "frictionERP=0.2,erp=0.2", DRIFT),
        ("pybullet[restitutionVelocityThreshold=6]", "contactSlop=1e-5,globalCFM=0", BOUNCE),
        ("pybullet[lateralFriction=0.1]", "deterministicOverlappingPairs=0,warmStartingFactor=0.2", ("slide-box", "position_error", 0.5)),
        ("pybullet[maxJointVelocity=20]", "coordinates=multibody,numSolverIterations=400", ("spin-principal-50", "energy_error", 0.2)),
        ("mujoco[solref=-1000 0]", "iterations=50,ls_iterations=20", BOUNCE),
        ("mujoco[cone=pyramidal]", "noslip_iterations=5", ("slide-box-askew", "position_error", 1.0)),
        ("mujoco[solimp=0.9 0.95 0.001 0.5 2]", "island=enable,warmstart=disable", ("drop-box-edge", "bounce_height_error", None)),
        # Two at a time.
        ("pybullet[linearDamping=0.02,angularDamping=0.02]", "contactERP=0.2", DRIFT),
        ("pybullet[floor_restitution=0,restitutionVelocityThreshold=6]", "contactSlop=1e-5", BOUNCE),
        ("pybullet[floor_restitution=0.5,linearDamping=0.1]", "erp=0.2", BOUNCE),
        ("mujoco[density=1.2,viscosity=0.5]", "cone=elliptic", DRIFT),
    ],
)
def test_planted_settings_are_named_and_no_others(planted, harmless, where):
    """Beside settings that differ too and matter nothing there."""
    name, _, listed = planted.removesuffix("]").partition("[")
    found = settings_that_explain(f"{name}[{','.join(filter(None, [listed, harmless]))}]", *where)
    assert {one for names in found for one in names.split(", ")} == set(listed.split(","))
    assert sum(found.values()) == pytest.approx(1.0, abs=0.02)


def test_default_profiles_are_explained():
    """MuJoCo's by its spring, which its cone or its impedance softens; Bullet's in flight by damping."""
    found = settings_that_explain("mujoco[profile=default]", "drop-box-edge", "bounce_height_error")
    assert found == {"solref=0.02 1, solimp=0.9 0.95 0.001 0.5 2": pytest.approx(1.0, abs=0.01)}
    found = settings_that_explain("pybullet[profile=default]", *DRIFT)
    assert list(found) == ["linearDamping=0.04", "angularDamping=0.04"]
    assert sum(found.values()) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.extended
@pytest.mark.parametrize(
    ("name", "scene_name", "dt"),
    [
        *(("mujoco", "drop-ball", 2e-3), ("mujoco", "drop-box-edge", 2e-3), ("mujoco", "spin-damped", 2e-3), ("mujoco", "slide-box", 4e-3)),
        *(("pybullet", "drop-ball", 2e-3), ("pybullet", "drop-box-edge", 2e-3), ("pybullet", "spin-damped", 2e-3)),
        *(("pybullet", "slide-box", 4e-3), ("rapier", "drop-ball", 2e-3), ("rapier", "spin-damped", 2e-3), ("rapier", "slide-box", 4e-3)),
        *((name, "turn-box-rough", 4e-3) for name in ("dart", "drake")),
    ],
)
def test_default_profile_is_the_calibrated_one_with_its_settings_written_out(name, scene_name, dt):
    """The same motion: so the list of settings is complete. Bullet's own damping is in single precision."""
    entry, scene = engine_entry(f"{name}[profile=default]"), load(scene_name)
    written = engine(f"{name}").without([])
    written = type(written)(written_out(entry, scene, dt))
    assert written.options.keys() & {"profile"} == set()
    default, again = (simulate(scene, chosen, dt).states for chosen in (entry.adapter, written))
    assert again == pytest.approx(default, abs=1e-5 if name == "pybullet" else 0.0)


def test_shares_of_known_functions():
    def of(error, *changed, partly=False):
        return shares(lambda reverted: error(*(name not in reverted for name in changed)), changed, partly=partly)

    assert of(lambda a, b, c: 0.7 * a + 0.3 * b + 0.0 * c, "a", "b", "c") == {("a",): pytest.approx(0.7), ("b",): pytest.approx(0.3)}
    assert of(lambda a, b: 0.95 * a + 0.05 * b, "a", "b") == {("a",): pytest.approx(0.95), ("b",): pytest.approx(0.05)}
    assert of(lambda a, b, c: a or b, "a", "b", "c") == {("a", "b"): 1.0}  # one hides the other
    assert of(lambda a, b, c: a and b, "a", "b", "c") == {("a",): 1.0, ("b",): 1.0}  # alternatives
    assert of(lambda a, b, c: a + b + c, "a", "b", "c", partly=True) == {}  # three
    overshot = {("a",): pytest.approx(0.86)}  # without it, an error of the other sign is left
    assert of(lambda a, *others: 1.14 * a - 0.035 * sum(others), *"abcde", partly=True) == overshot
    assert of(lambda a, *others: 1.14 * a - 0.035 * sum(others), *"abcde") == {}
    assert of(lambda a, b: 1.0, "a", "b") == {}  # none of them
    assert of(lambda a, b: float("nan") if not a else 1.0, "a", "b") == {}  # it does not reach an end


@pytest.mark.extended
def test_run_states_the_settings_that_explain_a_failure():
    ball = load("drop-ball").model_copy(update={"duration": 0.9})
    results = run(ball, ["pybullet[floor_restitution=0,linear_damping=0.04]", "pybullet"], [2e-3], quick=True)
    found = results.table[results.table["kind"] == "setting"].set_index("truth")["value"]
    assert list(found.index) == ["floor_restitution=0", "linearDamping=0.04"]
    assert found.sum() == pytest.approx(1.0, abs=1e-9)
    assert not list(settings_of(run(ball, "mujoco[kappa=1,solimp=0.9 0.95 0.001 0.5 2]", [2e-3], quick=True), "mujoco"))
    label = "pybullet[floor_restitution=0,linearDamping=0.04]"
    assert list(settings_of(results, label)) == [
        "drop-ball: floor_restitution=0 explains 97.9 % of the bounce height error at 2 ms, and linearDamping=0.04 2.05 %."
    ]
    assert not list(settings_of(results, "pybullet"))


def test_settings_are_stated_where_errors_fail_as_dt_falls_alone():
    """A scene without `[[expect]]` has no bound on these errors at a time step."""
    scene = load("fall-spin").model_copy(update={"expect": (), "duration": 0.3})
    table = run(scene, ["pybullet[linear_damping=0.04]"], [4e-3, 2e-3, 1e-3]).table
    assert set(table[table["verdict"] == "failed"]["kind"]) == {"asymptotic_error"}
    found = table[table["kind"] == "setting"].set_index("truth")["value"].to_dict()
    # The rest of the energy error at 1 ms is discretisation error.
    assert found == {"profile=calibrated": pytest.approx(0.71, abs=0.01), "linearDamping=0.04": pytest.approx(1.0)}


def test_settings_that_act_against_each_other_have_shares_of_both_signs():
    """An error of 1 of which one setting makes 1.04, and another takes 0.04 away."""
    parts = {"density": 1.04, "integrator": -0.04, "other": 0.0}
    found = shares(lambda reverted: sum(part for name, part in parts.items() if name not in reverted), list(parts))
    assert found == {("density",): pytest.approx(1.04), ("integrator",): pytest.approx(-0.04)}


@dataclass(frozen=True)
class Losing(Engine):
    """An exact engine of which the model, and by default settings, take shares of the restitution; it reports what `reported` returns."""

    model: float = 0.0
    reported: Callable[[Engine], dict[str, object]] = lambda engine: {}

    name = "losing"
    choices: ClassVar = {"profile": ("calibrated", "default")}
    settings: ClassVar = {
        "soft": Setting(0.05, "takes this share", calibrated=0.0),
        "slow": Setting(0.005, "takes this share", calibrated=0.0),
        "rule": Setting("none", "has no effect", calibrated="one", values=("none", "one", "two")),
    }

    def prepare(self, scene, dt):
        return self.losing(scene, dt)

    def losing(self, scene, dt):
        lost = self.model + sum(float(self.option(name)) for name in ("soft", "slow"))
        simulation = Sampled(scene, dt, with_restitution(lambda e: (1.0 - lost) * e)(scene), undistorted)
        simulation.settings = self.reported(self)
        return simulation


def of_default_profile(**losing):
    """By setting, its share of the bounce height error in drop-ball, and the causes of what remains as dt → 0; with the sentences."""
    ball = load("drop-ball").model_copy(update={"duration": 0.8})
    given = Losing({"profile": "default"}, **losing)
    results = run(ball, [given, given.calibrated], [4e-3, 2e-3, 1e-3], quick=True)
    table = results.table[results.table["engine"] == given.label]
    causes = set(table[(table["kind"] == "asymptotic_error") & (table["verdict"] == "failed")]["cause"])
    return table[table["kind"] == "setting"].set_index("truth")["value"].to_dict(), causes, list(settings_of(results, given.label))


def some(engine):
    return {"slow": float(engine.option("slow"))}


def others(engine):
    """The number of a word in an enumeration, -1 and null for what is off: no values of the options."""
    off = float(engine.option("slow")) == 0.0
    return {"rule": Losing.settings["rule"].values.index(engine.option("rule")), "slow": -1.0 if off else 0.005, "soft": None}


@pytest.mark.parametrize("reported", [lambda engine: {}, some, others])
def test_settings_count_that_an_engine_does_not_report_or_in_other_words(reported):
    found, causes, [sentence] = of_default_profile(reported=reported)
    assert found == {"soft=0.05": pytest.approx(0.91, abs=0.01), "slow=0.005": pytest.approx(0.09, abs=0.01)}
    assert causes == {"setting"}
    assert sentence.startswith("drop-ball: soft=0.05 explains 9")


def test_share_of_settings_beside_a_model_error_is_stated():
    """Of 0.085 of the restitution, the model takes 0.03; of the height, as 1 - (1 - 0.085)² to 1 - (1 - 0.03)²."""
    found, causes, [sentence] = of_default_profile(model=0.03)
    assert found.pop("profile=calibrated") == pytest.approx(1.0 - (1.0 - 0.97**2) / (1.0 - 0.915**2), abs=1e-3)
    assert found == {"soft=0.05": pytest.approx(0.91, abs=0.01), "slow=0.005": pytest.approx(0.09, abs=0.01)}
    assert "calibrated settings take away 63.7 % of the bounce height error at 1 ms; soft=0.05 explains 90" in sentence
    assert "% of this, and slow=0.005 9" in sentence
    assert causes == {"setting"}
    opposite, _, [sentence] = of_default_profile(model=-0.01)
    assert opposite["profile=calibrated"] == pytest.approx(1.0 + (1.01**2 - 1.0) / (1.0 - 0.955**2), abs=1e-3)
    assert "so that an error of the other sign is left" in sentence


def test_settings_of_which_no_two_explain_an_error_are_stated_together():
    """Three that take a third each."""

    class Thirds(Losing):
        settings: ClassVar = {name: Setting(0.02, "takes this share", calibrated=0.0) for name in ("soft", "slow", "rest")}

        def prepare(self, scene, dt):
            return replace(self, model=float(self.option("rest"))).losing(scene, dt)

    ball = load("drop-ball").model_copy(update={"duration": 0.8})
    results = run([ball, ball.model_copy(update={"name": "again"})], [Thirds({"profile": "default"})], [1e-3], quick=True)
    found = results.table[results.table["kind"] == "setting"]
    assert list(zip(found["scene"], found["truth"], strict=True)) == [(name, "profile=calibrated") for name in ("drop-ball", "again")]
    assert list(found["value"]) == pytest.approx([1.0, 1.0], abs=0.01)
    assert list(settings_of(results, "losing[profile=default]")) == [
        f"{name}: calibrated settings take away 100 % of the bounce height error at 1 ms; resetting one or two of them does not take away "
        "90 % of this."
        for name in ("drop-ball", "again")
    ]


def test_option_that_a_default_profile_changes_is_reset_too():
    """An adapter may take another of the values of an option by default."""

    class Choosing(Losing):
        choices: ClassVar = {"profile": ("calibrated", "default"), "solver": ("exact", "rough")}

        def option(self, name):
            return "rough" if name == "solver" and self.is_default else super().option(name)

        def prepare(self, scene, dt):
            return replace(self, model=0.04 * (self.option("solver") == "rough")).losing(scene, dt)

    ball = load("drop-ball").model_copy(update={"duration": 0.8})
    found = run(ball, [Choosing({"profile": "default"})], [1e-3], quick=True).table.query("kind == 'setting'")
    assert dict(zip(found["truth"], found["value"], strict=True)) == {"soft=0.05, solver=rough": pytest.approx(0.945, abs=0.01)}


def test_number_that_the_adapter_adds_is_reset_too_unless_it_sets_the_accuracy():
    """Such as `kappa` of MuJoCo's adapter."""

    class Numbered(Losing):
        numbers: ClassVar = {name: NumericOption(0.0, 0.0, 1.0) for name in ("damper", "tolerance")}
        accuracy: ClassVar = {"tolerance": (0.1, 0.01, 0.0)}

        def prepare(self, scene, dt):
            return replace(self, model=sum(float(self.option(name)) for name in self.numbers)).losing(scene, dt)

    ball = load("drop-ball").model_copy(update={"duration": 0.8})
    found = run(ball, [Numbered({"damper": "0.1"}), Numbered({"tolerance": "0.1"})], [1e-3], quick=True).table.query("kind == 'setting'")
    assert list(zip(found["engine"], found["truth"], strict=True)) == [("losing[damper=0.1]", "damper=0.1")]
    assert list(found["value"]) == pytest.approx([1.0], abs=0.01)


def test_settings_that_make_less_than_half_of_an_error_are_not_its_cause():
    assert of_default_profile(model=0.06) == ({}, {"model"}, [])


def test_no_setting_explains_what_has_no_option():
    """A computed setting that is not reported, so that nobody knows its value."""

    class Hidden(Losing):
        settings: ClassVar = Losing.settings | {"soft": Setting(0.05, "takes this share", is_computed=True)}

        def option(self, name):
            return "0" if name == "soft" and not self.is_default else super().option(name)

        def prepare(self, scene, dt):
            simulation = super().prepare(scene, dt)
            simulation.settings = {"soft": 0.0}
            return simulation

    ball = load("drop-ball").model_copy(update={"duration": 0.8})
    table = run(ball, [Hidden({"profile": "default"})], [1e-3], quick=True).table
    assert table[table["verdict"] == "failed"]["metric"].nunique() > 2
    assert not (table["kind"] == "setting").any()


def test_friction_in_the_direction_of_slip_is_a_setting_of_mujoco():
    """Bodies without contact pairs have it as 0 0; an orientation error of 3.1 rad is not the one to explain, as none can be larger."""
    label = "mujoco[profile=default,cone=elliptic,solref=0 -1800,solimp=0.9999 0.9999 0.001 0.5 2]"
    table = run("drop-ball-backspin", [label], [1e-3], quick=True).table
    found = table[table["kind"] == "setting"]
    assert found[["metric", "truth"]].to_dict("split")["data"] == [["position_error", "solreffriction=0 0"]]
    assert list(found["value"]) == pytest.approx([1.0], abs=1e-3)


@pytest.mark.extended
def test_setting_that_acts_only_once_others_are_reset_is_left_out():
    """With `override`, contact pairs have no friction of their own: then it has no effect, and it is not among what is reset."""
    table = run("drop-ball-backspin", ["mujoco[profile=default,override=enable]"], [1e-3], quick=True).table
    assert list(table[table["kind"] == "setting"]["truth"]) == ["cone=pyramidal, override=enable"]


def test_undefined_error_has_no_share():
    found = shares(lambda reverted: float("nan") if reverted == {"a"} else 1.0 - 0.5 * len(reverted), ["a", "b"])
    assert found == {("a", "b"): pytest.approx(1.0)}
