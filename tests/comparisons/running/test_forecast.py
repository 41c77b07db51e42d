"""The forecast of a run: the simulations that it counts are those that a run does, and its times follow from those of the steps."""

import pytest
from support import engines as made

import dropspin as ds
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.comparisons.running.engine_study import EngineStudy
from dropspin.comparisons.running.forecast import MEASURING, Forecast, forecast, simulations
from dropspin.comparisons.running.process_limits import FIVE_MINUTES
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.start_phases import StartPhase, phases_at
from dropspin.comparisons.running.timing import Timing
from dropspin.reports.stories.run import forecast_sentence

DT = 8e-3
SCENES = ("drop-ball", "spin-principal", "roll-prism", "drop-box-anyhow")
"""Impacts; free flight; a body that touches the floor and strikes it later; an ensemble."""


def prepared(name, quick=False):
    scene = ds.load(name)
    return StartPhase(scene, ds.truth_for(scene), quick)


@pytest.mark.extended
@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("name", SCENES)
def test_simulations_are_those_that_a_run_does(name, quick):
    own, entry, reported = prepared(name, quick), engine_entry("wang"), []
    with EngineProcesses(FIVE_MINUTES) as processes:
        study = EngineStudy(own, entry, processes, reported.append)
        study.run_at(DT, phases_at(own, DT), Timing())
    outcome = study.outcomes[0].run.outcome
    last = reported[-2]
    assert last.done == last.total
    assert simulations(own, entry, DT) == last.total + (0 if outcome is None else len(outcome.rebound))


@pytest.mark.usefixtures("all_start_phases")
def test_forecast_follows_from_the_times_of_the_steps():
    """A ball of 33 simulations and a spin of 5, or of 9 and 1 in a quick run; an engine that is absent takes no time."""
    scenes = [prepared("drop-ball"), prepared("spin-principal")]
    entries = [engine_entry(made.Exact()), EngineEntry("absent", None, "missing", "not installed")]
    timings = {(own.scene.name, entry.label, DT): Timing() for own in scenes for entry in entries}
    timings |= {(own.scene.name, "exact", DT): Timing(1e-3) for own in scenes}
    ball, spin = (own.scene.steps(DT) * (1e-3 + MEASURING) for own in scenes)
    found = forecast(scenes, entries, [DT], timings, 1)
    assert found.seconds == pytest.approx(33 * ball + 5 * spin)
    assert found.quick == pytest.approx(9 * ball + spin)
    assert found.by_engine == pytest.approx({"exact": found.seconds, entries[1].label: 0.0})
    assert found.by_scene == pytest.approx({"drop-ball": 33 * ball, "spin-principal": 5 * spin})
    assert forecast(scenes, entries, [DT], timings, 2).seconds == pytest.approx(max(33 * ball, 5 * spin, (33 * ball + 5 * spin) / 2))
    together = {key: timing._replace(in_batches=True) for key, timing in timings.items()}
    one_ball = scenes[0].scene.steps(DT) * (2e-3 + 33 * MEASURING)
    assert forecast(scenes[:1], entries, [DT], together, 1).seconds == pytest.approx(one_ball)


@pytest.mark.parametrize(
    ("found", "sentence"),
    [
        (Forecast(59.0, 2, {"slow": 59.0}, {}, 10.0), ""),
        (Forecast(240.0, 2, {"mujoco": 50.0, "pybullet": 190.0}, {}, 40.0), "about 4 min on 2 processors, of which pybullet about 3 min"),
        (Forecast(600.0, 1, {"slow": 600.0}, {}, 150.0), "about 10 min on 1 processor; --quick takes about 2 min"),
        (Forecast(600.0, 1, {"slow": 600.0}, {}, 600.0), "about 10 min on 1 processor"),
    ],
)
def test_time_is_said_if_a_run_takes_more_than_a_minute(found, sentence):
    assert forecast_sentence(found).removesuffix("; --quick takes less than 1 min") == sentence
