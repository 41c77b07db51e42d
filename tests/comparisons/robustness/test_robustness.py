"""RobustnessStudy: the axes keep what they promise, the conditions mean what they say, and what is planted is found where it was planted."""

import math
import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.engines import Exact, ExactSimulation, FrozenSimulation

from comparisons.engines.registry import engine
from comparisons.robustness import AXES, AxisScan, RobustnessStudy, limits, surprises
from comparisons.robustness.axes import OperatingPoint, restored
from comparisons.robustness.failure_modes import SOUND, Diagnosis, Run, clamped, held_speeds
from comparisons.robustness.runner import Runner
from comparisons.robustness.scan import Point
from comparisons.running.processes import EngineProcesses, ResourceLimits
from comparisons.running.recording import engine_entry
from scenarios import DropspinError, Trajectory, load, truth_for

DT = 5e-3
SCENES = ("spin-principal", "spin-asymmetric", "drop-ball-lively", "drop-box-flat", "rock-block")
QUICK = ResourceLimits(processor_time=20.0)


def along(scene_name, axis, name, near=1.03):
    """An engine, or its name, along an axis of a scene of the catalogue."""
    with EngineProcesses(QUICK) as processes:
        return scan_axis(Runner(engine_entry(name), 0.1, processes), OperatingPoint(load(scene_name), DT), AXES[axis], near)


def first(found, condition):
    """The edge, outwards from the scene's own value or at it, at which a condition begins: the values just inside and just outside."""
    pairs = [(edge.before.value, edge.after.value) for edge in found.transitions if edge.after.mode == condition]
    assert pairs, [(point.value, point.mode) for point in found.points]
    return pairs[0]


# The axes.


@pytest.mark.parametrize("name", SCENES)
def test_the_scene_s_own_value_gives_the_scene(name):
    setting = OperatingPoint(load(name), DT)
    for axis in AXES.values():
        if not axis.applies(setting.scene):
            continue
        at = axis.at(setting, axis.base(setting))
        assert at.dt == pytest.approx(DT)
        assert at.scene.initial_state == pytest.approx(setting.scene.initial_state, abs=1e-12), axis.name
        assert at.scene.duration == pytest.approx(setting.scene.duration), axis.name
        assert np.abs(at.scene.body.inertia_tensor - setting.scene.body.inertia_tensor).max() <= 1e-15, axis.name


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("axis", ["mass", "scale"])
@pytest.mark.parametrize("factor", [2.0**-20, 0.25, 16.0, 2.0**20])
def test_physics_keeps_its_promise(name, axis, factor):
    """The truth of a scaled scene, in the units of the scene it is scaled from, is the scene's: lengths λ, times √λ, gravity 1."""
    setting = OperatingPoint(load(name), DT)
    value = AXES[axis].base(setting) * factor
    scaled = AXES[axis].at(setting, value)
    exact = truth_for(setting.scene)
    times = np.linspace(0.0, min(setting.scene.duration, exact.horizon), 23)
    time = math.sqrt(factor) if axis == "scale" else 1.0
    found = restored(truth_for(scaled.scene)(times * time).states, AXES[axis], AXES[axis].base(setting), value)
    assert found == pytest.approx(exact(times).states, abs=1e-10)  # measured 2e-12


@given(ratio=st.floats(1.0, 1e6))
def test_any_ratio_of_moments_is_a_body_s(ratio):
    """The triangle inequality, which loading checks; the ratio is the one asked for, and the largest moment stays."""
    setting = OperatingPoint(load("spin-asymmetric"), DT)
    moved = AXES["inertia-ratio"].at(setting, ratio)
    moments = np.linalg.eigvalsh(moved.scene.body.inertia_tensor)
    assert moments[2] / moments[0] == pytest.approx(ratio, rel=1e-9)
    assert moments[2] == pytest.approx(np.linalg.eigvalsh(setting.scene.body.inertia_tensor)[2])


@given(size=st.floats(1e-4, 1e3))
def test_a_body_of_any_size_falls_from_as_high(size):
    setting = OperatingPoint(load("drop-box-edge"), DT)
    moved = AXES["size"].at(setting, size).scene
    assert moved.body.size == pytest.approx(size, rel=1e-12)
    assert moved.clearance == pytest.approx(setting.scene.clearance, rel=1e-9)


@pytest.mark.parametrize("name", ["drop-ball-lively", "drop-box-flat", "rock-block"])
@pytest.mark.parametrize("axis", ["mass", "scale"])
def test_the_note_s_method_has_no_scale_of_its_own(name, axis):
    """Times powers of two its motion is the same to the last bit, so that whatever differs there is a constant of the engine's."""
    setting = OperatingPoint(load(name), DT)
    value = 1024.0 * AXES[axis].base(setting)
    moved = AXES[axis].at(setting, value)
    steps = setting.scene.steps(DT)
    with engine("document").prepare(setting.scene, DT) as own, engine("document").prepare(moved.scene, moved.dt) as other:
        assert np.array_equal(own.record(steps), restored(other.record(steps), AXES[axis], AXES[axis].base(setting), value))


# The conditions, of motions made for them.


def run_of(name, distort=lambda t, states: states, duration=None):
    """The truth of a scene, distorted."""
    scene = load(name)
    truth = truth_for(scene)
    t = DT * np.arange(1 + scene.steps(DT), dtype=float)
    t = t[truth.covers(t)]
    motion = Trajectory.from_states(t, distort(t, truth(t).states))
    return Run(scene, DT, motion, motion, truth)


def moved(column, change):
    """A distortion of one column of the states."""

    def distort(t, states):
        states = states.copy()
        states[:, column] += change(t, states)
        return states

    return distort


@pytest.mark.parametrize("name", SCENES)
def test_the_exact_motion_is_sound(name):
    assert diagnose(run_of(name), 0.1).mode == "sound"


HEIGHT, UPWARD = 1, 8
FALSE_MOTIONS = {
    "not finite": ("spin-principal", moved(10, lambda t, x: np.where(t > 1, np.nan, 0)), "diverged"),
    "blows up": ("spin-principal", moved(10, lambda t, x: 1e4 * t), "diverged"),
    "gains energy": ("spin-principal", moved(10, lambda t, x: 0.007 * 5.0 * t / 10.0), "gains_energy"),
    "below the floor": ("drop-ball-lively", moved(HEIGHT, lambda t, x: np.where(t > 3.9, -2.3, 0)), "tunnels"),
    "sinks": ("rock-block", moved(HEIGHT, lambda t, x: -0.01 * t), "sinks"),
    "orientation_error": ("spin-principal", moved(4, lambda t, x: 0.1 * (t > 5)), "inaccurate"),
    "energy_error": ("spin-principal", moved(10, lambda t, x: -0.06 * 5.0 * t / 10.0), "inaccurate"),
    "astray": ("drop-ball-lively", moved(0, lambda t, x: 3.0 * np.sin(t)), "inaccurate"),
}


@pytest.mark.parametrize("criterion", FALSE_MOTIONS)
def test_each_criterion_is_met_by_a_motion_made_for_it(criterion):
    name, distort, condition = FALSE_MOTIONS[criterion]
    found = diagnose(run_of(name, distort), 0.1)
    assert (found.mode, found.criterion) == (condition, criterion)
    assert found.message


def test_what_stays_where_an_impact_left_it_does_not_sink():
    """Deep, but no deeper: that is no sinking, and neither is a bounce that is caught in the deep."""
    assert diagnose(run_of("rock-block", moved(HEIGHT, lambda t, x: -0.02)), 0.5).mode == "sound"
    assert diagnose(run_of("drop-ball-lively", moved(HEIGHT, lambda t, x: np.where(t > 3.95, -0.3, 0))), 0.5).mode != "sinks"


def test_restless_is_what_moves_when_the_truth_rests():
    scene = AXES["duration"].at(OperatingPoint(load("drop-ball"), DT), 3.0).scene
    truth = truth_for(scene)
    t = DT * np.arange(601.0)
    for speed, condition in ((0.04, "sound"), (0.1, "inaccurate")):  # g dt is .049 m/s
        states = truth(t).states
        states[t > 2.0, UPWARD] += speed
        motion = Trajectory.from_states(t, states)
        assert diagnose(Run(scene, DT, motion, motion, truth), 0.1).mode == condition


def falling(speeds):
    states = np.zeros((len(speeds), 13))
    states[:, 6], states[:, UPWARD] = 1.0, speeds
    return Trajectory.from_states(DT * np.arange(len(speeds), dtype=float), states)


def test_a_terminal_speed_is_no_clamp_and_a_clamp_is():
    """Both end at the same speed from every start; a clamp does so all of a sudden."""
    steps = np.arange(3000)
    cut = [falling(np.maximum(start - 0.049 * steps, -100.0)) for start in (-60.0, -70.0)]
    assert [finding.size for finding in clamped(*cut)] == [100.0]
    settling = falling(-15.0 * (1.0 - np.exp(-0.05 * steps)))
    assert settling.velocity[-1, 1] == settling.velocity[-2, 1]
    assert held_speeds(settling) == {}
    steady = falling(np.full(50, -3.0))
    assert held_speeds(steady) == {}


def test_a_speed_that_is_cut_in_the_first_step():
    cut = [falling([start, *(-100.0 * 0.98 ** np.arange(30))]) for start in (-150.0, -300.0)]
    assert [finding.size for finding in clamped(*cut)] == [100.0]
    braked = [falling([start, *(0.5 * start * 0.98 ** np.arange(30))]) for start in (-150.0, -300.0)]
    assert clamped(*braked) == []


# Diagnosis edges.


class Planted(Exact):
    """The exact motion, with a fault beyond a value."""

    name = "planted"

    def prepare(self, scene, dt):
        spin = np.linalg.norm(scene.start.angular_velocity)
        state = scene.initial_state
        if spin > 37.0:  # a clamp
            state[10:13] *= 37.0 / spin
        simulation = ExactSimulation(scene.starting_at(state), dt)
        simulation._start = scene.initial_state
        if scene.body.mass < 1e-6:
            raise RuntimeError("too light")
        if scene.body.mass > 1e3:  # a millionth faster
            simulation._dt *= 1.0 + 1e-6
        return simulation


class Frozen(Exact):
    """Never moves."""

    name = "frozen"

    def prepare(self, scene, dt):
        return FrozenSimulation(scene)


@pytest.mark.parametrize("name", ["drop-ball", "drop-box-flat", "slip-stick"])
def test_what_never_moves_is_sound_nowhere(name):
    """However coarse the step, or low the fall: what the metrics cannot resolve is not well for that."""
    for axis in ("step", "restitution", "height"):
        if AXES[axis].applies(load(name)):
            assert "sound" not in {point.mode for point in along(name, axis, Frozen()).points}, axis


def test_a_clamp_of_the_norm():
    """In no component, and in the middle of a fall."""

    class Slow(Exact):
        name = "slow"

        def prepare(self, scene, dt):
            simulation = ExactSimulation(scene, dt)
            record = simulation.record

            def clamped_record(steps, every=1):
                rows = record(steps, every)
                speeds = np.linalg.norm(rows[:, 7:10], axis=1, keepdims=True)
                rows[:, 7:10] *= np.minimum(1.0, 30.0 / np.maximum(speeds, 1e-9))
                return rows

            simulation.record = clamped_record
            return simulation

    thrown = load(load("fall-damped").model_dump(exclude={"expect", "damping"}, exclude_none=True))
    with EngineProcesses(QUICK) as processes:
        found = scan_axis(Runner(engine_entry(Slow()), 0.1, processes), OperatingPoint(thrown, DT), AXES["duration"])
    assert found.points[-1].mode == "clamped"
    assert found.points[-1].diagnosis.size == pytest.approx(30.0)


def test_planted_faults_are_found_where_they_are():
    inside, outside = first(along("spin-principal", "spin", Planted()), "clamped")
    assert inside <= 37.0 < outside <= 1.03 * inside
    found = along("spin-principal", "mass", Planted())
    inside, outside = first(found, "inaccurate")
    assert (inside, outside) == (512.0, 1024.0)
    assert next(point for point in found.points if point.value == 1024.0).diagnosis.criterion == "depends on mass"
    light = [point.value for point in found.points if point.mode == "crashed"]
    assert max(light) == 2.0**-20 < 1e-6 < 2.0**-19


@pytest.mark.parametrize("name", SCENES)
def test_an_exact_engine_is_sound_everywhere(name):
    """On every axis, as far as it goes."""
    found = limits(load(name), [Exact()], pairs=[], time_limits=QUICK, axes=[a.name for a in AXES.values() if a.applies(load(name))])
    accused = [(one.axis.name, point.value, point.diagnosis) for one in found.explored for point in one.points if point.mode != "sound"]
    assert accused == []


def test_what_breaks_costs_a_point():
    class Leaving(Exact):
        name = "leaving"

        def prepare(self, scene, dt):
            if dt > 0.1:
                os.abort()
            return ExactSimulation(scene, dt)

    found = along("spin-principal", "step", Leaving())
    inside, outside = first(found, "crashed")
    assert inside <= 0.1 < outside <= 1.03 * inside


# What is known of the engines, found without being told.


def test_finds_pybullet_s_clamps():
    kept = "pybullet[coordinates=multibody,velocity_clamp=kept]"
    for name in (kept, "pybullet[profile=default]"):
        found = along("spin-principal", "spin", name)
        inside, outside = first(found, "clamped")
        assert inside <= 104.0
        assert outside >= 100.0
    falls = along("drop-ball-lively", "height", kept, near=1.1)
    inside, outside = first(falls, "clamped")
    assert inside <= 100.0**2 / (2 * 9.8) <= outside  # falls at 100 m/s from 510 m
    assert next(point for point in falls.points if point.value == outside).diagnosis.size == 100.0
    assert "clamped" not in {point.mode for point in along("spin-principal", "spin", "pybullet[coordinates=multibody]").points}


def test_finds_pybullet_s_short_turns():
    """Beyond π/4 a step, all of a sudden; the tolerance is passed 1 % later."""
    found = along("spin-principal", "step", "pybullet")
    outside = 5.0 * first(found, "inaccurate")[1]
    assert math.pi / 4 < outside < 1.03 * math.pi / 4
    [surprise] = surprises([found])
    assert surprise.sudden
    [gradual] = surprises([along("spin-principal", "step", "document")])
    assert not gradual.sudden


@pytest.mark.parametrize("name", ["document[rotation=gyroscopic]", "mujoco"])
def test_finds_the_explicit_gyroscopic_term_s_blow_up(name):
    """The energy rises, then there is no state; MuJoCo's Euler has the same term."""
    found = along("spin-asymmetric", "spin", name)
    assert "gains_energy" in {point.mode for point in found.points}
    _, outside = first(found, "diverged")
    assert outside == pytest.approx(23.5, rel=0.05)  # measured 23.5 rad/s, .12 rad a step


def test_finds_what_the_note_does_wrong():
    """Sinks at restitution 0, gains energy near 1, never rests between."""
    sinking = along("rock-block", "duration", "document")
    assert sinking.points[0].mode == "sinks"
    assert first(sinking, "tunnels")[1] == pytest.approx(1333, rel=0.1)  # s, until all of it is under the floor
    inside, outside = first(along("drop-ball-lively", "restitution", "document"), "gains_energy")
    assert 0.98 < inside < outside < 1.0
    restless = along("drop-ball-lively", "duration", "document")
    assert first(restless, "inaccurate")[1] == pytest.approx(9.7, rel=0.05)  # it comes to rest at 8.6 s, a tenth before the end
    assert restless.points[-1].diagnosis.criterion == "never rests"
    # Its limit cycle strikes the floor at g h/(1 - e), ten times g h.
    assert 9.0 <= restless.points[-1].diagnosis.size <= 19.0


def test_finds_that_thin_things_pass_the_floor():
    """A box of restitution 1/2 that falls at 4.4 m/s goes 22 mm deep in a step; at rest it is as deep as its last step was long."""
    assert first(along("drop-box-flat", "step", "mujoco"), "tunnels")[0] > 0.1
    smallest = along("drop-box-flat", "size", "document").points[0]
    assert (smallest.mode, smallest.value < 2e-4) == ("tunnels", True)


# What is told.


def made(name, conditions, axis="spin"):
    """An engine with a condition at 1, 10, 100, … rad/s; its scene's own value is 1."""
    points = tuple(Point(10.0**n, Diagnosis(condition, condition, 1.0, "")) for n, condition in enumerate(conditions))
    return AxisScan(SPIN, AXES[axis], name, 1.0, points)


SPIN = load("spin-principal")


def test_surprises_come_first_that_others_are_spared():
    found = surprises(
        [
            made("a", ["sound", "inaccurate", "diverged"]),
            made("b", ["sound", "sound", "diverged"]),
            made("c", ["sound", "sound", "diverged"]),
            made("d", ["sound", "clamped", "clamped"]),
        ]
    )
    told = [(one.engines, one.outside.mode, one.outside.value, one.sound) for one in found]
    assert told[0] == (("d",), "clamped", 10.0, ("b", "c"))
    assert told[1] == (("a",), "inaccurate", 10.0, ("b", "c"))
    assert told[2] == (("a", "b", "c"), "diverged", 100.0, ())


def test_what_is_as_it_is_is_told_once():
    found = surprises([made("a", ["inaccurate"] * 3), made("a", ["inaccurate"] * 2, axis="mass"), made("b", ["inaccurate"] * 2)])
    assert [(one.engines, one.inside) for one in found] == [(("a", "b"), None)]


def test_largest_steps_count_with_all_finer_ones():
    points = tuple(
        Point(value, SOUND._replace(condition=condition))
        for value, condition in ((0.001, "sound"), (0.01, "inaccurate"), (0.1, "sound"), (1.0, "diverged"))
    )
    study = RobustnessStudy(SPIN, DT, 0.1, (AxisScan(SPIN, AXES["step"], "exact", 0.001, points),), (), {})
    assert study.largest_steps("exact") == (0.001, 0.1)


def test_what_cannot_be_asked():
    with pytest.raises(DropspinError, match="axis 'spn' is unknown"):
        limits(SPIN, [Exact()], ["spn"])
    with pytest.raises(DropspinError, match="spin-principal has none; it has step, spin"):
        limits(SPIN, [Exact()], ["restitution"])
