"""The flights of a recording whose units and axes may be wrong: tosses fall longest with one acceleration, in whatever direction."""

import math
from collections.abc import Callable
from functools import cache, partial
from itertools import product

import numpy as np

from dropspin.comparisons.logs.flight import ACCELERATION, accelerations, falling_parts, noise_of, window_size
from dropspin.comparisons.logs.flights import NEAR_FLOOR, Flights, flights_of, heights
from dropspin.comparisons.logs.header import LENGTHS, TIMES
from dropspin.comparisons.logs.log import Log
from dropspin.comparisons.running.arguments import ignore
from dropspin.scenarios.errors import DropspinError
from dropspin.scenarios.state import Array

ABOUT = 0.75
"""Share of the frames of the longest falls from which on the header's acceleration is that of the tosses."""
MOST_TOSSES, MOST_PIECES = 20, 200
"""Tosses in which accelerations are tried, and pieces of these whose accelerations are."""
RATES = (0.5, 2.0)
"""Rates over the true one that are tried."""


def flights_in_any_units(log: Log, alarm: float, report: Callable[[str, float], None] = ignore) -> Flights:
    """The flights of a recording, of whatever acceleration; `alarm` is the probability with which errors may look like one.

    `report` is that of `flights_of`.

    Raises:
        DropspinError: There is none.
    """
    down = log.header.acceleration
    acceleration = _acceleration(log, down)
    flights = flights_of(log, acceleration, report)
    if acceleration is not down and (flights is None or not _flies(flights, alarm)):  # more frames lie at rest than fall
        flights = flights_of(log, down, report)
        flights = None if flights is None or 2 * len(flights.found) < len(log.tosses) else flights
    if flights is None:
        needed = max(window_size(toss, noise_of(log), down) for toss in log.tosses)
        raise DropspinError(
            f"{log.origin}: no toss has {needed} frames of free flight with one acceleration; film from the release on, and give "
            "the rate of the frames."
        )
    return flights


def _flies(flights: Flights, alarm: float) -> bool:
    """Whether an acceleration that is not the header's is one, and the body does not stay on the floor all the while."""
    moving, header = flights.moving, flights.log.header
    if np.linalg.norm(moving.values[ACCELERATION]) <= np.linalg.norm(moving.half_widths(alarm)[ACCELERATION]):
        return False
    each = [heights(header, flight.toss.position[flight.rows], flight.toss.orientation[flight.rows]) for flight in flights.found]
    return bool(np.abs(np.concatenate(each)).max() > NEAR_FLOOR * header.body.size)


def _acceleration(log: Log, down: Array) -> Array:
    """The free acceleration: the header's, if the tosses fall with it about as long as with any other, else that of the longest falls.

    The others are those of other units and axes, and those of pieces of the tosses.
    """
    noise, offset = noise_of(log), log.header.tracked_from_centre
    tosses, pieces = log.tosses[:: math.ceil(len(log.tosses) / MOST_TOSSES)], cache(partial(accelerations, offset=offset))

    def falling(acceleration: Array) -> int:
        """The frames of the longest part of each toss, together."""
        return sum(max(map(len, falling_parts(toss, noise, acceleration, pieces)), default=0) for toss in tosses)

    lengths, times = ({a / b for a, b in product(units.values(), repeat=2)} for units in (LENGTHS, TIMES))
    factors = lengths | {ratio**2 for ratio in (*times, *RATES)}
    candidates = [factor * sign * np.roll(down, turn) for factor in sorted(factors) for turn in range(3) for sign in (1.0, -1.0)]
    some = np.concatenate([pieces(toss, size := window_size(toss, noise, down))[::size] for toss in tosses])
    candidates += list(some[:: math.ceil(len(some) / MOST_PIECES) or 1])
    best = max(candidates, key=falling)
    return down if falling(down) > ABOUT * falling(best) else best
