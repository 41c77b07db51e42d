"""Friction and restitution of synthetic tosses: found by the engine that made them; `support.log_fits` has the long study."""

import numpy as np
import pytest
from support.log_fits import FINE, WANG, tosses

from dropspin.comparisons.engines.wang import Wang
from dropspin.comparisons.logs import fit as log_fits
from dropspin.comparisons.logs.fit import log_fit
from dropspin.comparisons.logs.grids import Profile, problem_of
from dropspin.comparisons.logs.grids import _refined as refined_grid
from dropspin.comparisons.logs.header import Header
from dropspin.comparisons.logs.log import Log, Toss
from dropspin.reports.stories.log_fit import transfer
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


class Renamed(Wang):
    """The same engine under another name."""

    name = "renamed"


OPTIONS = {"contact": "sequential", "law": "coulomb"}


def estimates(fit, engine=None):
    return {one.parameter: one for one in fit.estimates if engine in (None, one.engine)}


@pytest.mark.parametrize(("seeds", "least"), [([1], 2), pytest.param(range(3), 5, marks=pytest.mark.extended)])
def test_engine_finds_its_own_friction_and_restitution_from_ten_tosses(seeds, least):
    hits = []
    for seed in seeds:
        found = estimates(log_fit(tosses(np.random.default_rng(seed), 10, WANG, 0.25, 0.4, dt=FINE), WANG, jobs=1))
        hits += [
            found["friction"].lower <= 0.25 <= found["friction"].upper,
            found["restitution"].lower <= 0.4 <= found["restitution"].upper,
        ]
        assert found["friction"].upper - found["friction"].lower < 0.05
        assert found["restitution"].upper - found["restitution"].lower < 0.05
    assert sum(hits) >= least


@pytest.mark.extended
def test_restitution_transfers_to_the_engine_under_another_name_alone():
    """The impact of another engine needs another coefficient for the same rebounds; and an engine that breaks costs its own row."""
    renamed, breaking = Renamed(OPTIONS), Breaking(OPTIONS)
    fit = log_fit(tosses(np.random.default_rng(5), 12, WANG, 0.25, 0.5, dt=FINE), [WANG, "mujoco", renamed, breaking], jobs=1)
    verdicts = {(one.parameter, one.first, one.second): one.verdict for one in fit.transfers}
    assert verdicts[("restitution", WANG, "mujoco")] == verdicts[("restitution", "mujoco", renamed.label)] == "different"
    assert verdicts[("restitution", WANG, renamed.label)] == verdicts[("friction", WANG, renamed.label)] == "equal"
    assert fit.friction.lower <= 0.25 <= fit.friction.upper
    assert fit.discrepancies["mujoco"] > 5.0 * fit.discrepancies[WANG]
    assert "out of order" in fit.left_out[breaking.label]


@pytest.mark.parametrize(
    ("spread", "verdict"), [((0.0, 0.005), "equal"), ((-0.1, 0.005), "different"), ((-0.05, 0.2), "undecided"), ((0.0, 0.2), "undecided")]
)
def test_verdict_on_a_parameter_of_two_engines(spread, verdict):
    """Resamples of the first engine differ from 0.5, all those of the second, by a mean and a standard deviation."""
    of_first = 0.5 + spread[0] + spread[1] * np.random.default_rng(9).normal(size=(1999, 2))
    profiles = {"first": profile(of_first, 0.5 + spread[0]), "second": profile(np.full((1999, 2), 0.5), 0.5)}
    found = log_fits._transfer("restitution", "first", "second", profiles, 50, are_bounded=True)
    assert (found.verdict, found.difference) == (verdict, pytest.approx(spread[0]))
    of_bounds = log_fits._transfer("restitution", "first", "second", profiles, 50, are_bounded=False)
    unknown = verdict in ("equal", "undecided")
    assert (of_bounds.verdict, np.isinf(of_bounds.upper)) == ("undecided" if unknown else verdict, unknown)
    assert ("a bound on one side alone" in transfer(of_bounds)) == unknown


def test_friction_of_any_engine_has_the_interval_of_a_mean_over_engines():
    """Two engines at 0.20 and 0.22 without sampling errors: 0.21 ± t(0.975; 1) 0.02 / 2; with sampling errors alone, t(0.975; 49)."""
    exact = {"first": profile(np.full((1999, 2), 0.20), 0.20), "second": profile(np.full((1999, 2), 0.22), 0.22)}
    found = log_fits._of_all("friction", exact, 50)
    assert (found.value, found.lower, found.upper) == pytest.approx((0.21, 0.21 - 12.7062 * 0.01, 0.21 + 12.7062 * 0.01), abs=1e-5)
    drawn = 0.3 + 0.01 * np.random.default_rng(10).normal(size=(1999, 2))
    found = log_fits._of_all("friction", dict.fromkeys(("first", "second"), profile(drawn, 0.3)), 50)
    assert found.upper - 0.3 == pytest.approx(2.0096 * np.sqrt(50 / 49) * drawn[:, 0].std(), rel=1e-4)


def profile(resampled, value):
    """The same at both time steps."""
    return Profile(resampled, resampled, np.full((2, 2), value), 0.0)


def bouncing_balls(seed, restitution, friction, count=12, rate=148.0, noise=2e-4):
    """Tosses of a ball of 0.1 m, in closed form: it strikes the floor once, and its contact sticks if friction suffices.

    The times of the impacts are at evenly spread parts of the coarser time step of a fit.
    """
    random, tosses, radius = np.random.default_rng(seed), [], 0.05
    for number in range(count):
        height, forward = random.uniform(0.4, 0.7), random.uniform(0.3, 1.2)
        falls = (np.floor(np.sqrt(2.0 * height / 9.81) * rate * log_fits.FINE_STEPS[0]) + (number + 0.5) / count) / (
            rate * log_fits.FINE_STEPS[0]
        )
        height = 4.905 * falls**2
        lost = min(friction * (1.0 + restitution) * 9.81 * falls, 2.0 / 7.0 * forward)
        t = np.arange(int((falls + 0.1) * rate)) / rate
        since = np.maximum(t - falls, 0.0)
        rising = radius + restitution * 9.81 * falls * since - 4.905 * since**2
        y = np.where(t > falls, rising, radius + height - 4.905 * t**2)
        position = np.stack([forward * t - lost * since, y, 0.0 * t], axis=1) + noise * random.normal(size=(len(t), 3))
        angle = -2.5 * lost / radius * since
        quaternion = np.stack([0.0 * t, 0.0 * t, np.sin(angle / 2.0), np.cos(angle / 2.0)], axis=1)
        quaternion[:, :3] += 2.5 * noise * random.normal(size=(len(t), 3))
        tosses.append(Toss(str(number), t, position, quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)))
    body = {"shape": "sphere", "radius": radius, "mass": 0.3}
    header = Header(data="balls.npz", rate=rate, body=body, floor={"friction": 0.5, "restitution": 0.5})
    return Log(header, tuple(tosses), "balls", ())


@pytest.mark.sample(1)
@pytest.mark.parametrize("restitution", [0.3, 0.6, 0.9])
def test_coefficients_of_a_ball_in_closed_form(restitution):
    """The time step of the fit does not raise the restitution; contacts that stick bound friction from below alone."""
    [friction, found] = log_fit(bouncing_balls(1, restitution, 0.9), WANG, jobs=1).estimates
    assert found.lower < restitution < found.upper
    assert found.upper - found.lower < 0.02
    assert (friction.has_lower, friction.has_upper) == (True, False)
    assert friction.lower < 0.1  # 2/7 v / ((1 + e) u) is at most 0.07 to 0.1


def test_time_step_does_not_raise_the_restitution_of_a_ball():
    """By little noise; impacts are half of a time step late in the mean, which raises that at the finer step by 0.0017."""
    [_, found] = log_fit(bouncing_balls(1, 0.6, 0.9, count=8, noise=2e-5), WANG, jobs=1).estimates
    assert found.value == pytest.approx(0.6, abs=4e-4)


@pytest.mark.parametrize(
    ("coarser", "finer", "ends"),
    [
        ((0.44, 0.46), (0.42, 0.43), (0.40, 0.40)),
        ((0.44, 0.48), (0.42, 0.42), (0.36, 0.40)),
        ((0.30, 1.00), (0.28, 1.00), (0.26, 1.00)),
        ((0.30, 1.00), (0.28, 0.28), (0.26, 0.28)),
        ((0.30, 0.30), (0.28, 1.00), (0.26, 1.00)),
        ((0.05, 0.05), (0.02, 0.02), (0.00, 0.00)),
        ((0.00, 0.00), (0.02, 0.02), (0.02, 0.02)),
    ],
)
def test_estimates_at_two_time_steps_are_extrapolated_within_the_values_that_are_tried(coarser, finer, ends):
    """Twice the finer minus the coarser, in order, unless the coarser is at 0 or 1, where it is only a bound."""
    profiles = [Profile(np.full((9, 2), one[0]), np.full((9, 2), one[1]), np.tile(one, (2, 1)).T, 0.0) for one in (coarser, finer)]
    found = log_fits._without_step(*profiles)
    np.testing.assert_allclose(found.remainder, 0.25 * (np.mean(finer) - np.mean(coarser)), atol=1e-12)
    np.testing.assert_allclose([found.lower[0], found.upper[0]], np.tile(ends, (2, 1)).T, atol=1e-12)
    np.testing.assert_allclose(found.value, np.mean(ends), atol=1e-12)


@pytest.mark.parametrize("end", [0.0, 1.0])
def test_grid_around_estimates_at_the_end_of_the_first_grid_has_all_of_its_values(end):
    """Without the values beyond it."""
    first = np.linspace(0.0, 1.0, 7)
    found = refined_grid(first, first, np.full(50, end), np.full(50, end))
    assert len(found) == 5
    assert 0.0 <= found[0] < found[-1] <= 1.0
    assert end in found


@pytest.mark.parametrize(("height", "touches"), [(0.0, True), (0.3, False)])
def test_frames_in_which_no_body_is_near_the_floor_are_known(height, touches):
    flights = tosses(np.random.default_rng(4), 8, WANG, 0.3, 0.3, height=height, dt=FINE)
    assert log_fits._touches(flights, problem_of(flights, 8, 4)) is touches


@pytest.mark.extended
def test_engine_with_half_of_the_friction_needs_twice_as_much():
    found = estimates(log_fit(tosses(np.random.default_rng(6), 10, WANG, 0.2, 0.4, dt=FINE), HalfFriction(OPTIONS), jobs=1))
    assert found["friction"].value == pytest.approx(0.4, abs=0.02)
    assert found["restitution"].value == pytest.approx(0.4, abs=0.02)


@pytest.mark.extended
def test_parameter_without_effect_is_not_identified():
    """MuJoCo's default contacts do not use the restitution; and tosses without a contact in these frames bound neither."""
    fit = log_fit(tosses(np.random.default_rng(7), 8, "mujoco[profile=default]", 0.3, 0.3, dt=FINE), "mujoco[profile=default]", jobs=1)
    assert not estimates(fit)["restitution"].has_lower
    assert not estimates(fit)["restitution"].has_upper
    assert estimates(fit)["friction"].lower <= 0.3 <= estimates(fit)["friction"].upper
    in_flight = tosses(np.random.default_rng(8), 8, WANG, 0.3, 0.3, height=1.0, dt=FINE)
    assert not any(one.has_lower or one.has_upper for one in log_fit(in_flight, WANG, jobs=1).estimates)
