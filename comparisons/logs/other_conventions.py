"""Other readings of a recording's columns: units, quaternions, and the order of the axes in which the header gives the body."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np

from dropspin.comparisons.logs.flight import Flight, positions
from dropspin.comparisons.logs.flights import Flights
from dropspin.comparisons.logs.header import LENGTHS, TIMES, UPRIGHT, Header
from dropspin.comparisons.logs.log import Cause, Finding, Log, Toss
from dropspin.comparisons.logs.noise import regression
from dropspin.comparisons.logs.rest import level_share, rests
from dropspin.comparisons.logs.rotors import rotation
from dropspin.scenarios.bodies import Box, Ellipsoid
from dropspin.scenarios.bodies.inertia import is_diagonal
from dropspin.scenarios.rotations import conjugate, multiply
from dropspin.scenarios.state import UP, Array

EXPLAINED = 0.4
"""Share of the difference from the rotation of a free body that another reading of the orientations leaves at most."""
LEAST_LEFT = 0.5
"""Share of the white noise of the orientations that every reading leaves."""
EQUALLY = 1.1
"""Factor on what the best reading leaves, up to which others explain the rotation as well."""
NEARLY = 0.9
"""Share of the tosses that end on a face in one reading, over that in another, from which on rests do not tell the two apart."""
MOST_ROTORS = 8
"""Flights whose rotation is tried in other readings."""
UNTRACKED = 0.3
"""White noise of the orientations [rad] from which on they show no rotation: of a body that turns by half a turn between two frames."""
ORDERS = ("body axes", "order of the moments")
"""Causes: all of the body's axes are in another order, or its moments of inertia alone."""
CLEARLY = 3.0
"""Ratio of the scatter of heights at rest with two orders of the lengths from which on the smaller one is the right one."""


class _Explanation(NamedTuple):
    """A reading of the quaternions or an order of the body's axes, and how it fits the motion.

    Attributes:
        cause: Of a recording that is right with it.
        turning: How far rotations are from those of free bodies [rad].
        moving: How far tracked points are from those of free bodies [m].
        level: The share of the tosses that end on a face; NaN of round bodies.
    """

    cause: Cause
    turning: float
    moving: float
    level: float


def of_quaternions(log: Log, flights: Flights) -> Iterator[Finding]:
    """Of quaternions that another reading, or other axes of the body, explain: bodies then turn as free bodies do, or rest on faces."""
    level, count = level_share(log)
    inertia = log.header.body.inertia_tensor
    is_ball = bool(np.allclose(inertia, inertia[0, 0] * np.eye(3)))  # a spin is constant then, in every reading
    turning = _restlessness([rotor.samples.values for rotor in flights.rotations])
    tried = [] if is_ball else flights.found[:MOST_ROTORS]
    readings = []
    for cause, rolled, inverse in _readings(log.header):
        read = _corrected(log, cause.keys, partial(_read_as, header=log.header, rolled=rolled, inverse=inverse))
        some = [replace(flight, toss=_read_as(flight.toss, log.header, rolled, inverse)) for flight in tried]
        readings.append(_Explanation(cause, *(_left_by(some, inertia) if some else (turning, 0.0)), level_share(read)[0]))
    can_be_explained = bool(tried) and EXPLAINED * turning > LEAST_LEFT * flights.turning.noise.white
    other_axes = orders_of_axes(log) if can_be_explained else ()
    orders = [_Explanation(cause, *_left_by(tried, exchanged), level) for exchanged, cause in other_axes]
    found = [one for one in (*readings, *orders) if one.turning < EXPLAINED * turning and not one.level < NEARLY * level]
    if not found and count >= 3 and level < 0.7:
        found = [one for one in readings if one.level > NEARLY and one.turning < 2.0 * turning]
    if found:
        least = min(one.turning for one in found)
        found = [one for one in found if one.turning <= EQUALLY * least]
        nearest = min(one.moving for one in found)
        found = [one for one in found if one.moving <= CLEARLY * nearest]
        best = max(found, key=lambda one: one.level)
        causes = [one.cause for one in found if not one.level < NEARLY * best.level]
        are_read = any(cause.name not in ORDERS for cause in causes)
        kind, value, expected = ("quaternion", level, best.level) if are_read else ("body axes", turning, best.turning)
        yield Finding(kind, value, expected, causes=tuple(cause for number, cause in enumerate(causes) if cause not in causes[:number]))
    elif flights.turning.noise.white > UNTRACKED:
        yield Finding("rotation", flights.turning.noise.white, 0.0)


def _left_by(flights: Sequence[Flight], inertia: Array) -> tuple[float, float]:
    """How far rotations [rad] and tracked points [m] of flights are from those of free bodies with an inertia."""
    noise, longest = regression([positions(flight) for flight in flights]).noise, max(flight.duration for flight in flights)
    turning = _restlessness([rotation(flight, inertia).samples.values for flight in flights])
    return turning, math.hypot(noise.white, noise.slow * longest**1.5)


def _restlessness(left: list[Array]) -> float:
    """How far the rotations of flights are from those of free bodies: the median of their root mean squares [rad]."""
    return float(np.median([np.sqrt(np.mean(values**2)) for values in left]))


def _readings(header: Header) -> Iterator[tuple[Cause, int, bool]]:
    """The other readings of the quaternions: the cause, by how many columns they are rolled, and whether they are inverted."""
    other, rolled = ("wxyz", -1) if header.quaternion == "xyzw" else ("xyzw", 1)
    order = {"quaternion": other}
    direction = {"rotation": "body-to-world" if header.rotation == "world-to-body" else "world-to-body"}
    yield Cause("order of the quaternions", keys=order), rolled, False
    yield Cause("direction of the quaternions", keys=direction), 0, True
    yield Cause("order and direction of the quaternions", keys=order | direction), rolled, True


def _read_as(toss: Toss, header: Header, rolled: int, inverse: bool) -> Toss:
    """The toss with the columns of its quaternions in another order, or of the inverse rotation."""
    upright = np.array(UPRIGHT[header.up])
    read = multiply(conjugate(upright), toss.orientation)
    read = conjugate(read) if header.rotation == "world-to-body" else read
    read = np.roll(read, rolled, axis=1)
    read = conjugate(read) if (header.rotation == "world-to-body") != inverse else read
    return replace(toss, orientation=multiply(upright, read))


def in_other_readings(log: Log) -> Iterator[tuple[Finding, Log]]:
    """The recording in each other unit, and with each other reading of its quaternions, and the finding that this one is right.

    With a wrong unit or orientation, the point that the header says to be tracked does not fly, unless it is the centre of mass.
    """
    header = log.header
    for key, units, power in (("length_unit", LENGTHS, 1), ("time_unit", TIMES, -2)):
        for unit in units if header.rate is None or key == "length_unit" else ():
            factor = units[unit] / units[getattr(header, key)]
            if unit != getattr(header, key):
                cause = Cause(key.replace("_", " "), keys={key: unit})
                yield Finding("unit", header.gravity / factor**power, header.gravity, causes=(cause,)), in_unit(log, key, unit)
    for cause, rolled, inverse in _readings(header):
        read = _corrected(log, cause.keys, partial(_read_as, header=header, rolled=rolled, inverse=inverse))
        yield Finding("quaternion", level_share(log)[0], level_share(read)[0], causes=(cause,)), read


def in_unit(log: Log, key: str, unit: str) -> Log:
    """The recording with its lengths (`length_unit`) or times (`time_unit`) in another unit."""
    header, units = log.header, LENGTHS if key == "length_unit" else TIMES
    factor = units[unit] / units[getattr(header, key)]
    lengths, times = (factor, 1.0) if units is LENGTHS else (1.0, factor)
    return _corrected(log, {key: unit}, partial(_in_units, header=header, lengths=lengths, times=times))


def _corrected(log: Log, keys: Mapping[str, Any], change: Callable[[Toss], Toss]) -> Log:
    """The recording with other keys in its header, and with each toss changed alike."""
    return replace(log, header=log.header.model_copy(update=dict(keys)), tosses=tuple(map(change, log.tosses)))


def _in_units(toss: Toss, header: Header, lengths: float, times: float) -> Toss:
    """The toss with its lengths and times multiplied by factors; the height of the floor is a true length."""
    floor = header.floor_height * UP
    velocity = None if toss.velocity is None else toss.velocity * (lengths / times)
    spin = None if toss.angular_velocity is None else toss.angular_velocity / times
    return replace(toss, t=times * toss.t, position=lengths * (toss.position + floor) - floor, velocity=velocity, angular_velocity=spin)


def orders_of_axes(log: Log) -> Iterator[tuple[Array, Cause]]:
    """The inertia of the body with its axes in each other order [kg m²], shape (3, 3), and the causes with that order.

    The moments alone may be in another order, if the header has them. The heights at rest show whether the lengths are.
    """
    body, inertia = log.header.body, log.header.body.inertia_tensor
    if not is_diagonal(inertia):
        return
    scatter = rests(log).scatter
    vectors = {"half_extents": body.half_extents, "center_of_mass": body.center_of_mass} if isinstance(body, Box | Ellipsoid) else {}
    vectors |= {"inertia": body.moments} if vectors and isinstance(body.inertia, tuple) else {}
    for axes in permutations(range(3)):
        exchanged = inertia[np.ix_(axes, axes)]
        if not np.array_equal(exchanged, inertia):
            keys = {f"body.{name}": [vector[axis] for axis in axes] for name, vector in vectors.items() if vector and any(vector)}
            moments = {name: values for name, values in keys.items() if name == "body.inertia"}
            other = rests(replace(log, header=log.header.corrected(keys))).scatter
            if not other > CLEARLY * scatter:
                yield exchanged, Cause(ORDERS[0], keys=keys)
            if moments and not scatter > CLEARLY * other:
                yield exchanged, Cause(ORDERS[1], keys=moments)


def of_lengths(log: Log) -> Iterator[Finding]:
    """Of half extents in another order, about which the heights at rest scatter much less."""
    body = log.header.body
    if not isinstance(body, Box | Ellipsoid):
        return
    orders = []
    for axes in permutations(range(3)):
        keys = {"body.half_extents": [body.half_extents[axis] for axis in axes]}
        orders.append((rests(replace(log, header=log.header.corrected(keys))).scatter, keys))
    scatter, least = orders[0][0], min(of_order for of_order, _ in orders)
    if scatter > CLEARLY * least:
        best = [keys for of_order, keys in orders if of_order <= EQUALLY * least]
        yield Finding("lengths", scatter, 0.0, causes=tuple(Cause("order of the lengths", keys=keys) for keys in best), rests=least)
