"""Adapters of engines with an environment of their own: conformance, flight, one bounce, batches, precision."""

import json
from functools import partial

import numpy as np
import pytest
from support import cli
from support.findings import verify_findings
from support.settings import verify_defaults_are_in_force, verify_settings_are_in_force

from dropspin import scenarios
from dropspin.comparisons.conformance.checks import CHECKS
from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.running.driving import simulate
from dropspin.comparisons.running.run import measure

STEPS = 100
DT = 2e-3


def test_adapter_conforms(case, tmp_path):
    """Every check passes, or notes a peculiarity of the engine, but for a fault that the engine is known to have."""
    done = cli.spawn("conform", case.label, "--json", "--time-limit", 600, cwd=tmp_path, timeout=3600.0)
    found = json.loads(done.stdout)
    failed = {row["check"]: row["message"] for row in found if row["outcome"] not in ("passed", "noted", "declined")}
    assert failed.keys() == case.failing.keys(), failed
    assert all(message.startswith(case.failing[check]) for check, message in failed.items()), failed
    assert [row["check"] for row in found] == list(CHECKS)
    assert done.returncode == bool(case.failing)


def shortened(name, duration):
    return scenarios.load(name).model_copy(update={"duration": duration})


def test_free_rotation_has_the_error_that_was_measured(case):
    """Against the exact asymmetric rotor, to a twentieth; so an integrator that changes is noticed."""
    scene = shortened("spin-asymmetric", 1.0)
    error = measure(scene, simulate(scene, case.label, DT))["orientation_error"]
    assert error == pytest.approx(case.turned, rel=0.05)


def test_ball_rebounds_with_the_restitution_of_the_scene(case):
    scene = shortened("drop-ball", 0.8)
    if case.restitution is None:
        assert engine(case.label).refusal(scene)
        return
    assert abs(measure(scene, simulate(scene, case.label, DT))["restitution_error"]) <= case.restitution


def test_batch_takes_the_steps_of_single_simulations(case):
    """Of three starts that differ in each number."""
    chosen, scene = engine(case.label), scenarios.load("spin-asymmetric")
    start = scene.initial_state
    members = [scene.starting_at(start + 0.01 * k * np.repeat([1.0, 0.0, 1.0], [3, 4, 6])) for k in range(3)]
    together = chosen.prepare_batch(members, DT)
    assert (together is None) == (case.batch is None)
    if together is None:
        return
    together.advance(STEPS // 2)
    together.advance(STEPS - STEPS // 2)
    for member, state in zip(members, np.asarray(together.states(), dtype=float), strict=True):
        with chosen.prepare(member, DT) as simulation:
            simulation.advance(STEPS)
            np.testing.assert_allclose(state, simulation.state(), rtol=0, atol=case.batch * float(np.finfo(chosen.precision).eps))


def test_state_has_the_precision_that_is_claimed(case):
    """Position and velocity are numbers of single precision if, and only if, the engine claims it."""
    chosen = engine(case.label)
    with chosen.prepare(scenarios.load("fall-spin"), DT) as simulation:
        simulation.advance(STEPS)
        linear = simulation.state()[[0, 1, 2, 7, 8, 9]]
        assert simulation.settings["version"]
    assert np.array_equal(linear, linear.astype(np.float32)) == (chosen.precision is np.float32)


def test_engine_has_each_setting_that_is_given(case):
    if engine(case.label).settings:
        verify_settings_are_in_force(engine(case.label).name, scenarios.load("slide-box"))


def test_default_profile_has_the_defaults_that_are_listed(case):
    if "profile" in engine(case.label).choices:
        verify_defaults_are_in_force(engine(case.label).name, scenarios.load("slide-box"))


def test_findings_of_the_page_on_engines_are_measured(finding, tmp_path):
    """In a process of its own, because one in which JAX has started threads must not fork."""
    verify_findings(finding, tmp_path, partial(cli.spawn, timeout=1800.0))
