"""Limits: axes change one quantity each, failure modes follow their criteria, and planted faults are found where they begin.

The file is longer than 300 lines because its tests share the engines with faults that it defines.
"""

import math
import os
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.engines import Exact, ExactSimulation, FrozenSimulation

from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.limits.axes import AXES
from dropspin.comparisons.limits.failure_modes import SOUND, ExtendedMotion, clamped, diagnose, held_speeds
from dropspin.comparisons.limits.operating_point import OperatingPoint, in_nominal_units
from dropspin.comparisons.limits.runner import Runner
from dropspin.comparisons.limits.study import AxisScan, LimitsStudy, ScanPoint, find_limits, scan_axis
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.scenarios import DropspinError, Trajectory, load, truth_for
from dropspin.scenarios.surfaces import Floor

DT = 5e-3
SCENES = ("spin-principal", "spin-asymmetric", "drop-ball-lively", "drop-box-flat", "rock-block")
QUICK = ResourceLimits(processor_time=20.0)


def along(scene_name, axis, name, near=1.03):
    """The scan of a catalogue scene's axis with an engine or its name."""
    with EngineProcesses(QUICK) as processes:
        return scan_axis(Runner(engine_entry(name), OperatingPoint(load(scene_name), DT), 0.1, processes), AXES[axis], near)


def first(found, mode):
    """The values before and after the first transition to a failure mode."""
    pairs = [(before.value, after.value) for before, after in found.transitions if after.mode == mode]
    assert pairs, [(point.value, point.mode) for point in found.points]
    return pairs[0]


# The axes.


@pytest.mark.parametrize("name", SCENES)
def test_nominal_value_gives_the_nominal_scene(name):
    nominal = OperatingPoint(load(name), DT)
    for axis in AXES.values():
        if not axis.applies(nominal.scene):
            continue
        at = axis.at(nominal, axis.base(nominal))
        assert at.dt == pytest.approx(DT)
        assert at.scene.initial_state == pytest.approx(nominal.scene.initial_state, abs=1e-12), axis.name
        assert at.scene.duration == pytest.approx(nominal.scene.duration), axis.name
        assert np.abs(at.scene.body.inertia_tensor - nominal.scene.body.inertia_tensor).max() <= 1e-15, axis.name


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("axis", ["mass", "scale"])
@pytest.mark.parametrize("factor", [2.0**-20, 0.25, 16.0, 2.0**20])
def test_exact_motion_does_not_depend_on_mass_and_scale(name, axis, factor):
    """In the units of the nominal scene: lengths λ, times √λ, gravity 1."""
    nominal = OperatingPoint(load(name), DT)
    value = AXES[axis].base(nominal) * factor
    scaled = AXES[axis].at(nominal, value)
    exact = truth_for(nominal.scene)
    times = np.linspace(0.0, min(nominal.scene.duration, exact.horizon), 23)
    time = math.sqrt(factor) if axis == "scale" else 1.0
    found = in_nominal_units(truth_for(scaled.scene)(times * time).states, axis, AXES[axis].base(nominal), value)
    assert found == pytest.approx(exact(times).states, abs=1e-10)  # measured 2e-12


@given(ratio=st.floats(1.0, 1e6))
def test_inertia_ratio_keeps_the_triangle_inequality_and_the_largest_moment(ratio):
    """Loading checks the triangle inequality."""
    nominal = OperatingPoint(load("spin-asymmetric"), DT)
    moved = AXES["inertia-ratio"].at(nominal, ratio)
    moments = np.linalg.eigvalsh(moved.scene.body.inertia_tensor)
    assert moments[2] / moments[0] == pytest.approx(ratio, rel=1e-9)
    assert moments[2] == pytest.approx(np.linalg.eigvalsh(nominal.scene.body.inertia_tensor)[2])


@given(size=st.floats(1e-4, 1e3))
def test_size_keeps_the_height_of_the_fall(size):
    nominal = OperatingPoint(load("drop-box-edge"), DT)
    moved = AXES["size"].at(nominal, size).scene
    assert moved.body.size == pytest.approx(size, rel=1e-12)
    assert moved.clearance == pytest.approx(nominal.scene.clearance, rel=1e-9)


@pytest.mark.parametrize("name", ["drop-ball-lively", "drop-box-flat", "rock-block"])
@pytest.mark.parametrize("axis", ["mass", "scale"])
def test_wang_method_does_not_depend_on_mass_and_scale(name, axis):
    """By powers of two its motion is the same to the last bit, so that a difference shows a constant of an engine."""
    nominal = OperatingPoint(load(name), DT)
    value = 1024.0 * AXES[axis].base(nominal)
    moved = AXES[axis].at(nominal, value)
    steps = nominal.scene.steps(DT)
    with engine("wang").prepare(nominal.scene, DT) as own, engine("wang").prepare(moved.scene, moved.dt) as other:
        assert np.array_equal(own.record(steps), in_nominal_units(other.record(steps), axis, AXES[axis].base(nominal), value))


# Failure modes of motions made for them.


def motion_of(name, distort=lambda t, states: states):
    """The exact motion of a scene, distorted."""
    scene = load(name)
    truth = truth_for(scene)
    t = DT * np.arange(1 + scene.steps(DT), dtype=float)
    t = t[truth.covers(t)]
    motion = Trajectory.from_states(t, distort(t, truth(t).states))
    return ExtendedMotion(scene, DT, motion, motion, truth)


def moved(column, change):
    """A distortion of one column of the states."""

    def distort(t, states):
        states = states.copy()
        states[:, column] += change(t, states)
        return states

    return distort


@pytest.mark.parametrize("name", SCENES)
def test_the_exact_motion_is_sound(name):
    assert diagnose(motion_of(name), 0.1).mode == "sound"


def test_time_until_which_a_motion_was_compared_is_kept():
    """An error after the end of the exact solution is not seen, and this end is."""
    late = motion_of("spin-principal", moved(4, lambda t, x: 0.1 * (t > 5)))
    limited = late._replace(truth=replace(late.truth, horizon=4.0))
    assert (diagnose(late, 0.1).mode, diagnose(late, 0.1).compared_until) == ("inaccurate", None)
    assert (diagnose(limited, 0.1).mode, diagnose(limited, 0.1).compared_until) == ("sound", 4.0)


HEIGHT, UPWARD = 1, 8
FALSE_MOTIONS = {
    "not finite": ("spin-principal", moved(10, lambda t, x: np.where(t > 1, np.nan, 0)), "diverged"),
    "blows up": ("spin-principal", moved(10, lambda t, x: 1e4 * t), "diverged"),
    "gains energy": ("spin-principal", moved(10, lambda t, x: 0.007 * 5.0 * t / 10.0), "gains_energy"),
    "below the floor": ("drop-ball-lively", moved(HEIGHT, lambda t, x: np.where(t > 3.9, -2.3, 0)), "tunnels"),
    "sinks": ("rock-block", moved(HEIGHT, lambda t, x: -0.01 * t), "sinks"),
    "orientation_error": ("spin-principal", moved(4, lambda t, x: 0.1 * (t > 5)), "inaccurate"),
    "energy_error": ("spin-principal", moved(10, lambda t, x: -0.06 * 5.0 * t / 10.0), "inaccurate"),
    "position": ("drop-ball-lively", moved(0, lambda t, x: 3.0 * np.sin(t)), "inaccurate"),
}


@pytest.mark.parametrize("criterion", FALSE_MOTIONS)
def test_criterion_is_met_by_a_motion_made_for_it(criterion):
    name, distort, mode = FALSE_MOTIONS[criterion]
    found = diagnose(motion_of(name, distort), 0.1)
    assert (found.mode, found.criterion) == (mode, criterion)
    assert found.message


@pytest.mark.parametrize("row", [1, 300, 550])
def test_body_that_is_below_the_floor_in_between_tunnels(row):
    """In a single row of the motion; a ball of radius 0.1 m of which some part is above the floor does not."""
    for depth in (0.19, 0.21):
        lowered = motion_of(
            "drop-ball-lively", moved(HEIGHT, lambda t, x, to=0.1 - depth: (np.arange(len(t)) == row) * (to - x[:, HEIGHT]))
        )
        assert (diagnose(lowered, 0.1).mode == "tunnels") is (depth > 0.2)


@pytest.mark.parametrize(("side", "mode"), [(0.0, "tunnels"), (3.0, "sound")])
def test_body_falls_through_a_floor_that_ends_or_beside_it(side, mode):
    """Without an exact solution, no error tells."""
    table = {"restitution": 0.5, "friction": "none", "half_extents": [0.5, 0.5], "thickness": 0.05}
    scene = load("drop-ball").model_copy(update={"floor": Floor(**table), "expect": ()})
    falling = np.tile(scene.initial_state, (100, 1))
    falling[:, 0] = side * np.arange(100) / 100
    falling[:, HEIGHT] -= 0.03 * np.arange(100)
    motion = Trajectory.from_states(DT * np.arange(100), falling)
    assert diagnose(ExtendedMotion(scene, DT, motion, motion, None), 0.1).mode == mode


@pytest.mark.parametrize("restitution", [0.3, 0.5, 0.9])
@pytest.mark.parametrize("height", [0.01, 1.0, 1e6])
def test_body_that_rebounds_where_it_should_stay_down_is_inaccurate(height, restitution):
    """At any height of the fall, at steps that resolve the fall."""
    start = {"position": [0.0, 0.02 + height, 0.0]}
    body, gravity = {"shape": "sphere", "radius": 0.02, "mass": 0.1}, {"acceleration": [0.0, -9.81, 0.0]}
    scene, lively = (
        load({"name": "dead", "duration": 1.5 * np.sqrt(height), "body": body, "start": start, "gravity": gravity, "floor": floor})
        for floor in ({"restitution": 0.0, "friction": "none"}, {"restitution": restitution, "friction": "none"})
    )
    dt = scene.duration / 300
    t = dt * np.arange(301)
    motion = Trajectory.from_states(t, truth_for(lively)(t).states)
    for recorded in (dt, 0.1 * dt):  # every row of the record, or one of ten
        assert diagnose(ExtendedMotion(scene, recorded, motion, motion, truth_for(scene)), 0.1).mode == "inaccurate"
    exact = Trajectory.from_states(t, truth_for(scene)(t).states)
    assert diagnose(ExtendedMotion(scene, dt, exact, exact, truth_for(scene)), 0.1).mode == "sound"


def test_constant_depth_is_not_sinking():
    """Neither is a bounce whose lowest point falls into the last tenth."""
    assert diagnose(motion_of("rock-block", moved(HEIGHT, lambda t, x: -0.02)), 0.5).mode == "sound"
    assert diagnose(motion_of("drop-ball-lively", moved(HEIGHT, lambda t, x: np.where(t > 3.95, -0.3, 0))), 0.5).mode != "sinks"


@pytest.mark.parametrize("dt", [0.01, 0.02, 0.04, 0.06, 0.228])
@pytest.mark.parametrize(("lost", "mode"), [(0.0, "sound"), (0.08, "sound"), (0.12, "inaccurate")])
def test_height_of_a_bounce_is_judged_at_steps_that_hardly_resolve_it(dt, lost, mode):
    """A ball that falls 1 m rises 0.25 m in the 0.45 s after its impact; here it is lower by a share of 1 m, as after a late impact."""
    scene, truth = load("drop-ball"), truth_for(load("drop-ball"))
    t, fall = dt * np.arange(1 + scene.steps(dt), dtype=float), np.sqrt(2.0 / 9.8)
    states = truth(t).states
    states[(t > fall) & (t < 2.0 * fall), HEIGHT] -= lost
    motion = Trajectory.from_states(t, states)
    assert diagnose(ExtendedMotion(scene, dt, motion, motion, truth), 0.1).mode == mode


def test_body_that_moves_where_the_exact_solution_rests_is_inaccurate():
    scene = AXES["duration"].at(OperatingPoint(load("drop-ball"), DT), 3.0).scene
    truth = truth_for(scene)
    t = DT * np.arange(601.0)
    for speed, mode in ((0.04, "sound"), (0.1, "inaccurate")):  # g dt is .049 m/s
        states = truth(t).states
        states[t > 2.0, UPWARD] += speed
        motion = Trajectory.from_states(t, states)
        assert diagnose(ExtendedMotion(scene, DT, motion, motion, truth), 0.1).mode == mode


EPS = float(np.finfo(float).eps)


def falling(speeds):
    states = np.zeros((len(speeds), 13))
    states[:, 6], states[:, UPWARD] = 1.0, speeds
    return Trajectory.from_states(DT * np.arange(len(speeds), dtype=float), states)


def test_sudden_constant_speed_is_a_clamp_and_a_terminal_speed_is_not():
    """Both end at the same speed from every start."""
    steps = np.arange(3000)
    cut = [falling(np.maximum(start - 0.049 * steps, -100.0)) for start in (-60.0, -70.0)]
    assert [one.size for one in clamped(*cut, EPS)] == [100.0]
    for rate in (0.2, 0.9, 2.0):  # in single precision, also if it settles within a few steps
        quick = [falling((-15.0 + (15.0 + start) * np.exp(-rate * steps)).astype(np.float32)) for start in (0.0, -5.0)]
        assert clamped(*quick, float(np.finfo(np.float32).eps)) == []
    settling = falling(-15.0 * (1.0 - np.exp(-0.05 * steps)))
    assert settling.velocity[-1, 1] == settling.velocity[-2, 1]
    assert held_speeds(settling, EPS) == {}
    steady = falling(np.full(50, -3.0))
    assert held_speeds(steady, EPS) == {}


def test_speed_cut_in_the_first_step_is_a_clamp():
    cut = [falling([start, *(-100.0 * 0.98 ** np.arange(30))]) for start in (-150.0, -300.0)]
    assert [one.size for one in clamped(*cut, EPS)] == [100.0]
    braked = [falling([start, *(0.5 * start * 0.98 ** np.arange(30))]) for start in (-150.0, -300.0)]
    assert clamped(*braked, EPS) == []


def turning(spins):
    states = np.zeros((len(spins), 13))
    states[:, 6], states[:, 10:13] = 1.0, spins
    return Trajectory.from_states(DT * np.arange(len(spins), dtype=float), states)


@pytest.mark.parametrize(
    ("reduced", "clamp"),
    [
        (lambda spins: np.clip(spins, -30.0, 30.0), 30.0),
        (lambda spins: spins * np.minimum(1.0, 30.0 / np.linalg.norm(spins, axis=1, keepdims=True)), 30.0),
    ],
    ids=["components", "length"],
)
@pytest.mark.parametrize("size", [20.0, 45.0, 400.0])
@pytest.mark.parametrize("precision", [np.float64, np.float32])
def test_clamp_of_components_and_of_the_length_have_their_values(reduced, clamp, size, precision):
    """Whether one component of a tumbling body is clamped or all three, whose length is then 52 rad/s."""
    t = np.linspace(0.0, 8.0, 400)[:, np.newaxis]
    spins = size * (np.array([0.9, 0.6, -1.0]) + np.array([0.2, 1.1, 0.4]) * np.sin(t * [1.3, 2.1, 1.7] + [0.3, 1.0, 2.0]))
    motions = [turning(np.concatenate([share * spins[:1], reduced(share * spins[1:])]).astype(precision)) for share in (1.0, 1.07)]
    assert [one.size for one in clamped(*motions, float(np.finfo(precision).eps))] == pytest.approx([clamp])


# Planted faults.


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


@pytest.mark.extended
@pytest.mark.parametrize("name", ["drop-ball", "drop-box-flat", "slip-stick"])
def test_engine_that_never_moves_is_sound_nowhere(name):
    """At any step and height, even where the metrics cannot resolve the motion."""
    for axis in ("step", "restitution", "height"):
        if AXES[axis].applies(load(name)):
            assert "sound" not in {point.mode for point in along(name, axis, Frozen()).points}, axis


def test_clamp_of_the_norm_is_found():
    """It shows in no component, and begins in the middle of a fall."""

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
        found = scan_axis(Runner(engine_entry(Slow()), OperatingPoint(thrown, DT), 0.1, processes), AXES["duration"])
    assert found.points[-1].mode == "clamped"
    assert found.points[-1].diagnosis.size == pytest.approx(30.0)


def test_planted_faults_are_found_where_they_begin():
    inside, outside = first(along("spin-principal", "spin", Planted()), "clamped")
    assert inside <= 37.0 < outside <= 1.03 * inside
    found = along("spin-principal", "mass", Planted())
    inside, outside = first(found, "inaccurate")
    assert (inside, outside) == (512.0, 1024.0)
    assert next(point for point in found.points if point.value == 1024.0).diagnosis.criterion == "depends on mass"
    light = [point.value for point in found.points if point.mode == "crashed"]
    assert max(light) == 2.0**-20 < 1e-6 < 2.0**-19


def unsound_points(name, axes=()):
    """Where the exact engine is not sound on some axes of a scene, or on all of them."""
    found = find_limits(load(name), [Exact()], axes, resources=QUICK)
    assert [scan.axis.name for scan in found.scans] == list(axes or [axis.name for axis in AXES.values() if axis.applies(load(name))])
    return [(scan.axis.name, point.value, point.diagnosis) for scan in found.scans for point in scan.points if point.mode != "sound"]


FURTHER = {"spin-asymmetric": ["step", "spin", "inertia-ratio"], "drop-ball-lively": ["restitution", "height"], "rock-block": ["duration"]}
"""Axes on which the motion of a scene is of another kind than those of the scenes that are scanned on all."""


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ["spin-principal", "drop-box-flat"])
def test_exact_engine_is_sound_everywhere(name):
    """On all axes of a scene, at all values."""
    assert unsound_points(name) == []


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", FURTHER)
def test_exact_engine_is_sound_where_the_motion_is_of_another_kind(name):
    assert unsound_points(name, FURTHER[name]) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", FURTHER)
def test_exact_engine_is_sound_on_all_axes_of_the_other_scenes(name):
    assert unsound_points(name) == []


@pytest.mark.extended
@pytest.mark.usefixtures("engine_processes")
def test_limits_do_not_depend_on_the_number_of_jobs():
    """Also where an engine ends its process."""

    class Aborting(Planted):
        name = "aborting"

        def prepare(self, scene, dt):
            if dt > 0.1:
                os.abort()
            return super().prepare(scene, dt)

    studies = [find_limits("spin-principal", ["wang", Aborting()], ["spin", "step", "mass"], resources=QUICK, jobs=jobs) for jobs in (1, 2)]
    assert repr(studies[0]) == repr(studies[1])
    assert {point.mode for scan in studies[0].scans for point in scan.points} >= {"sound", "clamped", "crashed", "inaccurate"}


@pytest.mark.usefixtures("engine_processes")
def test_crash_of_the_process_is_a_failure_mode():
    class Leaving(Exact):
        name = "leaving"

        def prepare(self, scene, dt):
            if dt > 0.1:
                os.abort()
            return ExactSimulation(scene, dt)

    found = along("spin-principal", "step", Leaving())
    inside, outside = first(found, "crashed")
    assert inside <= 0.1 < outside <= 1.03 * inside


# Known failures of the engines.


@pytest.mark.slow
def test_finds_clamps_of_pybullet():
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


def test_finds_short_rotations_of_pybullet():
    """Beyond π/4 a step; the tolerance is exceeded 1 % later."""
    found = along("spin-principal", "step", "pybullet")
    outside = 5.0 * first(found, "inaccurate")[1]
    assert math.pi / 4 < outside < 1.03 * math.pi / 4


@pytest.mark.parametrize("name", ["wang[rotation=gyroscopic]", "mujoco"])
def test_finds_the_blow_up_of_the_explicit_gyroscopic_term(name):
    """The energy rises, then the state is not finite; MuJoCo's Euler has the same term."""
    found = along("spin-asymmetric", "spin", name)
    assert "gains_energy" in {point.mode for point in found.points}
    _, outside = first(found, "diverged")
    assert outside == pytest.approx(23.5, rel=0.05)  # measured 23.5 rad/s, .12 rad a step


@pytest.mark.extended
def test_finds_the_faults_of_wang_method():
    """It sinks at restitution 0, gains energy near 1, and never rests in between."""
    sinking = along("rock-block", "duration", "wang")
    assert sinking.points[0].mode == "sinks"
    assert first(sinking, "tunnels")[1] == pytest.approx(1333, rel=0.1)  # s, until the whole body is below the floor
    inside, outside = first(along("drop-ball-lively", "restitution", "wang"), "gains_energy")
    assert 0.98 < inside < outside < 1.0
    restless = along("drop-ball-lively", "duration", "wang")
    assert first(restless, "inaccurate")[1] == pytest.approx(9.7, rel=0.05)  # it comes to rest at 8.6 s, a tenth before the end
    assert restless.points[-1].diagnosis.criterion == "never rests"
    # Its limit cycle strikes the floor at g h/(1 - e), ten times g h.
    assert 9.0 <= restless.points[-1].diagnosis.size <= 19.0


@pytest.mark.extended
@pytest.mark.usefixtures("all_start_phases")
def test_finds_that_thin_bodies_pass_the_floor():
    """A box of 0.3 m that falls at 4.4 m/s passes it in steps of 68 ms or more, as they fall; at rest, by the length of its last step."""
    assert first(along("drop-box-flat", "step", "mujoco"), "tunnels")[1] == pytest.approx(0.3 / 4.427, rel=0.1)
    smallest = along("drop-box-flat", "size", "wang").points[0]
    assert (smallest.mode, smallest.value < 2e-4) == ("tunnels", True)


# The study.


SPIN = load("spin-principal")


def test_largest_steps_are_those_whose_finer_steps_all_pass():
    points = tuple(
        ScanPoint(value, SOUND._replace(mode=mode))
        for value, mode in ((0.001, "sound"), (0.01, "inaccurate"), (0.1, "sound"), (1.0, "diverged"))
    )
    study = LimitsStudy(SPIN, DT, 0.1, (AxisScan(AXES["step"], "exact", 0.001, points),), {}, {})
    assert study.step_ranges("exact") == ((0.001, 0.001), (0.001, 0.1))


def test_steps_begin_where_rounding_no_longer_errs_if_the_nominal_one_is_right():
    """An error that is small by chance at one coarse time step begins no range."""
    modes = ("inaccurate", "inaccurate", "sound", "sound", "inaccurate", "sound")
    points = tuple(ScanPoint(10.0**number, SOUND._replace(mode=mode)) for number, mode in enumerate(modes))
    for nominal, accurate in ((1e3, (1e2, 1e3)), (1e4, None)):
        study = LimitsStudy(SPIN, DT, 0.1, (AxisScan(AXES["step"], "exact", nominal, points),), {}, {})
        assert study.step_ranges("exact") == (accurate, (1.0, 1e5))


def test_unknown_and_absent_axes_are_errors():
    with pytest.raises(DropspinError, match="axis 'spn' is unknown"):
        find_limits(SPIN, [Exact()], ["spn"])
    with pytest.raises(DropspinError, match="axis 'restitution': spin-principal does not have it; it has step, spin"):
        find_limits(SPIN, [Exact()], ["restitution"])
