"""Start phases: the exact motion from each, and what all motions give at once, are those of each phase by itself, bit for bit."""

import numpy as np
import pytest
from support import engines as made

import dropspin as ds
from dropspin.comparisons.measuring.batch_quantities import AT_ONCE, compute_states
from dropspin.comparisons.measuring.state_quantities import States
from dropspin.comparisons.running.arguments import MOST_ROWS, as_scene
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.comparisons.running.engine_run import motions_from
from dropspin.comparisons.running.perturbed_starts import PERTURBED_PHASES, changes_of_metrics, number_of_simulations
from dropspin.comparisons.running.start_phases import START_PHASES, StartPhase, compare, number_of_phases, phases_at

DT = 4e-3
SCENES = ("drop-box-flat", "spin-asymmetric", "roll-prism", "slide-box")


def phases_of(name):
    scene, truth = ds.load(name), ds.truth_for(ds.load(name))
    times = DT * np.arange(1 + scene.steps(DT), dtype=float)
    phases = phases_at(StartPhase(scene, truth), DT)
    return phases, times, [phase.exact.motion for phase in phases]


def states_at_once(scenes, motions):
    found = list(map(States, scenes, motions))
    for _ in compute_states(found):
        pass
    return found


@pytest.mark.parametrize("name", SCENES)
def test_exact_motions_of_all_phases_are_those_of_each(name):
    phases, times, motions = phases_of(name)
    assert len(phases) == len(motions)
    for phase, motion in zip(phases, motions, strict=True):
        alone = phase.truth(times[phase.truth.covers(times)])
        np.testing.assert_array_equal(motion.t, alone.t)
        np.testing.assert_array_equal(motion.states, alone.states)


@pytest.mark.parametrize("name", SCENES)
def test_quantities_of_all_motions_at_once_are_those_of_each(name):
    """Below the height above which no point touches the floor; a motion that is not finite leaves all to be computed by themselves."""
    phases, _, motions = phases_of(name)
    shortest = min(map(len, motions))
    scenes, motions = [phase.scene for phase in phases], [motion[:shortest] for motion in motions]
    for scene, motion, together in zip(scenes, motions, states_at_once(scenes, motions), strict=True):
        assert set(AT_ONCE) <= vars(together).keys()
        alone = States(scene, motion)
        for quantity in AT_ONCE:
            found, expected = getattr(together, quantity), getattr(alone, quantity)
            np.testing.assert_array_equal(found, np.where(np.isinf(found), np.inf, expected))
        assert not np.isinf(together.lowest_height[alone.lowest_height <= 0.0]).any()
    motions[-1].position[0] = np.nan
    assert not set(AT_ONCE) & vars(states_at_once(scenes, motions)[-1]).keys()


@pytest.mark.usefixtures("all_start_phases")
def test_long_scenes_have_fewer_start_phases():
    """All steps together stay within `MOST_ROWS`, unless a single start takes more."""
    scene = ds.load("drop-ball-lively")
    counts = {dt: number_of_phases(StartPhase(scene, ds.truth_for(scene)), dt) for dt in (1e-3, 1e-4, 2e-6)}
    assert (counts[1e-3], counts[2e-6]) == (START_PHASES, 1)
    assert 1 < counts[1e-4] < START_PHASES
    assert counts[1e-4] * scene.steps(1e-4) <= MOST_ROWS


@pytest.mark.usefixtures("all_start_phases")
@pytest.mark.parametrize(("restitution", "count"), [(0.5, START_PHASES), (0.0, 1)])
def test_impact_after_which_a_body_flies_on_is_no_scene_about_rest(restitution, count):
    """A fast ball whose only impact is at 3 % of the duration: whether it gets through a thin floor depends on the phase."""
    ball = ds.load("drop-ball").model_dump(include={"body", "gravity"})
    floor = {"restitution": restitution, "friction": "none", "half_extents": [1.0, 1.0], "thickness": 0.02}
    start = {"position": [0.0, 1.0 + ball["body"]["radius"], 0.0], "velocity": [0.0, -30.0, 0.0]}
    scene = as_scene({**ball, "name": "fast", "duration": 1.0, "start": start, "floor": floor})
    assert number_of_phases(StartPhase(scene, ds.truth_for(scene)), 1e-3) == count


@pytest.mark.usefixtures("all_start_phases")
def test_metrics_from_perturbed_starts_are_compared_with_those_from_the_same_phases():
    """If a perturbation changed nothing, no metric would change."""
    scene, entry, asked = ds.load("roll-prism"), engine_entry("wang"), []
    own = StartPhase(scene, ds.truth_for(scene))
    phases = phases_at(own, DT)
    motions = motions_from(entry, [phase.scene for phase in phases], DT, None, lambda *_: None)

    class WithoutEffect:
        def call(self, entry, work, starts, dt, alone, on_simulations):
            asked.extend(starts)
            return motions[:: START_PHASES // PERTURBED_PHASES] * 2

    changes, apart = changes_of_metrics(own, entry, phases, compare(motions, phases), DT, np.float64, WithoutEffect(), lambda _: None)
    assert len(changes) == 2
    assert {change for of_set in [*changes, apart] for change in of_set.values()} == {0.0}
    assert len(asked) == number_of_simulations(own, np.float64, len(phases)) == 2 * PERTURBED_PHASES


@pytest.mark.parametrize("share", [0.0, 1e-3])
def test_difference_between_batches_and_single_simulations_widens_no_tolerance(share):
    """It is no effect of rounding; a row says that there is one."""
    of_rates = np.arange(13) >= 10
    engine = made.in_batches("apart", lambda motions: motions + share * of_rates * (motions - motions[:, :1]))
    found = ds.run("spin-asymmetric", engine, dt=[DT]).table.set_index("metric")
    assert 0.0 < found.loc["energy_error", "tolerance"] < 1e-10
    assert ("" in found.index and "in a batch" in found.loc["", "reason"]) == (share > 0.0)
