"""Flights in recordings that are made by formula, whose parameters, starts and noise are known."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from support import log_fits
from support.tosses import BRICK, CUBE, made

from dropspin.comparisons.logs.flight import LONGEST, SURPRISING, Flight, falls, noise_of, surprise
from dropspin.comparisons.logs.flights import Flights, Start, flights_of
from dropspin.comparisons.logs.log import Log, Toss
from dropspin.comparisons.logs.noise import Noise
from dropspin.comparisons.logs.rotors import Rotation
from dropspin.scenarios.rotations import rotate, rotation_vector, unrotate
from dropspin.scenarios.state import Array

DOWN = np.array([0.0, -9.81, 0.0])
OFFSET = (0.001, -0.002, 0.003)
CORNER = (0.04, 0.05, 0.07)


def found(log: Log) -> Flights:
    flights = flights_of(log, DOWN)
    assert flights is not None
    return flights


def misses(flights: Flights, exact: Sequence[Callable[[float], Array]]) -> Array:
    """Starts minus the exact states, in standard deviations of the starts, shape (tosses, 12)."""
    rows = []
    for start in flights.starts():
        state = exact[int(start.toss.name)](start.toss.t[start.frame])
        turned = rotation_vector(state[3:7], start.state[3:7])
        error = np.concatenate([start.state[:3] - state[:3], turned, start.state[7:] - state[7:]])
        rows.append(error / np.sqrt(np.diag(start.covariance)))
    return np.array(rows)


def test_without_noise_the_parameters_of_the_flights_are_exact() -> None:
    # ln(I_x/I_y) and ln(I_z/I_y) are relative to the header's inertia; rounding of 0.1 m in a parabola of 0.1 s is 1e-16 × 8 / 0.01.
    recording = made(1, 8, offset=OFFSET, header={"tracked_point": OFFSET})
    flights = found(recording.log)
    np.testing.assert_allclose(flights.moving.values, [*DOWN, *OFFSET], atol=1e-10)
    np.testing.assert_allclose(flights.turning.values, 0.0, atol=1e-8)
    for start in flights.starts():
        np.testing.assert_allclose(start.state, recording.exact[int(start.toss.name)](start.toss.t[start.frame]), atol=1e-9)


@pytest.mark.extended
def test_a_flight_ends_at_the_last_frame_but_one_before_the_impact() -> None:
    recording = made(2, 12, (2e-4, 2e-3))
    for flight, impact in zip(found(recording.log).found, recording.impacts, strict=True):
        last = flight.toss.t[flight.end - 1]
        assert flight.first == 0
        assert impact - 2.0 / 148.0 <= last < impact


@pytest.mark.extended
def test_a_toss_below_the_floor_has_no_flight_unless_half_of_them_are_below() -> None:
    log = made(6, 6, header={"floor": {"restitution": 0.3, "friction": 0.3}}).log

    def flights_with(sunk: int, depth: float) -> list[int]:
        down = [depth * (number < sunk) for number in range(6)]
        tosses = [replace(toss, position=toss.position - [0.0, lower, 0.0]) for toss, lower in zip(log.tosses, down, strict=True)]
        return [int(flight.toss.name) for flight in found(replace(log, tosses=tuple(tosses))).found]

    assert flights_with(2, 5.0) == [2, 3, 4, 5]
    assert flights_with(2, 0.0) == flights_with(3, 5.0) == [0, 1, 2, 3, 4, 5]


def test_the_noise_is_found() -> None:
    flights = found(made(3, 20, (2e-4, 2e-3), header={"body": CUBE}).log)
    assert flights.moving.noise.white == pytest.approx(2e-4, rel=0.1)
    assert flights.turning.noise.white == pytest.approx(2e-3, rel=0.1)


def test_covariance_of_slow_errors_is_that_of_a_twice_integrated_white_noise() -> None:
    # By quadrature: w(t) = ∫ (t - u) dB(u), hence cov(w(s), w(t)) = ∫ (s - u)(t - u) du up to the smaller time.
    t = np.array([0.1, 0.25, 0.7])
    nodes, weights = np.polynomial.legendre.leggauss(4)
    for i, j in np.ndindex(3, 3):
        until = min(t[i], t[j])
        u = until * (nodes + 1.0) / 2.0
        expected = until / 2.0 * np.sum(weights * (t[i] - u) * (t[j] - u))
        assert Noise(0.0, 2.0).covariance(t)[i, j] == pytest.approx(4.0 * expected, rel=1e-14)


@pytest.mark.extended
@pytest.mark.parametrize(("sets", "count", "body"), [(3, 10, BRICK), (2, 30, CUBE)])
def test_intervals_of_parameters_and_starts_hold(sets: int, count: int, body: dict[str, object]) -> None:
    # 30 starts × 12 components, which depend on each other in pairs: the share inside has a standard deviation of 0.016.
    inside, starts = [], []
    for seed in range(sets):
        recording = made(100 + seed, count, (2e-4, 2e-3), offset=OFFSET, header={"tracked_point": OFFSET, "body": body})
        flights = found(recording.log)
        error = flights.moving.values - [*DOWN, *OFFSET]
        inside += [*(np.abs(error) < flights.moving.half_widths()), *(np.abs(flights.turning.values) < flights.turning.half_widths())]
        starts.append(np.abs(misses(flights, recording.exact)) < 1.96)
    assert np.mean(inside) > 0.85
    assert 0.90 < np.mean(np.concatenate(starts)) < 0.99


@pytest.mark.extended
def test_ratios_of_inertia_are_those_of_the_motion_however_wrong_the_header_is() -> None:
    moments = np.array(BRICK["inertia"]) * [1.0, 1.3, 1.0]
    log = made(1, 4, (1e-5, 1e-4), spin=8.0).log
    wrong = replace(
        log,
        header=log.header.model_copy(update={"body": made(1, 0, header={"body": BRICK | {"inertia": moments.tolist()}}).log.header.body}),
    )
    turning = found(wrong).turning
    np.testing.assert_array_less(np.abs(turning.values - np.log(1.3)), turning.half_widths())
    assert (turning.half_widths() < 0.005).all()


def test_states_are_drawn_from_the_covariance_and_rounding_of_it_changes_none() -> None:
    """White noise is the same along all axes, so that its covariance has triple eigenvalues, with arbitrary eigenvectors."""
    random = np.random.default_rng(5)
    start = log_fits.tosses(random, 1, log_fits.WANG, 0.3, 0.3).starts()[0]
    assert isinstance(start, Start)
    np.testing.assert_allclose(start.deviations.T @ start.deviations, start.covariance, rtol=0.0, atol=1e-12 * start.covariance.max())
    rounding = 1e-15 * random.normal(size=(12, 12)) * start.covariance
    other = replace(start, covariance=start.covariance + rounding + rounding.T)
    one, two = (each.drawn(np.random.default_rng(6), 4000) for each in (start, other))
    np.testing.assert_allclose(one, two, rtol=0.0, atol=1e-12)
    uncertainty = np.sqrt(np.diag(start.covariance))[[0, 1, 2, 6, 7, 8, 9, 10, 11]]
    np.testing.assert_allclose(one[:, [0, 1, 2, 7, 8, 9, 10, 11, 12]].std(axis=0), uncertainty, rtol=0.05)


def test_a_toss_that_errs_much_more_than_the_others_does_not_move_the_result() -> None:
    recording = made(5, 20, (2e-4, 2e-3), header={"body": CUBE})
    before = found(recording.log)
    spoilt = recording.log.tosses[3]
    spoilt.position[:] += 0.5 * np.outer(spoilt.t**2, [0.0, 3.0, 0.0])  # gravity of 6.81 m/s² in one toss of 20
    after = found(recording.log)
    assert after.moving.weights[3] < 0.25
    assert np.abs(after.moving.values - before.moving.values)[1] < 0.25 * 3.0 / 20.0


def test_a_rotor_that_decays_loses_angular_momentum_alone() -> None:
    # R I Rᵀ ω = exp(-kt) L, and R turns with ω: differences of 2e-6 s leave a tenth of its square, and rounding 1e-16 / 1e-6.
    inertia, start, t, step = np.diag(BRICK["inertia"]), np.array([0.5] * 4), np.linspace(-0.2, 0.3, 6), 1e-6
    flight = Flight(Toss("1", np.arange(3.0), np.zeros((3, 3)), np.zeros((3, 4))), 0, 1)
    rotor = Rotation(flight, inertia, start, np.array([3.0, 8.0, -2.0]), 3.0)
    orientation, spin = rotor(t)
    momentum = rotate(orientation, unrotate(orientation, spin) @ inertia)
    first = rotate(start, unrotate(start, rotor.spin) @ inertia)
    np.testing.assert_allclose(momentum, np.exp(-3.0 * t)[:, np.newaxis] * first, rtol=1e-10)
    np.testing.assert_allclose(rotation_vector(rotor(t - step)[0], rotor(t + step)[0]) / (2.0 * step), spin, rtol=0.0, atol=1e-7)


def test_a_frame_is_predicted_from_at_most_as_many_frames_as_a_regression_uses() -> None:
    t = np.arange(LONGEST + 5) / 1000.0
    position = np.outer(t**2 / 2.0, DOWN) + 1e-4 * np.random.default_rng(1).normal(size=(len(t), 3))
    toss = Toss("1", t, position, np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1)))
    for end in (LONGEST - 1, LONGEST, LONGEST + 3):
        assert 0.0 < surprise(Flight(toss, 0, end), end, np.append(DOWN, np.zeros(3)), Noise(1e-4, 0.0)) < SURPRISING


@pytest.mark.parametrize(
    ("white", "others"),
    [
        ((0.0, 0.0), {"offset": CORNER, "spin": 8.0, "header": {"tracked_point": CORNER}}),  # R d turns with 20 m/s²
        ((1e-3, 5e-3), {"rate": 120.0, "durations": (0.3, 0.4)}),  # six frames show an acceleration to ± 4.5 m/s²
    ],
)
def test_falls_of_a_point_that_turns_or_of_noisy_positions_begin_at_the_first_frame(
    white: tuple[float, float], others: dict[str, Any]
) -> None:
    recording = made(4, 12, white, **others)
    for flight, impact in zip(falls(recording.log, DOWN), recording.impacts, strict=True):
        assert flight is not None
        assert flight.first <= 2
        assert -0.03 < flight.toss.t[flight.end - 1] - impact < 0.03


def _bounced(noise: Array) -> Toss:
    """Falls of 0.3 s and of 0.35 s with an impact between them, and noise of shape (frames, 3)."""
    t = np.arange(len(noise)) / 240.0
    since = np.maximum(t - 0.3, 0.0)
    position = np.outer(t**2 / 2.0, DOWN) + np.outer(since, [0.0, 4.6, 0.0]) + noise
    return Toss("bounced", t, position, np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1)))


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("kept", [0.0, 0.9])
def test_the_first_fall_counts_in_a_toss_that_is_noisier_than_others_or_whose_noise_wanders(seed: int, kept: float) -> None:
    """White noise of 3 mm beside tosses of 0.2 mm; or of 1 mm, of which a frame keeps nine tenths, as trackers do."""
    random, quiet = np.random.default_rng(seed), made(4, 12, (2e-4, 0.0), rate=240.0).log
    noise = lfilter([math.sqrt(1.0 - kept**2)], [1.0, -kept], random.normal(size=(156, 3)) * (1e-3 if kept else 3e-3), axis=0)
    [*_, fall] = falls(replace(quiet, tosses=(*quiet.tosses, _bounced(noise))), DOWN)
    assert fall.toss.name == "bounced"
    assert fall.end <= 75


def test_noise_of_positions_is_that_of_the_frames() -> None:
    # 12 tosses of about 6 pieces of 9 numbers beside their parabolas: the median has a standard error of 3 %.
    log = made(4, 12, (1e-3, 0.0), offset=CORNER, durations=(0.3, 0.4), header={"tracked_point": CORNER}).log
    assert noise_of(log) == pytest.approx(1e-3, rel=0.1)
