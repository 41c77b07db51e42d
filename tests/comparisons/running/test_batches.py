"""Batches of scenes that differ in all numbers: each member moves as it does alone, with the same limitations."""

import importlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.running.driving import record, record_batch
from dropspin.scenarios import load
from dropspin.scenarios.model import differ_in_start_alone
from dropspin.scenarios.variations import with_other_numbers

DT = 1e-3
SCENES = (
    "spin-asymmetric",
    "spin-damped",
    "fall-tilted",
    "drop-ball-backspin",
    "drop-box-anyhow",
    "drop-box-corner",
    "slide-box",
    "rock-block",
)


def mixed(name):
    """A scene of half a second and two with other numbers, of the same structure."""
    scene = load(name).model_copy(update={"duration": 0.5})
    members = [scene, with_other_numbers(scene, 1.1), with_other_numbers(scene, 1.3)]
    assert len({member.structure for member in members}) == 1
    assert not any(differ_in_start_alone([scene, member]) for member in members[1:])
    return members


@pytest.mark.extended
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("label", ["wang", "wang[law=coulomb,contact=sequential]", "mujoco", "mujoco[body=mesh]"])
def test_scenes_with_other_numbers_have_the_bits_of_single_simulations(label, name):
    chosen, members = engine(label), mixed(name)
    if any(map(chosen.declines, members)):
        assert chosen.refusal(members[0])
        return
    assert chosen.mixes_scenes
    assert chosen.prepare_batch(members, DT) is not None
    for member, together in zip(members, record_batch(chosen, members, DT, limitations=True), strict=True):
        alone = record(chosen, member, DT)
        np.testing.assert_array_equal(together.motion.states, alone.motion.states)
        if chosen.name == "mujoco":  # `wang` counts unsolved steps in single simulations alone
            assert together.limitations == alone.limitations


def test_meshes_of_unequal_sizes_are_not_stepped_together():
    """MuJoCo's rollout would give NaN, because it steps all models in the same data; single simulations take the place of the batch."""
    chosen, box = engine("mujoco[body=mesh]"), load("drop-box-corner").model_copy(update={"duration": 1.0})
    pyramid = load("drop-box-corner").model_dump(exclude_none=True, exclude={"expect"})
    pyramid["body"] = {"shape": "vertices", "mass": 1.0, "points": [[1, -1, 1], [1, -1, -1], [-1, -1, 0], [0, 1, 0]]}
    pyramid["start"]["position"] = [0.0, 3.0, 0.0]
    members = [box, load(pyramid | {"duration": 1.0, "name": "pyramid"})]
    assert chosen.prepare_batch(members, DT) is None
    for member, recording in zip(members, record_batch(chosen, members, DT), strict=True):
        np.testing.assert_array_equal(recording.motion.states, record(chosen, member, DT).motion.states)


BENCHMARKS = Path(__file__).parents[3] / "benchmarks"


@pytest.mark.extended
def test_benchmark_of_a_run_prints_its_parts():
    """In a process of its own, because it replaces methods by timed ones."""
    code = "import run_cost; run_cost.run_cost([run_cost.ds.load('fall-spin')])"
    done = subprocess.run([sys.executable, "-c", code], cwd=BENCHMARKS, check=True, capture_output=True, text=True)
    assert [line.partition(":")[0] for line in done.stdout.splitlines()] == [
        "timing of steps",
        "exact motions",
        "building",
        "stepping and recording",
        "metrics",
        "judging over time steps",
        "all else",
        "report",
        "the run and its report",
    ]


def test_calls_of_engines_in_the_benchmark_end_where_batches_end(monkeypatch):
    """`make bench` compares their times."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    bench = importlib.import_module("batch")
    monkeypatch.setattr(bench, "STEPS", 20)
    members = bench.members("drop", 3)
    alone = bench.document_alone(members, 20)()
    np.testing.assert_array_equal(alone[:, -1], bench.last_states(engine("wang"), members))
    states, _ = bench.mujoco_alone(members, 1)()
    np.testing.assert_array_equal(states[:, -1, 1:4], bench.last_states(engine("mujoco"), members)[:, [0, 1, 2]])
