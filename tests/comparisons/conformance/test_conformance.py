"""`conform`: correct engines pass, the documented adapter among them, and each planted fault is named.

The file is longer than 300 lines because it lists every fault that is planted, beside the message that must name it.
"""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from support import engines as made

from dropspin.comparisons.conformance import motions, timing
from dropspin.comparisons.conformance.checks import CHECKS, conform, run_check
from dropspin.comparisons.conformance.outcomes import CheckFailed
from dropspin.comparisons.conformance.probes import PROBES
from dropspin.comparisons.conformance.timing import check_velocity_lag
from dropspin.comparisons.engines.base import KnownLimitation, Simulation
from dropspin.comparisons.engines.pybullet_engine import PyBullet
from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.engines.wang import Wang
from dropspin.comparisons.running import timing as clock_of_engines
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.run import run
from dropspin.comparisons.running.timing import time_steps
from dropspin.scenarios import load
from dropspin.scenarios.errors import UnknownName
from dropspin.scenarios.model import Gravity

PAGE = Path(__file__).parents[3] / "docs" / "bring-your-engine.md"
ADAPTER = re.search(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[1]


def documented(*changes):
    """The page's adapter, with some of its text replaced."""
    text = ADAPTER
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    namespace = {"__name__": "my_module"}
    exec(text, namespace)
    return namespace["Flyer"]()


def not_passed(engine_, *checks):
    """Outcome and message of each check that is neither passed nor declined; run in this process, which takes no time to start."""
    found = [run_check(EngineEntry(engine_.label, engine_), check) for check in checks or CHECKS]
    return {one.check: (one.outcome, one.message) for one in found if one.outcome not in ("passed", "declined")}


@pytest.fixture
def without_explanations(monkeypatch):
    """Leave out the search through pairs of faults for tests that assert on outcomes only."""
    monkeypatch.setattr(motions, "explain_motion", lambda *asked: None)


@pytest.mark.extended
def test_documented_adapter_passes_and_is_short():
    assert not_passed(documented()) == {}
    assert len([line for line in ADAPTER.splitlines() if line.strip()]) <= 40


ELLIPSOID = {"striking ellipsoid"}
STRIKES = {"corner", "displaced corner", "spinning corner", "striking capsule", "striking cylinder", "striking mesh", *ELLIPSOID}


@pytest.mark.extended
@pytest.mark.parametrize(
    ("name", "noted"),
    [
        ("wang", {"tumbling", "tumbling askew", *STRIKES}),
        pytest.param("wang[law=coulomb,rotation=exact]", set(), marks=pytest.mark.slow),
        pytest.param("wang[rotation=rk4]", STRIKES, marks=pytest.mark.slow),
        ("mujoco", {"slippery floor", "sliding box"}),
        pytest.param("mujoco[integrator=rk4]", set(), marks=pytest.mark.slow),
        pytest.param("mujoco[integrator=implicitfast]", {"slippery floor", "sliding box"}, marks=pytest.mark.slow),
        ("pybullet", ELLIPSOID),
        pytest.param("pybullet[coordinates=multibody]", ELLIPSOID, marks=pytest.mark.slow),
        ("rapier", set()),
        ("dart", {"slow ball", "symmetries"}),
        ("drake", set()),
    ],
)
def test_shipped_engines_pass(name, noted):
    """No check fails; the laws of Wang's method and known limitations are noted."""
    found = {one.check: one for one in conform(name) if one.outcome not in ("passed", "declined")}
    assert {check: one.outcome for check, one in found.items()} == dict.fromkeys(noted, "noted")
    if "corner" in noted:
        assert found["corner"].message == "impacts follow the note law, as the engine states"
    if "tumbling" in noted:
        assert found["tumbling"].message == "angular velocity stays constant, as without the gyroscopic term or with the inertia of a ball"


@pytest.mark.parametrize("name", ["rapier", "dart", "drake"])
def test_third_party_adapters_are_short(name):
    """An adapter takes less than 150 lines, other representations of the floor and a heavy body far away included."""
    source = Path(sys.modules[type(engine(name)).__module__].__file__)
    assert len(source.read_text(encoding="utf-8").splitlines()) < 150


def test_exact_engine_passes():
    assert not_passed(made.Exact()).keys() == {"settings"}  # it has no version


# Parts of the page's adapter, and their replacements.
READ_W = "Rotation.from_quat(q).apply(self.data.qvel[3:])", "self.data.qvel[3:]"
SET_W = "Rotation.from_quat(q).inv().apply(w)", "w"
READ_Q = "np.roll(self.data.qpos[3:], -1)", "self.data.qpos[3:]"
SET_Q = "*np.roll(q, 1)]", "*q]"
GRAVITY = "spec.option.gravity = dt, scene.acceleration"
STEP = "timestep, spec.option.gravity = dt,"
REFUSAL = 'return "only free flight without damping is mapped"'
MOMENTS = "scene.body.mass, np.diag(scene.body.inertia_tensor)"
SPUN = "Rotation.from_quat(q).apply(self"
MJ_STEP = "mujoco.mj_step(self.model, self.data, steps)"
BUILT = "self.settings ="
NOISE = "self.data.qvel[0] += np.random.default_rng().normal() * 1e-15"
STATE = "    def state(self):"
RETURN = "return np.concatenate([x, q,"
RECORD = "    def record(self, steps, every=1):\n        {}return super().record({})\n\n    def state(self):"
SINGLE = "return np.float32([*x, *q, *self.data.qvel[:3], *Rotation.from_quat(q).apply(self.data.qvel[3:])]) + np.zeros(13)"


def gravity(value):
    return GRAVITY, f"spec.option.gravity = dt, {value}"


def record(first, given):
    return STATE, RECORD.format(first, given)


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ("changes", "check", "message"),
    [
        ([READ_W], "builds what is meant", "angular velocity appears to be in the body frame; a state has it in the world frame"),
        ([READ_W, SET_W], "turning", "angular velocity appears to be in the body frame, both set and read;"),
        ([SET_W], "builds what is meant", "angular velocity appears to be in the body frame where it is set at the start"),
        ([READ_Q], "builds what is meant", "the quaternion appears to be ordered [w, x, y, z]; a state has [x, y, z, w], body to world"),
        ([READ_Q, SET_Q], "turning", "the quaternion appears to be ordered [w, x, y, z], both set and read"),
        ([READ_W, SET_W, READ_Q, SET_Q], "tumbling", "; and angular velocity appears to be in the body frame, both set and read"),
        ([gravity("[0, 0, -9.81]")], "falling straight", "gravity is 9.81 m/s² along -z for every scene; y is up"),
        ([gravity("-scene.acceleration")], "falling", "gravity has the opposite sign; the scene gives an acceleration, y up"),
        ([gravity("[0, 0, 0]")], "falling", "gravity is omitted"),
        ([(STEP, STEP.replace("dt", "0.002"))], "time", "a step is 0.002 s long for every dt (0.01, 0.0025, 0.00025 s)"),
        ([(STEP, STEP.replace("dt", "dt / 2"))], "time", "0.005, 0.00125, 0.000125 s long"),
        ([(MOMENTS, f"{MOMENTS}[[0, 2, 1]]")], "tumbling", "the moments of inertia appear to be permuted to (x, z, y)"),
        ([(MOMENTS, "scene.body.mass, np.full(3, 0.1)")], "tumbling", "or with the inertia of a ball"),
        ([("0.5 * dt  #", "0.0  #")], "velocity lag", "set self.velocity_lag = 0.5 * dt"),
        ([("self.data.qvel = [*v, ", "self.data.qvel = [0, 0, 0, ")], "builds what is meant", "the velocity at the start is not set"),
        ([(RETURN, f"{SINGLE}\n        {RETURN}")], "builds what is meant", "declare precision = numpy.float32"),
        ([("self.data.qvel[:3], R", "-self.data.qvel[:3], R")], "builds what is meant", "velocity has the opposite sign"),
        ([(SPUN, f"57.29577951308232 * {SPUN}")], "builds what is meant", "appears to be in degrees per second; a state has rad/s"),
        ([(RETURN, RETURN.replace("q", "q * [-1, -1, -1, 1]"))], "builds what is meant", "the orientation appears to be inverted"),
        ([(REFUSAL, "return True")], "declines", "the answer of declines() is True; it must be a sentence"),
        ([(REFUSAL, "pass")], "bouncing ball", "the body falls through the floor"),
        ([(REFUSAL, "pass")], "damped", "damping is omitted"),
        ([('{"version": mujoco.__version__}', '{"version": mujoco}')], "settings", "cannot be stored as JSON"),
        ([(MJ_STEP, f"open('log.txt', 'w').close(); {MJ_STEP}")], "files", "working directory: log.txt"),
        ([(MJ_STEP, MJ_STEP.replace(", steps", ""))], "record and advance", "advance(3) differs from 3 calls of advance(1)"),
        ([record("", "steps")], "record and advance", "shape"),
        ([record("self.advance(1)\n        ", "steps, every")], "record and advance", "first row differs from the state before any step"),
        ([record("", "steps // every")], "record and advance", "record ignores `every`"),
        ([("self.data = mujoco.MjData(self.model)", "Flight.data = mujoco.MjData(self.model)")], "repeats", "simulations share state"),
        ([(BUILT, f"{NOISE}; {BUILT}")], "repeats", "the engine is random, or keeps state between simulations"),
        ([(BUILT, f"self.model.dof_damping[:] = 0.1; {BUILT}")], "coasting", "the final speed is 2.367 m/s instead of 2.41091 (1.8 %"),
    ],
)  # fmt: skip
def test_planted_fault_of_an_adapter_is_named(changes, check, message, tmp_path, monkeypatch):
    """In the documented adapter; one of them writes into the working directory."""
    monkeypatch.chdir(tmp_path)
    found = not_passed(documented(*changes), check)
    assert check in found, found
    assert message in found[check][1]
    assert found[check][0] in ("failed", "noted")


def with_scene(change):
    """PyBullet that simulates another scene than the one given."""

    class Mapped(PyBullet):
        name = "mapped"

        def prepare(self, scene, dt):
            simulation = super().prepare(change(scene), dt)
            simulation.as_built = lambda: None
            return simulation

    return Mapped()


def floor(**values):
    """A change of values of the floor; a callable is applied to the scene's value."""

    def changed(scene):
        if scene.floor is None:
            return scene
        found = {name: value(getattr(scene.floor, name)) if callable(value) else value for name, value in values.items()}
        return scene.model_copy(update={"floor": scene.floor.model_copy(update=found)})

    return changed


def body(**values):
    def changed(scene):
        given = scene.body.model_dump()
        return scene.model_copy(update={"body": type(scene.body)(**given | {k: v(given[k]) for k, v in values.items() if k in given})})

    return changed


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ("change", "check", "message"),
    [
        (
            floor(restitution=lambda e: e * e),
            "bouncing ball",
            "restitution appears to be squared; an engine that multiplies the values of two bodies needs 1 for the floor",
        ),
        (floor(restitution=lambda e: e / 2), "bouncing ball", "restitution appears to be halved"),
        (floor(restitution=0.0), "bouncing box", "restitution is 0 for every scene"),
        (floor(restitution=0.606), "bouncing ball", "restitution is 0.6067 instead of 0.6 (1.1 % too high); position"),
        (floor(friction="none"), "gripping floor", "friction is omitted"),
        (floor(friction=0.0144), "slippery floor", "friction appears to be squared"),
        (floor(friction=0.5), "slippery floor", "friction is 0.5 for every scene"),
        (body(radius=lambda r: 2 * r), "bouncing ball", "the radius is twice as large as it should be: is a diameter read as a radius?"),
        (
            body(half_extents=lambda a: tuple(x / 2 for x in a)),
            "bouncing box",
            "the body is half as large as it should be: are half extents read as extents?",
        ),
        (body(inertia=lambda _: "solid"), "corner", "inertia is that of the solid shape for every scene"),
        (body(mass=lambda _: 1.0, inertia=lambda given: given), "corner", "mass is 1 kg for every scene"),
    ],
)
def test_planted_fault_of_a_contact_is_named(change, check, message):
    """In an adapter of Bullet."""
    found = not_passed(with_scene(change), check)
    assert check in found, found
    assert message in found[check][1]


@pytest.mark.usefixtures("engine_processes")
def test_crash_of_the_process_fails_its_check_only():
    """A segmentation fault with gravity; checks without gravity still run."""
    import ctypes

    class Faulting(PyBullet):
        name = "faulting"

        def prepare(self, scene, dt):
            if scene.gravity is not None:
                ctypes.string_at(0)
            return super().prepare(scene, dt)

    found = {one.check: one for one in conform(Faulting(), checks=["falling", "tumbling", "fast", "turning"])}
    assert found["falling"].outcome == "crashed"
    assert "SIGSEGV" in found["falling"].message
    assert [found[check].outcome for check in ("tumbling", "fast", "turning")] == ["passed"] * 3


def test_exception_of_an_adapter_crashes_its_check():
    raising = documented(('            return "only principal axes are mapped"', "            raise ValueError('axes')"))
    [found] = conform(raising, ["declines"])
    assert (found.outcome, found.message) == ("crashed", "ValueError: axes")


@pytest.mark.usefixtures("without_explanations")
def test_sleep_and_default_damping_of_bullet_fail():
    """Bullet with its own thresholds puts a slow body to sleep after two seconds."""
    found = not_passed(engine("pybullet[profile=default]"), "coasting", "creeping")
    assert "creeping" in found
    assert found["coasting"][0] == "failed"


def test_engine_that_declines_every_scene_fails():

    class Idle(made.Exact):
        name = "idle"

        def declines(self, scene):
            return "not today"

    found = {one.check: one for one in conform(Idle())}
    assert found["declines"].outcome == "failed"
    assert found["declines"].message.startswith("every scene of the catalogue is declined; ")
    assert found["turning"].outcome == "declined"
    assert found["time"].outcome == "declined"


@pytest.mark.extended
def test_record_that_differs_from_advance_by_rounding_is_noted():
    """A native record may round differently; `repeats` passes."""
    rounded = "    def record(self, steps, every=1):\n        rows = super().record(steps, every)\n        rows[1:] *= 1 + 2.0**-52\n"
    protocol = [check for check in CHECKS if check not in {probe.name for probe in PROBES}]
    found = not_passed(documented((STATE, f"{rounded}        return rows\n\n{STATE}")), *protocol)
    assert set(found) == {"record and advance"}
    assert found["record and advance"] == ("noted", "record and advance differ by rounding, 2e-16")


@pytest.mark.usefixtures("without_explanations")
def test_nan_fails_with_a_message():
    found = not_passed(
        documented((RETURN, RETURN.replace("np.", "(np.nan if self.data.time else 1.0) * np."))), "time", "velocity lag", "falling"
    )
    assert len(found) == 3
    assert "crashed" not in {outcome for outcome, _ in found.values()}
    assert "not finite" in found["time"][1]
    assert "not finite" in found["velocity lag"][1]


def test_start_that_is_off_by_1e_12_is_not_a_fault_of_convention():
    """The message gives the numbers."""
    found = not_passed(documented(("self.data.qpos = [*x,", "self.data.qpos = [*(x + 1e-12),")), "builds what is meant")
    assert "position at the start is" in found["builds what is meant"][1]


@pytest.mark.parametrize(("kind", "shown"), [(object, "object"), (str, "<U32")])
def test_state_of_another_type_than_real_numbers_is_named(kind, shown):
    class Typed(made.ExactSimulation):
        def state(self):
            return super().state().astype(kind)

    engine_ = type("TypedEngine", (made.Exact,), {"prepare": lambda self, scene, dt: Typed(scene, dt)})()
    outcome, message = not_passed(engine_, "builds what is meant")["builds what is meant"]
    assert outcome == "failed"
    assert message.startswith(
        f"state() returns an array of {shown}, shape (13,); it must return a NumPy array of 13 real numbers, shape (13,)"
    )


def test_omitted_products_of_inertia_are_named():
    found = not_passed(documented(('            return "only principal axes are mapped"', "            pass")), "tumbling askew")
    assert found["tumbling askew"] == ("failed", "products of inertia are omitted: the body's own axes are not principal axes")


@pytest.mark.usefixtures("without_explanations")
@pytest.mark.parametrize(
    ("change", "checks"),
    [
        (lambda e: 0.6, {"dull ball", "lively ball"}),
        (lambda e: max(e, 0.5), {"dull ball"}),
        (lambda e: min(e, 0.95), {"lively ball"}),
    ],
)
def test_restitution_is_checked_at_several_values(change, checks):
    def changed(scene):
        return scene if scene.floor is None else floor(restitution=change(scene.floor.restitution))(scene)

    assert set(not_passed(with_scene(changed), "dull ball", "bouncing ball", "lively ball")) == checks


@pytest.mark.parametrize(("is_dead", "check"), [(lambda mass: mass < 1.0, "light ball"), (lambda mass: mass > 100.0, "heavy ball")])
def test_restitution_is_checked_for_light_and_heavy_balls(is_dead, check):
    def changed(scene):
        return floor(restitution=0.0)(scene) if scene.floor is not None and is_dead(scene.body.mass) else scene

    found = not_passed(with_scene(changed), "bouncing ball", "light ball", "heavy ball")
    assert list(found) == [check]
    assert "instead of 0.6 (100 % too low)" in found[check][1]


@pytest.mark.usefixtures("without_explanations")
def test_known_limitation_explains_errors_within_its_numbers_only():
    """In `conform` and in a run; a sentence alone explains no error."""

    class Excusing(PyBullet):
        name = "excusing"
        limitations = ("soft contacts",)

        def prepare(self, scene, dt):
            simulation = super().prepare(floor(restitution=0.4)(scene), dt)
            original = simulation.record

            def record(steps, every=1):
                rows = original(steps, every)
                simulation.known_limitations = self.limitations
                return rows

            simulation.record = record
            return simulation

    assert not_passed(Excusing(), "bouncing ball")["bouncing ball"][0] == "failed"
    Excusing.limitations = (KnownLimitation("soft", {"restitution_error": 0.2, "bounce_height_error": 0.2}),)
    found = run("drop-ball", Excusing(), 1e-3).measurements.set_index("metric")
    assert found.loc["position_error", "verdict"] == "failed"
    assert found.loc["restitution_error", "verdict"] == "limited"
    Excusing.limitations = "never"
    assert "known_limitations is 'never'" in not_passed(Excusing(), "bouncing ball")["bouncing ball"][1]


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_friction_fault_exceeds_the_known_limitation(factor, monkeypatch):
    """MuJoCo with half or twice the friction fails; with the right friction its limitation explains the error."""
    from dropspin.comparisons.engines import mujoco_engine

    scene, contact = load("slide-box"), mujoco_engine.contact
    sound = run(scene, "mujoco", 1e-3).table.set_index("metric")
    assert sound.loc["position_error", "verdict"] == "limited"
    wrong = scene.floor.model_copy(update={"friction": factor * scene.floor.friction})
    monkeypatch.setattr(mujoco_engine, "contact", lambda floor, *rest: contact(wrong, *rest))
    found = run(scene, "mujoco", 1e-3).table.set_index("metric")
    assert found.loc["position_error", "verdict"] == "failed"


@pytest.mark.usefixtures("engine_processes")
def test_adapter_that_writes_into_an_array_of_the_scene_is_named():
    class Writing(made.Exact):
        def prepare(self, scene, dt):
            scene.body.inertia_tensor[0, 0] *= 1.0 + 1e-9
            return super().prepare(scene, dt)

    [found] = conform(Writing(), ["builds what is meant"])
    assert found.message.startswith("the adapter writes into scene.body.inertia_tensor, ")


def test_unknown_check_suggests_the_nearest_name():
    with pytest.raises(UnknownName, match="Did you mean 'bouncing ball'"):
        conform(engine("wang"), checks=["bounce ball"])


BATCHES = {
    "leaks between simulations": (
        {"record": "motions[1:, 1:] += 1e-9 * motions[0, 1:]"},
        "simulation 2 differs from the same one by itself",
    ),
    "permutes simulations": ({"record": "motions[:, 1:] = motions[[*range(1, len(motions)), 0], 1:]"}, "simulation 1 differs"),
    "reuses one state": ({"record": "motions[:] = motions[0]"}, "position at the start of simulation 2 of 3 is"),
    "is right for few alone": ({"record": "motions[:, 1:] *= 1.0 + 1e-9 * (len(motions) > 4)"}, "(in a batch of 32 simulations of"),
    "takes one step a call": ({"steps": lambda steps: 1}, "calls of advance(8) give other states than record(24), by "),
    "takes 100 steps at most": ({"steps": lambda steps: min(steps, 100)}, "advance(256) gives other states than calls of advance(8), by "),
    "lacks the lag": ({"lag": 0.0}, "velocity_lag is 0.0; that of a single simulation is 0.000125"),
}


def batched_by(together):
    """The page's adapter, with batches of single simulations that a class makes."""

    class Batched(type(documented())):
        def prepare_batch(self, members, dt):
            return together([self.prepare(member, dt) for member in members])

    return Batched()


@pytest.mark.parametrize("fault", BATCHES)
def test_faults_of_batches_are_found(fault):
    """A fault in what a batch records, in the number of steps that it takes, or in its attribute; each is right for single simulations."""
    faults, expected = BATCHES[fault]

    def changed(motions):
        exec(faults.get("record", ""), {"np": np, "motions": motions})
        return motions

    class Faulty(made.Together):
        def __init__(self, simulations):
            super().__init__(simulations, changed)
            self.velocity_lag = faults.get("lag", self.velocity_lag)

        def advance(self, steps):
            super().advance(faults.get("steps", int)(steps))

    [(outcome, message)] = not_passed(batched_by(Faulty), "batches").values()
    assert outcome == "failed"
    assert expected in message


def test_engine_without_batches_declines_their_check():
    found = run_check(EngineEntry("documented", documented()), "batches")
    assert (found.outcome, found.message) == ("declined", "prepare_batch returns None: the engine simulates one scene at a time")


@pytest.mark.extended
@pytest.mark.parametrize(("attribute", "member", "scene"), [("friction", 2, "slippery-floor"), ("rest_speed", 3, "corner")])
def test_batch_with_a_number_of_its_first_scene_fails(attribute, member, scene):
    class First(Wang):
        def prepare_batch(self, members, dt):
            number = members[0].floor and {attribute: getattr(members[0].floor, attribute)}
            floors = [one.floor and one.floor.model_copy(update=number) for one in members]
            same = [one.model_copy(update={"floor": floor}) for one, floor in zip(members, floors, strict=True)]
            return super().prepare_batch(same, dt)

    sound, faulty = (kind({"law": "coulomb"}) for kind in (Wang, First))
    assert not_passed(sound, "batches") == {}
    [(_, message)] = not_passed(faulty, "batches").values()
    assert message.startswith(f"simulation {member} differs from the same one by itself from step ")
    assert message.endswith(f"(in a batch of 3 simulations of the scene {scene}; their numbers differ, because mixes_scenes is True)")


def test_long_call_that_takes_fewer_steps_is_found():
    """The time of a step would be too small."""
    capped = documented(("mujoco.mj_step(self.model, self.data, steps)", "mujoco.mj_step(self.model, self.data, min(steps, 100))"))
    outcome, message = not_passed(capped, "waiting")["waiting"]
    assert outcome == "failed"
    assert "the long call takes fewer steps, or state() does not wait for them" in message


@pytest.mark.parametrize(("excess", "outcomes"), [(1e-15, set()), (1e-9, {"failed"})])
def test_batch_of_an_engine_that_compiles_may_differ_by_rounding_alone(excess, outcomes):
    def changed(motions):
        motions[1:, 1:] *= 1.0 + excess
        return motions

    compiling = type("Compiling", (type(documented()),), {"compiles": True})
    found = not_passed(made.in_batches("batched", changed, compiling), "batches")
    assert {outcome for outcome, _ in found.values()} == outcomes


def test_lost_symmetry_is_noted_with_its_first_step():
    """A hidden acceleration along an axis of the world."""
    pushed = documented((RETURN, f"x = x + np.array([1e-2 * self.data.time, 0.0, 0.0])\n        {RETURN}"))
    outcome, message = not_passed(pushed, "symmetries")["symmetries"]
    assert outcome == "noted"
    assert "turned by 90°: by " in message
    assert " from step " in message


class Clock:
    """A clock that only simulations advance."""

    def __init__(self):
        self.now = 0.0

    def perf_counter(self):
        return self.now


def working_in(clock, while_advancing, while_reading):
    """An engine whose steps take these times [s] of a clock: in `advance`, and while `state` waits for them."""

    class Working(made.Exact):
        name = "working"

        def prepare(self, scene, dt):
            simulation, started = made.ExactSimulation(scene, dt), []
            advance, state = simulation.advance, simulation.state

            def advanced(steps):
                clock.now += while_advancing * steps
                started.append(steps)
                advance(steps)

            def read():
                while started:
                    clock.now += while_reading * started.pop()
                return state()

            simulation.advance, simulation.state = advanced, read
            return simulation

    return Working()


def test_engine_that_does_not_wait_for_its_steps_is_found(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(timing, "time", clock)
    outcome, message = not_passed(working_in(clock, 1e-6, 2e-4), "waiting")["waiting"]
    assert outcome == "failed"
    assert message.startswith("advance(256) returned after 0.26 ms, and state() then took 51 ms: the steps were not done; ")
    assert not_passed(working_in(clock, 2e-4, 0.0), "waiting") == {}
    assert not_passed(working_in(clock, 2e-4, 1e-5), "waiting") == {}


def test_timing_ends_when_the_state_is_there(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(clock_of_engines, "time", clock)
    seconds = time_steps(working_in(clock, 1e-6, 2e-4), load("spin-principal"), 1e-3, 10).stepping
    assert seconds == pytest.approx(10 * (1e-6 + 2e-4))


def compiling_in(clock, compiles, first, again=0.0):
    """An engine that needs these times [s] of a clock to build its first simulation, and another number of steps than before."""

    class Compiling(made.Exact):
        name = "compiling"

        def prepare(self, scene, dt):
            simulation = made.ExactSimulation(scene, dt)
            clock.now += 0.1 if known else first
            advance = simulation.advance

            def advanced(steps):
                clock.now += again * (bool(known) and steps not in known)
                known.add(steps)
                advance(steps)

            simulation.advance = advanced
            return simulation

    known = set()
    Compiling.compiles = compiles
    return Compiling()


@pytest.mark.parametrize(
    ("compiles", "first", "again", "outcome", "message"),
    [
        (False, 9.0, 0.0, "passed", "the engine takes no noticeable time to compile"),
        (False, 62.1, 0.0, "noted", "the first simulation takes 62 s longer than the second; set compiles = True"),
        (True, 62.1, 0.0, "passed", "a scene compiles in 62 s; a simulation of 24 steps then takes 100 ms"),
        (True, 62.1, 60.0, "noted", "; with another number of steps it compiles again, for 60 s"),
    ],
)
def test_compilation_is_measured_and_stated(monkeypatch, compiles, first, again, outcome, message):
    clock = Clock()
    monkeypatch.setattr(clock_of_engines, "time", clock)
    engine_ = compiling_in(clock, compiles, first, again)
    found = run_check(EngineEntry(engine_.label, engine_), "compilation")
    assert found.outcome == outcome
    assert message in found.message


class SinglePrecision(Simulation):
    """Semi-implicit Euler in four sub-steps, whose rounding errors in single precision add up."""

    def __init__(self, scene, dt, lag):
        self.velocity_lag, self._dt, self._g = lag * dt, np.float32(dt / 4), scene.acceleration.astype(np.float32)
        self._state = scene.initial_state.astype(np.float32)

    def advance(self, steps):
        for _ in range(4 * steps):
            self._state[7:10] += self._dt * self._g
            self._state[:3] += self._dt * self._state[7:10]

    def state(self):
        return self._state.astype(float)


def lag_of(stated):
    """The check of the lag of four sub-steps in single precision, with a lag stated in steps."""
    prepare = {"prepare": lambda self, scene, dt: SinglePrecision(scene, dt, stated)}
    return check_velocity_lag(type("Single", (made.Exact,), prepare)())


class Leapfrog(Simulation):
    """Exact positions of a fall; velocities are those of half a step before."""

    def __init__(self, scene, dt, lag):
        self.velocity_lag, self._scene, self._dt, self._step = lag * dt, scene, dt, 0

    def advance(self, steps):
        self._step += steps

    def state(self):
        found, g, t = self._scene.initial_state.copy(), self._scene.acceleration, self._step * self._dt
        found[:3] += found[7:10] * t + 0.5 * g * t**2
        found[7:10] += g * (t - 0.5 * self._dt if t else 0.0)
        return found


def test_leapfrog_with_velocities_of_half_a_step_before_has_that_velocity_lag():
    """The lag is the one between velocity and position, not between position and the exact fall, which is 0 here."""

    def staggered(lag):
        return type("Staggered", (made.Exact,), {"prepare": lambda self, scene, dt: Leapfrog(scene, dt, lag)})()

    assert check_velocity_lag(staggered(0.5)) == "velocity lags position by 0.5 steps"
    with pytest.raises(CheckFailed, match=r"velocity_lag is 0 steps, but velocity lags position by 0\.5 steps"):
        check_velocity_lag(staggered(0.0))


@pytest.mark.parametrize("factor", [0.5, 0.01])
def test_lag_of_a_fall_with_another_gravity_is_that_of_the_scheme(factor):
    """The lag of semi-implicit Euler is half a step whatever the acceleration."""

    def prepare(self, scene, dt):
        weaker = scene.model_copy(update={"gravity": Gravity(acceleration=tuple(factor * scene.acceleration))})
        return Leapfrog(weaker, dt, 0.5)

    engine = type("Weak", (made.Exact,), {"prepare": prepare})()
    if factor > 0.1:
        assert check_velocity_lag(engine) == "velocity lags position by 0.5 steps"
    else:
        with pytest.raises(CheckFailed, match="the velocity of a falling body hardly changes"):
            check_velocity_lag(engine)


def test_rounding_of_single_precision_does_not_change_the_velocity_lag():
    assert lag_of(1 / 8) == "velocity lags position by 0.125 steps"
    with pytest.raises(CheckFailed, match=r"velocity lags position by 0\.125 steps.*; set self.velocity_lag = 0.5 \* dt / 4"):
        lag_of(1 / 16)
