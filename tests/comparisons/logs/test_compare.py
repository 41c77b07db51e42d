"""Errors beside measured tosses: exact where they are planted, and engines apart where they differ."""

from dataclasses import replace

import numpy as np
import pytest
from support.log_fits import HEADER, RATE, WANG, WHITE, quaternions, tosses
from support.tosses import made

from dropspin.comparisons.engines.wang import Wang
from dropspin.comparisons.logs.compare import log_compare
from dropspin.comparisons.logs.errors import KINDS, Kind, body_length, errors
from dropspin.scenarios.rotations import about, multiply
from dropspin.scenarios.state import ORIENTATION, POSITION
from dropspin.scenarios.variations import with_values

COUNT, FRAMES = 12, 70


class Dead(Wang):
    """An engine whose restitution is dead."""

    name = "dead"

    def prepare_batch(self, members, dt):
        return super().prepare_batch([with_values(member, "floor", restitution=0.0) for member in members], dt)


class Diverging(Wang):
    """An engine whose states are not finite."""

    name = "diverging"

    def prepare_batch(self, members, dt):
        batch = super().prepare_batch(members, dt)
        record = batch.record
        batch.record = lambda steps, every: np.where(np.arange(steps + 1)[:, np.newaxis] > 10, np.nan, record(steps, every))
        return batch


OPTIONS = {"contact": "sequential", "law": "coulomb"}


@pytest.fixture(scope="module")
def comparison():
    """Of tosses that Wang's method made, with the floor of the header."""
    flights = tosses(np.random.default_rng(3), COUNT, WANG, 0.3, 0.3, frames=FRAMES)
    same = WANG.replace("]", ",rotation=midpoint]")  # of a cube, the same rotations
    return log_compare(flights, [WANG, same, "mujoco", "wang", Dead(OPTIONS), Diverging(OPTIONS)], jobs=1)


def of(rows, **given):
    return next(row for row in rows if all(getattr(row, key) == value for key, value in given.items()))


@pytest.mark.extended
def test_same_engine_under_two_names_is_in_one_group_and_a_dead_one_is_not(comparison):
    [mine] = [group for group in comparison.groups["position"] if WANG in group]
    assert WANG.replace("]", ",rotation=midpoint]") in mine
    assert Dead(OPTIONS).label not in mine
    assert of(comparison.pairs, quantity="position", first=WANG, second=Dead(OPTIONS).label).upper < 0.0


def test_engine_that_diverges_or_declines_costs_its_own_row(comparison):
    assert comparison.left_out.keys() == {"wang", Diverging(OPTIONS).label}
    assert comparison.left_out[Diverging(OPTIONS).label] == "a toss is not finite"
    assert comparison.left_out["wang"].startswith("law=note has no Coulomb coefficient (0.3)")
    assert {error.engine for error in comparison.errors}.isdisjoint(comparison.left_out)


def test_error_of_the_engine_that_made_the_tosses_is_its_noise_floor(comparison):
    own, dead = ({(row.quantity, row.at): row for row in comparison.errors if row.engine == name} for name in (WANG, Dead(OPTIONS).label))
    for kind in (("position", "mean"), ("orientation", "impact"), ("orientation", "mean"), ("energy", "mean")):
        assert own[kind].lower < own[kind].noise_floor < own[kind].upper, kind
    assert dead["position", "mean"].value > 4.0 * own["position", "mean"].value
    assert of(comparison.errors, engine=WANG, quantity="same resting face").value == 1.0


def test_noise_floor_of_exact_starts_is_the_noise_of_a_frame():
    """The mean length of three normal components is √(8/π) standard deviations."""
    flights = tosses(np.random.default_rng(5), 5, WANG, 0.3, 0.3, frames=20)
    known = [replace(start, covariance=1e-20 * np.eye(12), white=WHITE * (1 + number % 2)) for number, start in enumerate(flights.known)]
    rows = log_compare(replace(flights, known=known), WANG, jobs=1).errors
    for quantity, white in (("position", WHITE[0] / body_length(HEADER.body)), ("orientation", WHITE[3])):
        assert of(rows, quantity=quantity, at="mean").noise_floor == pytest.approx(1.4 * np.sqrt(8.0 / np.pi) * white, rel=0.06)


def test_parts_sum_up_to_the_error(comparison):
    for quantity in ("position", "orientation"):
        error = of(comparison.errors, engine="mujoco", quantity=quantity, at="mean")
        parts = [part.value for part in comparison.parts if (part.engine, part.quantity) == ("mujoco", quantity)]
        assert sum(parts) == pytest.approx(error.value)


@pytest.mark.parametrize(
    ("spin", "offset", "improves"),
    [
        pytest.param(0.0, 0.0, False, id="not-identifiable"),
        pytest.param(5.0, 0.0, False, id="as-in-the-header"),
        pytest.param(5.0, 0.01, True, id="elsewhere"),
    ],
)
def test_centre_of_mass_is_improved_where_flights_contradict_the_header(spin, offset, improves):
    floor = {"floor": {"friction": 0.3, "restitution": 0.3}}
    log = made(8, 6, (2e-4, 2e-3), spin=spin, offset=(0.0, 0.0, offset), header=floor).log
    parts = {share.part for share in log_compare(log, WANG, jobs=1).parts}
    assert ("centre of mass" in parts) == improves


def test_planted_errors_measure_as_themselves():
    """A shift of 10 mm, a turn by 0.1 rad, and a rest 0.1 s later, in frames of 10 ms."""
    t, size = np.tile(np.arange(80) * 0.01, (2, 1)), body_length(HEADER.body)
    assert size == pytest.approx(0.1048)
    measured = np.zeros((2, 80, 7))
    measured[..., 6] = 1.0
    measured[..., 1] = 0.0524 + 4.905 * np.maximum(0.4 - t, 0.0) ** 2
    measured[1, 60:], t[1, 60:] = np.nan, np.nan
    found = measured.copy()
    found[..., POSITION] += [0.01, 0.0, 0.0]
    found[..., ORIENTATION] = multiply(about(np.array([0.0, 1.0, 0.0]), np.array(0.1)), measured[..., ORIENTATION])
    later = measured.copy()
    later[:, 10:, 1] = measured[:, :-10, 1]

    def kinds(motion):
        of_each = errors(HEADER.body, 9.81, np.zeros(3), np.zeros((2, 6)), t, measured, motion)
        return {(kind.quantity, kind.at): of_each[:, number] for number, kind in enumerate(KINDS)}

    planted, late = kinds(found), kinds(later)
    for at in ("impact", "+0.1 s", "mean", "end"):
        assert planted["position", at] == pytest.approx(0.01 / size)
        assert planted["orientation", at] == pytest.approx(0.1)
    assert planted["energy", "mean"] == pytest.approx(0.0, abs=1e-12)
    assert planted["same resting face", "end"].all()
    assert late["rest time", "end"] == pytest.approx(0.1)


@pytest.mark.parametrize(("noise", "speed"), [(0.0, 0.0), (3.0, 0.0), (5.0, 0.0), (0.0, 0.5), (5.0, 2.5)])
def test_noise_does_not_decide_when_a_body_rests(noise, speed):
    """Of 200 bodies that fall for 0.4 s and then turn at a speed [rad/s], with times the usual noise of a frame."""
    t, white = np.tile(np.arange(150) / RATE, (200, 1)), np.tile(noise * WHITE, (200, 1))
    exact = np.zeros((200, 150, 7))
    exact[..., 1] = 4.905 * np.maximum(0.4 - t, 0.0) ** 2
    exact[..., ORIENTATION] = about(np.array([0.0, 1.0, 0.0]), speed * t)
    drawn = np.random.default_rng(9).normal(size=(200, 150, 6)) * np.maximum(noise, 1e-9) * WHITE
    measured = np.concatenate([exact[..., POSITION] + drawn[..., :3], multiply(quaternions(drawn[..., 3:]), exact[..., ORIENTATION])], -1)
    found = dict(zip(KINDS, errors(HEADER.body, 9.81, np.zeros(3), white, t, measured, exact).T, strict=True))[
        Kind("rest time", "end", "s")
    ]
    assert np.isnan(found).all() if speed else (found < 1.5 / RATE).all()


def test_energy_error_is_that_of_a_known_loss():
    """A body that moves at 0.9 of the speed has 0.81 of the kinetic energy, all there is without gravity."""
    t = np.tile(np.arange(20) * 0.01, (1, 1))
    measured = np.zeros((1, 20, 7))
    measured[..., 6], measured[0, :, 0] = 1.0, t[0]
    found = measured.copy()
    found[..., 0] *= 0.9
    energy = [kind.quantity for kind in KINDS].index("energy")
    assert errors(HEADER.body, 0.0, np.zeros(3), np.zeros((1, 6)), t, measured, found)[0, energy] == pytest.approx(1.0 - 0.81)
