"""The results of jobs: those of a run, closed forms, and the same bits however jobs are grouped."""

import itertools
import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import engines as made

import dropspin as ds
from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.engines.wang import Wang
from dropspin.comparisons.measuring.batch_quantities import motions_side_by_side
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.motion_quantities import Motions, Setup
from dropspin.comparisons.running.adapter_output import UNIT_TOLERANCE
from dropspin.comparisons.running.driving import record_batch
from dropspin.comparisons.sweeps.outcomes import STANDARD_METRICS, concatenated, not_run, run_scenes, standard_metrics
from dropspin.comparisons.sweeps.parts import run_jobs
from dropspin.comparisons.sweeps.spec import load_sweep
from dropspin.scenarios import load, names

SCENES = [name for name in names() if "slow" not in load(name).tags]
DT = 8e-3


def metrics_of_a_run(scene, motion):
    """The standard metrics as a run measures them without an exact solution."""
    case = Comparison(scene, motion)
    by_name = [METRICS[name] for name in ("energy_drift", "energy_gain", "penetration")]
    values = [metric.value_or_nan([case]) if metric.applies(scene, None) else np.nan for metric in by_name]
    contact = case.first_contact
    rebound = 0.0 if contact is None else motion.position[contact[1] :, 1].max() / motion.position[0, 1]
    rebound = np.nan if scene.has_edges_or_walls else rebound
    return [*values, rebound, float(motion.t[Motions.of(scene, motion).last_row_in_motion])]


@pytest.mark.extended
@pytest.mark.parametrize("name", SCENES)
def test_standard_metrics_are_those_of_a_run(name):
    """All scenes, three engines: the same bits, and NaN in the same places."""
    scene = load(name)
    for label in ("wang", "mujoco", "pybullet"):
        if engine(label).refusal(scene) is not None:
            continue
        with warnings.catch_warnings(action="ignore"):
            motion = ds.simulate(scene, label, DT)
        dt, lag, last = (np.array([value]) for value in (DT, motion.velocity_lag, len(motion) - 1))
        motions, valid = motions_side_by_side(Setup.of_starts([scene]), motion.states[np.newaxis], dt, lag, last, UNIT_TOLERANCE)
        assert valid.all()
        # Scenes with walls are measured one by one.
        found = standard_metrics(motions)[0] if scene.wall is None else standard_metrics(Motions.of(scene, motion))
        np.testing.assert_array_equal(found, metrics_of_a_run(scene, motion))


def run_all(sweep):
    """The outcomes of all jobs, and their standard metrics by name."""
    outcomes = run_jobs(sweep, 0, sweep.size)
    return outcomes, dict(zip(STANDARD_METRICS, outcomes.standard_metrics.T, strict=True))


def test_free_fall_ends_at_the_closed_form_of_semi_implicit_euler():
    """From rest y₀ − g h² n(n+1)/2 and −g h n, for each job's own step and gravity; energy does not drift."""
    axes = {"start.position[1]": [100.0, 200.0], "gravity.acceleration[1]": {"from": -20.0, "to": -1.0, "count": 7}}
    sweep = load_sweep({"scenes": ["drop-ball"], "engines": ["wang"], "grid": {"dt": [1e-3, 3e-3, 7e-3], **axes}})
    outcomes, metrics = run_all(sweep)
    [jobs] = sweep.jobs(0, sweep.size)
    n, g, height = outcomes.steps, jobs.values["gravity.acceleration[1]"], jobs.values["start.position[1]"]
    np.testing.assert_array_equal(n, np.floor(1.5 / jobs.dts + 1e-9))
    np.testing.assert_allclose(outcomes.state[:, 1], height + g * jobs.dts**2 * n * (n + 1) / 2, rtol=1e-13)
    np.testing.assert_allclose(outcomes.state[:, 8], g * jobs.dts * n, rtol=1e-12)
    assert np.abs(metrics["energy_drift"]).max() < 1e-13
    assert (metrics["penetration"] == 0.0).all()
    assert (metrics["rebound"] == 0.0).all()


def test_ball_rebounds_to_the_height_of_its_restitution():
    """A ball dropped by H comes back to R + e² H, over R + H, to 5e-4 (an impact is detected up to a step late: g h / v of the fall)."""
    sweep = load_sweep(
        {"scenes": ["drop-ball"], "engines": ["wang", "mujoco"], "dts": [1e-4], "grid": {"floor.restitution": [0.2, 0.5, 0.9]}}
    )
    outcomes, metrics = run_all(sweep)
    e = np.tile([0.2, 0.5, 0.9], 2)
    assert set(outcomes.verdict) == {"measured"}
    np.testing.assert_allclose(metrics["rebound"], (0.1 + e**2) / 1.1, atol=5e-4)


def assert_same(one, other):
    """All but the time per step has the same bits."""
    for name in ("verdict", "reason", "state", "standard_metrics", "metrics", "steps"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def run_one_by_one(sweep):
    """Each job by itself, through Engine.prepare(...).record."""
    found = []
    for jobs in sweep.jobs(0, sweep.size):
        outcomes = not_run(len(jobs), sweep.metrics)
        run_scenes(jobs, outcomes, sweep.metrics, in_batches=False)
        found.append(outcomes)
    return concatenated(found)


EVERYTHING = [
    {
        "scenes": ["drop-box-anyhow"],
        "engines": ["wang"],
        "dts": [4e-3],
        "seeds": 10,
        "random": {
            "count": 4,
            "seed": 1,
            "body.mass": {"from": 1, "to": 2},
            "body.half_extents[1]": {"from": 0.1, "to": 2.0},
            "floor.restitution": {"from": 0, "to": 1},
            "floor.rest_speed": {"from": 0, "to": 0.5},
            "start.orientation[0]": {"from": -1, "to": 1},
            "start.position[1]": {"from": 0.3, "to": 3},
            "start.velocity[2]": {"from": -1, "to": 1},
            "gravity.acceleration[1]": {"from": -20, "to": 10},
        },
    },
    {
        "scenes": ["drop-box-anyhow"],
        "engines": ["wang[rotation=exact,law=coulomb]", "wang[contact=sequential,law=coulomb]"],
        "grid": {"floor.friction": [0.0, 0.3]},
        "random": {"count": 6, "seed": 1, "dt": {"from": 1e-3, "to": 0.3, "spacing": "log"}, "duration": {"from": 0.1, "to": 0.5}},
        "metrics": ["energy_error", "bounce_height_error"],
    },
    {
        "scenes": ["drop-ball"],
        "engines": ["wang"],
        "grid": {"floor.friction": [0.0, 0.3], "engine.law": ["note", "normal"]},
        "random": {"count": 6, "seed": 1, "dt": {"from": 1e-3, "to": 0.3, "spacing": "log"}, "duration": {"from": 0.1, "to": 0.5}},
        "metrics": ["energy_error", "bounce_height_error"],
    },
    {
        "scenes": ["drop-box-anyhow"],
        "engines": ["wang"],
        "dts": [4e-3],
        "grid": {
            "floor.friction": ["none", "infinite", 0.3],
            "body.half_extents": [[0.1, 0.2, 0.3], [0.1, 0.1, 0.1]],
            "body.inertia": ["note", "solid"],
        },
    },
    {
        "scenes": ["spin-asymmetric", "fall-spin"],
        "engines": ["wang"],
        "dts": [4e-3],
        "grid": {"start.angular_velocity[0]": [1, 1e3, 1e50], "body.mass": [1.0, 1e-200]},
    },
    {
        "scenes": ["spin-damped"],
        "engines": ["wang", "mujoco"],
        "dts": [4e-3],
        "random": {"count": 20, "seed": 2, "damping.linear": {"from": 0, "to": 2}, "damping.angular": {"from": 0, "to": 2}},
    },
]


@pytest.mark.sample(2)
@pytest.mark.parametrize("number", range(len(EVERYTHING)))
def test_job_has_the_same_bits_in_a_batch_and_by_itself(number):
    """Valid or not, with the same reasons."""
    sweep = load_sweep(EVERYTHING[number])
    together = run_jobs(sweep, 0, sweep.size)
    assert "measured" in together.verdict
    assert_same(together, run_one_by_one(sweep))


MASSES = {
    "scenes": ["drop-box-anyhow"],
    "engines": ["mujoco"],
    "dts": [4e-3, 8e-3],
    "grid": {"floor.friction": ["none", 0.3, 2e9], "floor.restitution": [0.2, 1.0], "body.mass": [1.0, 2.0]},
}


@pytest.mark.extended
@pytest.mark.parametrize("mixes", [True, False])
def test_jobs_are_simulated_in_batches(monkeypatch, mixes):
    """Of one time step and, unless the engine mixes scenes, of one scene: with the bits and the reasons of single simulations."""
    kind, sizes = type(engine("mujoco")), []
    prepare_batch = kind.prepare_batch

    def counted(self, members, dt):
        sizes.append(len(members))
        return prepare_batch(self, members, dt)

    monkeypatch.setattr(kind, "prepare_batch", counted)
    monkeypatch.setattr(kind, "mixes_scenes", mixes)
    sweep = load_sweep(MASSES | ({} if mixes else {"seeds": 2}))
    together = run_jobs(sweep, 0, sweep.size)
    assert sizes == [4, 4, 4, 4] if mixes else sizes == [2] * 16
    alone = run_one_by_one(sweep)
    assert_same(together, alone)
    assert set(together.verdict) == {"measured", "declined"}
    assert any("friction" in reason for reason in alone.reason[alone.verdict == "measured"])


@pytest.mark.parametrize("fault", [ValueError("broken"), None])
def test_jobs_of_a_batch_that_breaks_are_run_by_themselves(monkeypatch, fault):
    """Whether it raises or gives other numbers of rows."""
    kind = type(engine("mujoco"))
    broken = made.in_batches("broken", (lambda motions: motions[:1]) if fault is None else throwing(fault), kind)
    monkeypatch.setattr(kind, "prepare_batch", type(broken).prepare_batch)
    sweep = load_sweep(MASSES)
    assert_same(run_jobs(sweep, 0, sweep.size), run_one_by_one(sweep))


def throwing(fault):
    def throw(motions):
        raise fault

    return throw


TUMBLES = load_sweep(EVERYTHING[0])
WHOLE = []


@pytest.mark.extended
@settings(max_examples=15)
@given(st.sets(st.integers(1, TUMBLES.size - 1), max_size=8))
def test_job_has_the_same_bits_in_any_part(cuts):
    edges = [0, *sorted(cuts), TUMBLES.size]
    WHOLE[:] = WHOLE or [run_jobs(TUMBLES, 0, TUMBLES.size)]
    assert_same(concatenated([run_jobs(TUMBLES, first, last) for first, last in itertools.pairwise(edges)]), WHOLE[0])


@pytest.mark.parametrize("label", ["mujoco", "pybullet"])
def test_other_engines_keep_no_state_between_jobs(label):
    """Jobs after others, and backwards, one by one: the same bits."""
    spec = {"scenes": ["drop-box-anyhow"], "engines": [label], "dts": [4e-3], "seeds": 3, "grid": {"floor.restitution": [0.2, 0.8]}}
    sweep = load_sweep(spec)
    backwards = [run_jobs(sweep, number, number + 1) for number in reversed(range(sweep.size))]
    assert_same(run_jobs(sweep, 0, sweep.size), concatenated(backwards[::-1]))


class Hasty(Wang):
    """Its steps are one per cent longer than asked."""

    name = "hasty"

    def prepare(self, scene, dt):
        return super().prepare(scene, 1.01 * dt)


def test_adapter_that_extends_another_is_simulated_by_its_own_code():
    """Neither in the arrays of a sweep nor in a batch of a run: the adapter that it extends would take its place."""
    hasty, scene = Hasty(), load("fall-spin")
    sweep = replace(load_sweep({"scenes": ["fall-spin"], "engines": ["wang"], "dts": [1e-2]}), engines=(hasty,))
    states = ds.simulate(scene, hasty, 1e-2).states
    np.testing.assert_array_equal(run_jobs(sweep, 0, 1).state[0], states[-1])
    np.testing.assert_array_equal(record_batch(hasty, [scene, scene], 1e-2)[1].motion.states, states)
    assert states[-1][1] < ds.simulate(scene, "wang", 1e-2).states[-1][1] - 0.05
    assert not type("Mixed", (type("Mixin", (), {"prepare": Hasty.prepare}), Wang), {"name": "mixed"})().steps_batches


def test_requested_metrics_are_those_of_measure():
    """NaN where a metric does not apply to the scene."""
    scenes, asked = ["drop-ball", "spin-asymmetric"], ["energy_error", "bounce_height_error", "orientation_error"]
    sweep = load_sweep({"scenes": scenes, "engines": ["wang", "mujoco"], "dts": [2e-3], "metrics": asked})
    found = run_jobs(sweep, 0, sweep.size).metrics
    for (name, label), row in zip([(name, label) for name in scenes for label in ("wang", "mujoco")], found, strict=True):
        expected = ds.measure(load(name), ds.simulate(load(name), label, 2e-3))
        assert list(row) == pytest.approx([expected.get(metric, np.nan) for metric in asked], nan_ok=True, rel=1e-15)


def test_jobs_that_are_not_valid_report_the_reason():
    """A body below the floor, a step too long, a friction that the law does not support: each in its own row; the others are measured."""
    grid = {"start.position[1]": [0.05, 1.0], "floor.friction": [0.0, 0.3], "dt": [1e-2, 0.5]}
    sweep = load_sweep({"scenes": ["drop-ball"], "engines": ["wang"], "grid": grid | {"body.radius": [0.01, 0.1]}})
    outcomes = run_jobs(sweep, 0, sweep.size)
    [jobs] = sweep.jobs(0, sweep.size)
    low = (jobs.values["start.position[1]"] == 0.05) & (jobs.values["body.radius"] == 0.1)
    rubs, long = jobs.values["floor.friction"] == 0.3, jobs.dts == 0.5
    assert all("0.05 m below the floor" in reason for reason in outcomes.reason[low])
    assert all("dt: got 0.5 s" in reason for reason in outcomes.reason[~low & long])
    assert all("no Coulomb coefficient" in reason for reason in outcomes.reason[~low & ~long & rubs])
    np.testing.assert_array_equal(outcomes.verdict == "measured", ~low & ~long & ~rubs)
    np.testing.assert_array_equal(outcomes.verdict == "declined", low | long | rubs)
    assert np.isfinite(outcomes.standard_metrics[outcomes.verdict == "measured"]).all()
