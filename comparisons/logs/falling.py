"""The flights of a recording whose units and axes may be wrong: most tosses fall with one acceleration, in whatever direction."""

from functools import cache
from itertools import product

import numpy as np

from dropspin.comparisons.logs.flight import ACCELERATION, accelerations, is_near, noise_of, standard_error, window_size
from dropspin.comparisons.logs.flights import NEAR_FLOOR, Flights, flights_of, heights
from dropspin.comparisons.logs.log import LENGTHS, TIMES, Log
from dropspin.scenarios.errors import DropspinError
from dropspin.scenarios.state import Array

ALARM = 1e-4
"""Probability of a finding where there is nothing, of each value."""
RATES = (0.5, 2.0)
"""Rates over the true one that are tried."""


def flights_in_any_units(log: Log) -> Flights:
    """The flights of a recording, of whatever acceleration.

    Raises:
        DropspinError: There is none.
    """
    down = np.array([0.0, -log.header.gravity, 0.0])
    acceleration = _acceleration(log, down)
    flights = flights_of(log, acceleration)
    if flights is None or (acceleration is not down and not _flies(flights)):
        needed = max(window_size(toss, noise_of(log), down) for toss in log.tosses)
        raise DropspinError(
            f"{log.origin}: no toss has {needed} frames of free flight with one acceleration; film from the release on, and give "
            "the rate of the frames."
        )
    return flights


def _flies(flights: Flights) -> bool:
    """Whether an acceleration that is not the header's is one, and the body does not stay on the floor all the while."""
    moving, header = flights.moving, flights.log.header
    if np.linalg.norm(moving.values[ACCELERATION]) <= np.linalg.norm(moving.half_widths(ALARM)[ACCELERATION]):
        return False
    each = [heights(header, flight.toss.position[flight.rows], flight.toss.orientation[flight.rows]) for flight in flights.found]
    return bool(np.abs(np.concatenate(each)).max() > NEAR_FLOOR * header.body.size)


def _acceleration(log: Log, down: Array) -> Array:
    """The free acceleration: the header's, if most tosses fall with it, else that of other units and axes that most tosses fall with."""
    noise, offset = noise_of(log), log.header.tracked_from_centre

    @cache
    def pieces(number: int, size: int) -> Array:
        return accelerations(log.tosses[number], size, offset)

    def falling(acceleration: Array) -> int:
        sizes = [window_size(toss, noise, acceleration) for toss in log.tosses]
        errors = [standard_error(toss, size, noise) for toss, size in zip(log.tosses, sizes, strict=True)]
        near = (is_near(pieces(*of_toss), acceleration, error) for of_toss, error in zip(enumerate(sizes), errors, strict=True))
        return sum(bool(of_toss.any()) for of_toss in near)

    if 2 * falling(down) > len(log.tosses):
        return down
    lengths, times = ({a / b for a, b in product(units.values(), repeat=2)} for units in (LENGTHS, TIMES))
    factors = lengths | {ratio**2 for ratio in (*times, *RATES)}
    candidates = [factor * sign * np.roll(down, turn) for factor in sorted(factors) for turn in range(3) for sign in (1.0, -1.0)]
    candidates += [first for number, toss in enumerate(log.tosses) for first in pieces(number, window_size(toss, noise, down))[:1]]
    return max([down, *candidates], key=falling)
