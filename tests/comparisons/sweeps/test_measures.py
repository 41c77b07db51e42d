"""What a sweep measures: what the metrics measure, what paper says, and the same bits however jobs are put together."""

import itertools
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import comparisons
from comparisons.engines.registry import engine
from comparisons.measuring.comparison import Comparison, Unresolved
from comparisons.measuring.metrics import METRICS, last_time_in_motion
from comparisons.sweeps import load_sweep
from comparisons.sweeps.measuring import measured
from comparisons.sweeps.outcomes import Outcomes, joined, moved_alone
from comparisons.sweeps.singly import run_singly
from reference_impl.summary import FIGURES, summarise
from scenarios import load, names

SCENES = [name for name in names() if "slow" not in load(name).tags]


def by_the_metrics(scene, motion):
    """The same figures by the definitions they have elsewhere, without a truth."""
    case = Comparison(scene, motion)
    found = []
    for name in ("energy_drift", "energy_gain", "penetration"):
        try:
            found.append(METRICS[name].average([case]).value if METRICS[name].applies(scene, None) else np.nan)
        except Unresolved:
            found.append(np.nan)
    contact = case.first_contact
    found.append(0.0 if contact is None else motion.position[contact[1] :, 1].max() / motion.position[0, 1])
    return [*found, last_time_in_motion(scene, motion)]


@pytest.mark.parametrize("name", SCENES)
def test_figures_are_those_of_the_metrics(name):
    """All scenes, three engines: to 1e-12 (measured 3e-14), and NaN in the same places."""
    scene = load(name)
    for label in ("document", "mujoco", "pybullet"):
        if engine(label).declines(scene) is not None:
            continue
        with warnings.catch_warnings(action="ignore"):
            motion = comparisons.simulate(scene, label, 2e-3)
        moved = moved_alone(scene, 2e-3, motion.velocity_lag, len(motion))
        figures, bad = summarise(motion.states[np.newaxis], moved, scene.floor is not None, scene.damping is not None)
        assert bad == [-1]
        np.testing.assert_allclose(figures[0], by_the_metrics(scene, motion), rtol=1e-12, atol=1e-12)


def figures_of(sweep):
    found = measured(sweep, 0, sweep.size)
    return found, dict(zip(FIGURES, found.figures.T, strict=True))


def test_free_fall_ends_where_paper_says():
    """Semi-implicit Euler from rest: y₀ − g h² n(n+1)/2 and −g h n, for each job's own step and gravity; energy does not drift."""
    axes = {"start.position[1]": [100.0, 200.0], "gravity.acceleration[1]": {"from": -20.0, "to": -1.0, "count": 7}}
    sweep = load_sweep({"scenes": ["drop-ball"], "engines": ["document"], "grid": {"dt": [1e-3, 3e-3, 7e-3], **axes}})
    found, figures = figures_of(sweep)
    [jobs] = sweep.jobs(0, sweep.size)
    n, g, height = found.steps, jobs.values["gravity.acceleration[1]"], jobs.values["start.position[1]"]
    np.testing.assert_array_equal(n, np.floor(1.5 / jobs.dts + 1e-9))
    np.testing.assert_allclose(found.state[:, 1], height + g * jobs.dts**2 * n * (n + 1) / 2, rtol=1e-13)
    np.testing.assert_allclose(found.state[:, 8], g * jobs.dts * n, rtol=1e-12)
    assert np.abs(figures["energy_drift"]).max() < 1e-13
    assert (figures["penetration"] == 0.0).all()
    assert (figures["rebound"] == 0.0).all()


def test_bounces_rise_as_paper_says():
    """A ball dropped by H comes back to R + e² H, over R + H, to 5e-4 (an impact is noticed up to a step late: g h / v of the fall)."""
    sweep = load_sweep(
        {"scenes": ["drop-ball"], "engines": ["document", "mujoco"], "dts": [1e-4], "grid": {"floor.restitution": [0.2, 0.5, 0.9]}}
    )
    found, figures = figures_of(sweep)
    e = np.tile([0.2, 0.5, 0.9], 2)
    assert set(found.verdict) == {"measured"}
    np.testing.assert_allclose(figures["rebound"], (0.1 + e**2) / 1.1, atol=5e-4)


def the_same(one, other):
    """All but the time, bit for bit."""
    for name in ("verdict", "reason", "state", "figures", "metrics", "steps"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def one_by_one(sweep):
    """Each job by itself, through Engine.prepare(...).record."""
    lots = []
    for jobs in sweep.jobs(0, sweep.size):
        found = Outcomes.blank(len(jobs), len(sweep.metrics))
        for place in range(len(jobs)):
            run_singly(jobs, place, found, sweep.metrics)
        lots.append(found)
    return joined(lots)


EVERYTHING = [
    {
        "scenes": ["drop-box-anyhow"],
        "engines": ["document"],
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
        "scenes": ["drop-box-anyhow", "drop-ball"],
        "engines": ["document", "document[rotation=exact]", "document[law=coulomb]", "document[contact=sequential,law=coulomb]"],
        "grid": {"floor.friction": [0.0, 0.3], "engine.correction": ["none", "projection"]},
        "random": {"count": 6, "seed": 1, "dt": {"from": 1e-3, "to": 0.3, "spacing": "log"}, "duration": {"from": 0.1, "to": 0.5}},
        "metrics": ["energy_error", "bounce_height_error"],
    },
    {
        "scenes": ["drop-box-anyhow"],
        "engines": ["document"],
        "dts": [4e-3],
        "grid": {
            "floor.friction": ["none", "infinite", 0.3],
            "body.half_extents": [[0.1, 0.2, 0.3], [0.1, 0.1, 0.1]],
            "body.inertia": ["note", "solid"],
        },
    },
    {
        "scenes": ["spin-asymmetric", "fall-spin"],
        "engines": ["document", "document[rotation=rk4]"],
        "dts": [4e-3],
        "grid": {"start.angular_velocity[0]": [1, 1e3, 1e200], "body.mass": [1.0, 1e-200]},
    },
    {
        "scenes": ["spin-damped"],
        "engines": ["document", "mujoco"],
        "dts": [4e-3],
        "random": {"count": 20, "seed": 2, "damping.linear": {"from": 0, "to": 2}, "damping.angular": {"from": 0, "to": 2}},
    },
]


@pytest.mark.parametrize("number", range(len(EVERYTHING)))
def test_a_job_is_what_it_is_alone(number):
    """Side by side or one by one, sound or not: the same bits and the same words."""
    sweep = load_sweep(EVERYTHING[number])
    together = measured(sweep, 0, sweep.size)
    assert "measured" in together.verdict
    the_same(together, one_by_one(sweep))


TUMBLES = load_sweep(EVERYTHING[0])
WHOLE = []


@settings(max_examples=15)
@given(st.sets(st.integers(1, TUMBLES.size - 1), max_size=8))
def test_a_job_is_what_it_is_in_any_company(cuts):
    """However a sweep is cut."""
    edges = [0, *sorted(cuts), TUMBLES.size]
    WHOLE[:] = WHOLE or [measured(TUMBLES, 0, TUMBLES.size)]
    the_same(joined([measured(TUMBLES, first, last) for first, last in itertools.pairwise(edges)]), WHOLE[0])


@pytest.mark.parametrize("label", ["mujoco", "pybullet"])
def test_outside_engines_do_not_remember(label):
    """Jobs after others, and backwards, one by one: the same bits."""
    spec = {"scenes": ["drop-box-anyhow"], "engines": [label], "dts": [4e-3], "seeds": 3, "grid": {"floor.restitution": [0.2, 0.8]}}
    sweep = load_sweep(spec)
    backwards = [measured(sweep, number, number + 1) for number in reversed(range(sweep.size))]
    the_same(measured(sweep, 0, sweep.size), joined(backwards[::-1]))


def test_metrics_of_the_truth_are_those_of_a_measurement():
    """What `comparisons.measure` says of the same motion; NaN where a scene has not got one."""
    scenes, asked = ["drop-ball", "spin-asymmetric"], ["energy_error", "bounce_height_error", "orientation_error"]
    sweep = load_sweep({"scenes": scenes, "engines": ["document", "mujoco"], "dts": [2e-3], "metrics": asked})
    found = measured(sweep, 0, sweep.size).metrics
    for (name, label), row in zip([(name, label) for name in scenes for label in ("document", "mujoco")], found, strict=True):
        told = comparisons.measure(load(name), comparisons.simulate(load(name), label, 2e-3))
        assert list(row) == pytest.approx([told.get(metric, np.nan) for metric in asked], nan_ok=True, rel=1e-15)


def test_jobs_that_cannot_be_say_why():
    """A body below the floor, a step too long, a friction that the law has not got: each its own row, the rest as ever."""
    grid = {"start.position[1]": [0.05, 1.0], "floor.friction": [0.0, 0.3], "dt": [1e-2, 0.5]}
    sweep = load_sweep({"scenes": ["drop-ball"], "engines": ["document"], "grid": grid | {"body.radius": [0.01, 0.1]}})
    found = measured(sweep, 0, sweep.size)
    [jobs] = sweep.jobs(0, sweep.size)
    low = (jobs.values["start.position[1]"] == 0.05) & (jobs.values["body.radius"] == 0.1)
    rubs, long = jobs.values["floor.friction"] == 0.3, jobs.dts == 0.5
    assert all("0.05 m below the floor" in reason for reason in found.reason[low])
    assert all("dt: got 0.5 s" in reason for reason in found.reason[~low & long])
    assert all("no Coulomb coefficient" in reason for reason in found.reason[~low & ~long & rubs])
    np.testing.assert_array_equal(found.verdict == "measured", ~low & ~long & ~rubs)
    np.testing.assert_array_equal(found.verdict == "declined", low | long | rubs)
    assert np.isfinite(found.figures[found.verdict == "measured"]).all()
