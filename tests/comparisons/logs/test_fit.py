"""Friction and restitution of synthetic tosses: found by the engine that made them; `support.log_fits` has the long study."""

import numpy as np
import pytest
from support.log_fits import WANG, tosses

from dropspin.comparisons.engines.wang import Wang
from dropspin.comparisons.logs.fit import log_fit
from dropspin.scenarios.variations import with_values


class HalfFriction(Wang):
    """An engine with half of the friction that it is given."""

    name = "half-friction"

    def prepare_batch(self, members, dt):
        friction = members[0].floor.coefficient
        return super().prepare_batch([with_values(member, "floor", friction=0.5 * friction) for member in members], dt)


class Breaking(Wang):
    """An engine that raises."""

    name = "breaking"

    def prepare_batch(self, members, dt):
        raise RuntimeError("out of order")


OPTIONS = {"contact": "sequential", "law": "coulomb"}


def estimates(fit, engine=None):
    return {one.parameter: one for one in fit.estimates if engine in (None, one.engine)}


def test_engine_finds_its_own_friction_and_restitution_from_ten_tosses():
    hits = []
    for seed in range(3):
        found = estimates(log_fit(tosses(np.random.default_rng(seed), 10, WANG, 0.25, 0.4), WANG, jobs=1))
        hits += [
            found["friction"].lower <= 0.25 <= found["friction"].upper,
            found["restitution"].lower <= 0.4 <= found["restitution"].upper,
        ]
        assert found["friction"].upper - found["friction"].lower < 0.05
        assert found["restitution"].upper - found["restitution"].lower < 0.05
    assert sum(hits) >= 5


def test_engines_agree_on_friction_and_disagree_on_restitution():
    """The impact of another engine needs another coefficient for the same rebounds; and an engine that breaks costs its own row."""
    fit = log_fit(tosses(np.random.default_rng(5), 12, WANG, 0.25, 0.5), [WANG, "mujoco", Breaking(OPTIONS)], jobs=1)
    assert [(one.parameter, one.first, one.second) for one in fit.disagreements] == [("restitution", WANG, "mujoco")]
    other = estimates(fit, "mujoco")["friction"]
    assert other.lower <= 0.25 <= other.upper
    assert fit.discrepancies["mujoco"] > 5.0 * fit.discrepancies[WANG]
    assert "out of order" in fit.left_out[Breaking(OPTIONS).label]


def test_engine_with_half_of_the_friction_needs_twice_as_much():
    found = estimates(log_fit(tosses(np.random.default_rng(6), 10, WANG, 0.2, 0.4), HalfFriction(OPTIONS), jobs=1))
    assert found["friction"].value == pytest.approx(0.4, abs=0.02)
    assert found["restitution"].value == pytest.approx(0.4, abs=0.02)


def test_parameter_without_effect_is_not_identified():
    """MuJoCo's default contacts do not use the restitution; and tosses without a contact in these frames bound neither."""
    fit = log_fit(tosses(np.random.default_rng(7), 8, "mujoco[profile=default]", 0.3, 0.3), "mujoco[profile=default]", jobs=1)
    assert not estimates(fit)["restitution"].has_lower
    assert not estimates(fit)["restitution"].has_upper
    assert estimates(fit)["friction"].lower <= 0.3 <= estimates(fit)["friction"].upper
    in_flight = tosses(np.random.default_rng(8), 8, WANG, 0.3, 0.3, height=1.0)
    assert not any(one.has_lower or one.has_upper for one in log_fit(in_flight, WANG, jobs=1).estimates)
