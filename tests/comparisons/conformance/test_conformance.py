"""`conform`: sound engines pass, the documented adapter among them, and each planted mistake is named."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from support import engines as made

import comparisons
from comparisons.conformance import conform
from comparisons.engines.pybullet_engine import PyBullet
from comparisons.engines.registry import engine
from scenarios import load
from scenarios.errors import UnknownName

PAGE = Path(__file__).parents[2] / "docs" / "bring-your-engine.md"
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


def bad(engine_, *checks):
    found = conform(engine_, checks=checks)
    return {one.check: (one.verdict, one.said) for one in found if one.verdict not in ("passed", "declined")}


def test_the_documented_adapter_is_right_and_short():
    assert bad(documented()) == {}
    assert len([line for line in ADAPTER.splitlines() if line.strip()]) <= 40


@pytest.mark.parametrize(
    ("name", "noted"),
    [
        ("document", {"tumbling", "tumbling askew", "corner"}),
        ("document[law=coulomb,rotation=exact]", set()),
        ("document[rotation=rk4]", {"corner"}),
        ("mujoco", {"slippery floor", "sliding box"}),
        ("mujoco[integrator=rk4]", set()),
        ("mujoco[integrator=implicitfast]", {"slippery floor", "sliding box"}),
        ("pybullet", set()),
        ("pybullet[coordinates=multibody]", set()),
        ("rapier", set()),
        ("dart", {"slow ball"}),
        ("drake", set()),
    ],
)
def test_shipped_engines_are_right(name, noted):
    """Nothing fails; that the note has laws of its own is noted."""
    found = bad(engine(name))
    assert {check: verdict for check, (verdict, _) in found.items()} == dict.fromkeys(noted, "noted")
    if "corner" in noted:
        assert found["corner"][1] == "impacts follow the note law, as the engine says of itself"
    if "tumbling" in noted:
        assert "gyroscopic term left out" in found["tumbling"][1]


@pytest.mark.parametrize("name", ["rapier", "dart", "drake"])
def test_third_party_adapters_are_short(name):
    """What an engine takes: less than 120 lines."""
    source = Path(sys.modules[type(engine(name)).__module__].__file__)
    assert len(source.read_text(encoding="utf-8").splitlines()) < 120


def test_an_engine_without_error_is_right():
    assert bad(made.Exact()).keys() == {"settings"}  # it has no version


# What replaces what in the page's adapter.
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
TOLD = "return np.concatenate([x, q,"
RECORD = "    def record(self, steps, every=1):\n        {}return super().record({})\n\n    def state(self):"
SINGLE = "return np.float32([*x, *q, *self.data.qvel[:3], *Rotation.from_quat(q).apply(self.data.qvel[3:])]) + np.zeros(13)"


def gravity(value):
    return GRAVITY, f"spec.option.gravity = dt, {value}"


def record(first, given):
    return STATE, RECORD.format(first, given)


@pytest.mark.parametrize(
    ("changes", "check", "words"),
    [
        ([READ_W], "builds what is meant", "angular velocity looks body-framed; the state's is in the world frame"),
        ([READ_W, SET_W], "turning", "angular velocity looks body-framed, set and read alike"),
        ([SET_W], "builds what is meant", "angular velocity looks body-framed where it is set at the start"),
        ([READ_Q], "builds what is meant", "the quaternion looks ordered [w, x, y, z]; the state's is [x, y, z, w]"),
        ([READ_Q, SET_Q], "turning", "the quaternion looks ordered [w, x, y, z], set and read alike"),
        ([READ_W, SET_W, READ_Q, SET_Q], "tumbling", "and angular velocity looks body-framed, set and read alike"),
        ([gravity("[0, 0, -9.81]")], "falling straight", "9.81 m/s² along -z"),
        ([gravity("-scene.acceleration")], "falling", "opposite sign"),
        ([gravity("[0, 0, 0]")], "falling", "gravity is left out"),
        ([(STEP, STEP.replace("dt", "0.002"))], "time", "a step is 0.002 s long, whatever dt is"),
        ([(STEP, STEP.replace("dt", "dt / 2"))], "time", "0.005, 0.00125, 0.000125 s long"),
        ([(MOMENTS, f"{MOMENTS}[[0, 2, 1]]")], "tumbling", "permuted to (x, z, y)"),
        ([(MOMENTS, "scene.body.mass, np.full(3, 0.1)")], "tumbling", "or with the inertia of a ball"),
        ([("staggered = True", "staggered = False")], "staggered", "set staggered = True"),
        ([("self.data.qvel = [*v, ", "self.data.qvel = [0, 0, 0, ")], "builds what is meant", "the velocity at the start is not set"),
        ([(TOLD, f"{SINGLE}\n        {TOLD}")], "builds what is meant", "precision = numpy.float32"),
        ([("self.data.qvel[:3], R", "-self.data.qvel[:3], R")], "builds what is meant", "velocity has the opposite sign"),
        ([(SPUN, f"57.29577951308232 * {SPUN}")], "builds what is meant", "degrees a second"),
        ([(TOLD, TOLD.replace("q", "q * [-1, -1, -1, 1]"))], "builds what is meant", "orientation looks inverted"),
        ([(REFUSAL, "return True")], "declines", "says True; it says None, or why"),
        ([(REFUSAL, "pass")], "bouncing ball", "the body falls through the floor"),
        ([(REFUSAL, "pass")], "damped", "damping is left out"),
        ([('            return "only principal axes are mapped"', "            raise ValueError('axes')")], "declines", "ValueError: axes"),
        ([('{"version": mujoco.__version__}', '{"version": mujoco}')], "settings", "cannot be written as JSON"),
        ([(MJ_STEP, f"open('log.txt', 'w').close(); {MJ_STEP}")], "files", "working directory: log.txt"),
        ([(MJ_STEP, MJ_STEP.replace(", steps", ""))], "record and advance", "advance(3) is not 3 times advance(1)"),
        ([record("", "steps")], "record and advance", "shape"),
        ([record("self.advance(1)\n        ", "steps, every")], "record and advance", "record's first row is not the state now"),
        ([record("", "steps // every")], "record and advance", "record ignores `every`"),
        ([("self.data = mujoco.MjData(self.model)", "Flight.data = mujoco.MjData(self.model)")], "repeats", "they share something"),
        ([(BUILT, f"{NOISE}; {BUILT}")], "repeats", "something is random"),
        ([(BUILT, f"self.model.dof_damping[:] = 0.1; {BUILT}")], "coasting", "2.367 m/s and should as 2.411: damping"),
    ],
)  # fmt: skip
def test_a_mistake_is_named(changes, check, words, tmp_path, monkeypatch):
    """Planted in the documented adapter; one of them writes into the working directory."""
    monkeypatch.chdir(tmp_path)
    found = bad(documented(*changes), check)
    assert check in found, found
    assert words in found[check][1]
    assert found[check][0] in ("failed", "crashed", "noted")


def with_scene(change):
    """PyBullet that simulates another scene than it was given."""

    class Mapped(PyBullet):
        name = "mapped"

        def prepare(self, scene, dt):
            simulation = super().prepare(change(scene), dt)
            simulation.as_built = lambda: None
            return simulation

    return Mapped()


def floor(**values):
    return lambda scene: scene if scene.floor is None else scene.model_copy(update={"floor": scene.floor.model_copy(update=values)})


def body(**values):
    def changed(scene):
        given = scene.body.model_dump()
        return scene.model_copy(update={"body": type(scene.body)(**given | {k: v(given[k]) for k, v in values.items() if k in given})})

    return changed


@pytest.mark.parametrize(
    ("change", "check", "words"),
    [
        (floor(restitution=0.36), "bouncing ball", "restitution looks squared"),
        (floor(restitution=0.3), "bouncing ball", "restitution looks halved"),
        (floor(restitution=0.0), "bouncing box", "restitution is 0"),
        (floor(restitution=0.606), "bouncing ball", "it rebounds with 0.6"),
        (floor(friction="none"), "gripping floor", "friction is left out"),
        (floor(friction=0.0144), "slippery floor", "friction looks squared"),
        (floor(friction=0.5), "slippery floor", "friction is 0.5"),
        (body(radius=lambda r: 2 * r), "bouncing ball", "the body is twice as large"),
        (body(half_extents=lambda a: tuple(x / 2 for x in a)), "bouncing box", "the body is half as large"),
        (body(inertia=lambda _: "solid"), "corner", "inertia is the solid shape's"),
        (body(mass=lambda _: 1.0, inertia=lambda given: given), "corner", "mass is 1 kg"),
    ],
)
def test_a_mistake_on_the_floor_is_named(change, check, words):
    """Planted in an adapter to Bullet."""
    found = bad(with_scene(change), check)
    assert check in found, found
    assert words in found[check][1]


def test_what_ends_the_process_costs_its_check_only():
    """A segmentation fault where there is gravity; the checks without it are made."""
    import ctypes

    class Faulting(PyBullet):
        name = "faulting"

        def prepare(self, scene, dt):
            if scene.gravity is not None:
                ctypes.string_at(0)
            return super().prepare(scene, dt)

    found = {one.check: one for one in conform(Faulting(), checks=["falling", "tumbling", "fast", "turning"])}
    assert found["falling"].verdict == "crashed"
    assert found["falling"].said == "its process was ended by SIGSEGV"
    assert found["tumbling"].verdict == "passed"


def test_sleep_is_seen():
    """Bullet with its own sleeping thresholds puts a slow body to sleep after two seconds."""
    found = bad(engine("pybullet[profile=default]"), "coasting", "creeping")
    assert "creeping" in found
    assert found["coasting"][0] == "failed"


def test_declines_is_asked_of_the_whole_catalogue():
    """Who declines all gets told so."""

    class Idle(made.Exact):
        name = "idle"

        def declines(self, scene):
            return "not today"

    found = {one.check: one for one in conform(Idle())}
    assert found["declines"].verdict == "failed"
    assert found["turning"].verdict == "declined"
    assert found["time"].verdict == "declined"
    assert np.isfinite(load("drop-ball").duration)


def test_steps_that_differ_in_the_last_bits_are_no_fault():
    """A native record may round otherwise than advance; it shares nothing for that."""
    rounded = "    def record(self, steps, every=1):\n        rows = super().record(steps, every)\n        rows[1:] *= 1 + 2.0**-52\n"
    found = bad(documented((STATE, f"{rounded}        return rows\n\n{STATE}")))
    assert set(found) == {"record and advance"}
    assert found["record and advance"] == ("noted", "record and advance differ by rounding, 2e-16")


def test_nan_is_a_fault_and_no_crash():
    """Of the adapter's, in words."""
    found = bad(documented((TOLD, TOLD.replace("np.", "(np.nan if self.data.time else 1.0) * np."))), "time", "staggered", "falling")
    assert len(found) == 3
    assert "crashed" not in {verdict for verdict, _ in found.values()}
    assert "not finite" in found["time"][1]
    assert "not finite" in found["staggered"][1]


def test_what_is_off_by_rounding_is_called_so():
    """A start 1e-12 off is no quaternion in another order."""
    found = bad(documented(("self.data.qpos = [*x,", "self.data.qpos = [*(x + 1e-12),")), "builds what is meant")
    assert "position at the start is" in found["builds what is meant"][1]


def test_axes_that_are_not_principal():
    """An adapter that drops the products of inertia says so by its motion."""
    found = bad(documented(('            return "only principal axes are mapped"', "            pass")), "tumbling askew")
    assert found["tumbling askew"] == ("failed", "products of inertia are left out: the body's own axes are not principal")


@pytest.mark.parametrize(
    ("change", "checks"),
    [
        (lambda e: 0.6, {"dull ball", "lively ball"}),
        (lambda e: max(e, 0.5), {"dull ball"}),
        (lambda e: min(e, 0.95), {"lively ball"}),
    ],
)
def test_restitution_that_is_right_at_one_value_only(change, checks):
    def changed(scene):
        return scene if scene.floor is None else floor(restitution=change(scene.floor.restitution))(scene)

    assert set(bad(with_scene(changed), "dull ball", "bouncing ball", "lively ball")) == checks


def test_free_words_of_a_limit_excuse_nothing():
    """Neither here nor in a run; a figure excuses what is within it."""
    from comparisons.engines.base import KnownLimitation

    class Excusing(PyBullet):
        name = "excusing"
        told = ("it is what it is",)

        def prepare(self, scene, dt):
            simulation = super().prepare(floor(restitution=0.4)(scene), dt)
            original = simulation.record

            def record(steps, every=1):
                rows = original(steps, every)
                simulation.limits = self.told
                return rows

            simulation.record = record
            return simulation

    assert bad(Excusing(), "bouncing ball")["bouncing ball"][0] == "failed"
    Excusing.told = (KnownLimitation("soft", {"restitution_error": 0.2, "bounce_height_error": 0.2}),)
    found = comparisons.run([load("drop-ball")], [Excusing()], [1e-3]).measurements.set_index("metric")
    assert found.loc["position_error", "verdict"] == "failed"
    assert found.loc["restitution_error", "verdict"] == "limited"
    Excusing.told = "never"
    assert "limits is 'never'" in bad(Excusing(), "bouncing ball")["bouncing ball"][1]


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_limit_explains_what_it_can_and_no_more(factor, monkeypatch):
    """MuJoCo that slides with half or twice the friction fails beside the limit that it meets."""
    from comparisons.engines import mujoco_engine

    scene, contact = load("slide-box"), mujoco_engine.contact
    sound = comparisons.run([scene], ["mujoco"], [1e-3]).table.set_index("metric")
    assert sound.loc["position_error", "verdict"] == "limited"
    monkeypatch.setattr(mujoco_engine, "contact", lambda e, friction, *rest: contact(e, factor * friction, *rest))
    found = comparisons.run([scene], ["mujoco"], [1e-3]).table.set_index("metric")
    assert found.loc["position_error", "verdict"] == "failed"


def test_no_such_check():
    with pytest.raises(UnknownName, match="bouncing ball"):
        conform(engine("document"), checks=["bounce ball"])
