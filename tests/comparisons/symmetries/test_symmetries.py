"""Symmetries: exact solutions keep all of them; planted faults lose those that they must lose, from the time step at which they begin."""

import itertools
import os

import numpy as np
import pytest
from support import engines as made

from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.measuring.symmetries import AGAIN, BATCH, HALVES, NAMES, NEW_PROCESS, ONE_CORE, SYMMETRIES
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.comparisons.symmetries.study import SCENES, findings_of, states_of, symmetries
from dropspin.reference_impl.threads import usable_cores
from dropspin.scenarios import DropspinError, load, truth_for

DT = 4e-3


def statuses(engine, scene, dt=DT):
    return {one.symmetry: one for one in symmetries(scene, engine, dt=dt)}


def lost(engine, scene):
    return {name for name, one in statuses(engine, scene).items() if one.status in ("lost", "nearly kept")}


@pytest.mark.sample(1)
@pytest.mark.parametrize("scene", [*SCENES, "fall-tilted", "spin-damped", "rock-block"])
def test_exact_solutions_keep_every_symmetry(scene):
    """Each is computed anew for the transformed scene, also with a full inertia tensor, tilted gravity and damping."""
    scene = load(scene)
    scene = scene.model_copy(update={"duration": min(scene.duration, 0.9 * truth_for(scene).horizon, 1.0)})
    found = statuses(made.Exact(), scene)
    not_kept = {name: one.status for name, one in found.items() if one.status != "kept"}
    assert not_kept == ({} if usable_cores() > 1 else {ONE_CORE: "not run"})
    assert {AGAIN, BATCH, NEW_PROCESS, HALVES, "turned by 1 rad", "mirrored", "other body axes", "in grams"} <= set(found)


@pytest.mark.parametrize("name", SYMMETRIES)
def test_transformed_scene_is_another_and_has_the_same_solution(name):
    """A bounce off the floor under tilted gravity, or a body of points where gravity cannot be tilted: to 1e-9."""
    symmetry, scene = SYMMETRIES[name], load("fall-tilted")
    transformed, times = symmetry.transformed(scene), np.linspace(0.0, scene.duration, 9)
    assert transformed.digest != scene.digest
    found = symmetry.back(times, truth_for(transformed)(symmetry.time * times).states)
    expected = truth_for(scene)(times).states
    found[:, 3:7] *= np.sign(np.sum(found[:, 3:7] * expected[:, 3:7], axis=1))[:, None]  # q and -q are the same orientation
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 if "km" in name else 1e-10)


@pytest.mark.extended
def test_document_keeps_every_symmetry_of_every_scene_that_it_runs():
    """What the note gets wrong is wrong alike in every direction, at every place and in all units."""
    found = symmetries(engines="wang", dt=2e-3)
    assert {one.status for one in found if one.scene != "roll-ball"} <= {"kept", "not run"}
    assert {one.status for one in found if one.scene in ("spin-asymmetric", "drop-box-anyhow", "drop-box-sticking")} == {"kept"}


@pytest.mark.extended
def test_findings_do_not_depend_on_the_number_of_jobs():
    one, two = (symmetries(["fall-tilted", "spin-principal"], [made.Exact(), "wang"], dt=DT, jobs=jobs) for jobs in (1, 2))
    assert repr(one) == repr(two)
    assert [(found.scene, found.engine) for found in one if found.symmetry == AGAIN] == [
        (scene, name) for scene in ("fall-tilted", "spin-principal") for name in ("exact", "wang")
    ]


def pushed_along(axis, size):
    """An acceleration along an axis of the world that the scene does not have."""

    def distort(state, time):
        state = state.copy()
        state[axis] += size * time**2
        return state

    return distort


def test_hidden_world_axis_is_found_by_turning():
    found = lost(made.engine_with("pushed", pushed_along(0, 1e-3)), "spin-asymmetric")
    assert {"turned by 90°", "turned by 1 rad", "mirrored"} <= found
    assert not {AGAIN, BATCH, NEW_PROCESS, "other body axes", "10 m away", "in grams"} & found


def test_state_that_is_not_complete_is_found_by_stopping_half_way():
    """An upward push that depends on the time since the start, which a new simulation does not know."""
    found = lost(made.engine_with("aging", pushed_along(1, 1e-3)), "spin-asymmetric")
    assert HALVES in found
    assert not {"turned by 1 rad", "mirrored", AGAIN, NEW_PROCESS} & found


@pytest.mark.extended
def test_rounding_that_depends_on_the_position_is_found_far_away():
    """Single precision that is not declared: 1000 km away, positions are multiples of 6 cm."""

    def distort(state, time):
        state = state.copy()
        state[:3] = state[:3].astype(np.float32)
        return state

    found = statuses(made.engine_with("rounding", distort), "drop-ball-backspin")
    assert found["1000 km away"].status == "lost"
    assert found["1000 km away"].step == 1
    assert found["1000 km away"].difference > found["1 km away"].difference > found["10 m away"].difference
    assert found["in grams"].status == "kept"


@pytest.mark.extended
def test_friction_along_axes_is_found_by_turning_by_an_angle_that_no_grid_has():
    """Each horizontal component of the velocity is slowed by itself; along x, as in the scene, that is right."""
    scene = load("slide-box")
    deceleration = scene.floor.friction * 9.8

    class AlongAxes(made.Exact):
        name = "along-axes"

        def prepare(self, scene, dt):
            start = scene.initial_state

            def distort(state, time):
                state = state.copy()
                for axis in (0, 2):
                    speed = start[7 + axis]
                    until = min(time, abs(speed) / deceleration)
                    state[axis] = start[axis] + speed * until - 0.5 * np.sign(speed) * deceleration * until**2
                    state[7 + axis] = speed - np.sign(speed) * deceleration * until
                return state

            return made.ExactSimulation(scene, dt, distort)

    found = lost(AlongAxes(), scene)
    assert "turned by 1 rad" in found
    assert not {"turned by 90°", "mirrored", "other body axes", "10 m away", AGAIN} & found


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("unit", "distort"),
    [
        ("in millimetres", lambda state, time: state * np.array([1.0] * 7 + [min(1.0, 1e2 / np.linalg.norm(state[7:10]))] * 3 + [1.0] * 3)),
        ("in milliseconds", lambda state, time: state * np.array([1.0] * 10 + [0.999 if np.linalg.norm(state[10:]) < 0.1 else 1.0] * 3)),
    ],
)
def test_thresholds_with_a_unit_are_found(unit, distort):
    """A speed that is clamped at 100 m/s, and one of rotation below which the body is slowed."""
    found = lost(made.engine_with("thresholds", distort), "fall-spin")
    assert unit in found
    assert not {"turned by 1 rad", "10 m away", "in grams", AGAIN} & found


@pytest.mark.parametrize("height", [0.5, 0.501])
def test_unit_in_the_depth_of_a_contact_is_found_also_if_the_body_starts_in_contact(height):
    """MuJoCo's default contacts have lengths in m and times in s; whether a box touches at its start depends on rounding, but later not."""
    box = {"shape": "box", "half_extents": [0.5, 0.5, 0.5], "mass": 1e3}
    tables = {"gravity": {"acceleration": [0.0, -9.8, 0.0]}, "floor": {"restitution": 0.0, "friction": 1.0}}
    scene = load({"duration": 1.0, "body": box, "start": {"position": [0.0, height, 0.0]}, **tables})
    names = ["in millimetres", "in milliseconds", "in grams", "turned by 90°"]
    entry = engine_entry("mujoco[profile=default]")
    found = findings_of(entry, scene, 2e-3, states_of(entry, scene, 2e-3), names)
    assert [one.status for one in found] == ["lost", "lost", "kept", "kept"]


def test_fault_that_is_tied_to_the_vertical_is_found_in_flight():
    """A spin that loses its vertical component: every scene that is turned about the vertical loses as much."""

    def slowed(state, time):
        return state * np.where(np.arange(13) == 11, 1.0 - 1e-3 * time, 1.0)

    found = lost(made.engine_with("slowed", slowed), "fall-spin")
    assert "tilted by 1 rad" in found
    assert not {"turned by 90°", "turned by 1 rad", "mirrored", "other body axes", AGAIN} & found


def test_threshold_of_mass_is_found():
    class Heavy(made.Exact):
        name = "heavy"

        def prepare(self, scene, dt):
            push = pushed_along(1, 1e-3) if scene.body.mass > 100.0 else None
            return made.ExactSimulation(scene, dt, push)

    assert lost(Heavy(), "fall-spin") == {"in grams"}


@pytest.mark.extended
def test_noise_of_one_ulp_is_found_with_its_first_step():
    """In each new simulation another number has it, after half of the scene."""
    ulps = itertools.count()

    class Noisy(made.Exact):
        name = "noisy"

        def prepare(self, scene, dt):
            share = 1.0 + next(ulps) * np.finfo(float).eps
            return made.ExactSimulation(scene, dt, lambda state, time: state * share if time > 0.5 * scene.duration else state)

    scene = load("spin-asymmetric")
    found = statuses(Noisy(), scene)
    assert found[AGAIN].status == "nearly kept"
    assert found[AGAIN].step == 1 + scene.steps(DT) // 2
    assert found[AGAIN].time == pytest.approx(found[AGAIN].step * DT)
    assert found["turned by 1 rad"].status == "kept"


def test_batch_with_other_results_is_found_and_does_not_depend_on_the_number_of_cores():
    def pushed(motions):
        motions[:, 1:, 0] += 1e-9
        return motions

    assert lost(made.in_batches("pushed", pushed), "fall-spin") == {BATCH}


@pytest.mark.sample(1)
@pytest.mark.parametrize("scene", ["drop-ball", "fall-spin", "turn-box-flat"])
def test_batch_that_swaps_two_members_is_found(scene):
    """Also of a body that starts at rest, and where their differences have opposite signs."""

    def swapped(motions):
        motions[:, 1:] = motions[[1, 0, 2], 1:]
        return motions

    assert lost(made.in_batches("swapped", swapped), scene) == {BATCH}


@pytest.mark.extended
@pytest.mark.parametrize("scene", ["fall-spin", "spin-asymmetric", "drop-ball", "spin-damped"])
def test_batch_that_steps_all_scenes_with_the_numbers_of_the_first_is_found(scene):
    """Of an engine that says that it mixes scenes."""

    class OfTheFirst(type(engine("mujoco"))):
        name = "of-the-first"

        def prepare_batch(self, members, dt):
            return super().prepare_batch([members[0].starting_at(member.initial_state) for member in members], dt)

    assert BATCH in lost(OfTheFirst(), scene)


def test_result_that_a_new_process_changes_is_found():
    """Of each process, the first simulation differs from the later ones."""
    prepared = itertools.count()

    class First(made.Exact):
        name = "first"

        def prepare(self, scene, dt):
            return made.ExactSimulation(scene, dt, None if next(prepared) else pushed_along(1, 1e-9))

    assert AGAIN in lost(First(), "fall-spin")


def test_result_that_depends_on_the_number_of_cores_is_found():
    """As of a sum that each thread begins anew."""

    def summed(motions):
        motions[:, 1:, 0] *= 1.0 + np.finfo(float).eps * (len(os.sched_getaffinity(0)) == 1)
        return motions

    scene = load("fall-spin")
    moved = scene.starting_at(scene.initial_state + np.eye(13)[0])
    assert lost(made.in_batches("threaded", summed), moved) == ({ONE_CORE} if len(os.sched_getaffinity(0)) > 1 else {BATCH})


def test_boost_applies_where_nothing_slows_the_body():
    name = "moving at 10 m/s"
    having = {scene for scene in ("fall-spin", "drop-ball", "spin-damped", "slide-box") if SYMMETRIES[name].applies(load(scene))}
    assert having == {"fall-spin", "drop-ball"}


def test_engines_that_do_not_run_have_a_reason_and_cost_no_other_engine_its_findings():
    found = symmetries(["drop-ball"], [made.Crashing(), "wang"], dt=DT)
    crashing = [one for one in found if one.engine == "crashing"]
    assert {one.symmetry for one in crashing} == set(NAMES)
    assert {(one.status, "no such thing as a floor" in one.reason) for one in crashing} == {("not run", True)}
    assert {one.status for one in found if one.engine == "wang"} == {"kept"}


def test_time_step_is_verified():
    with pytest.raises(DropspinError, match="dt: got 0"):
        symmetries("drop-ball", "wang", dt=0.0)
