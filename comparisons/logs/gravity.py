"""What the acceleration of the flights says of a recording: its upward axis, units, lengths and times, or another gravity.

A flight shows length / time² alone. The heights at rest show the lengths.
"""

import math
from collections.abc import Iterator

import numpy as np

from dropspin.comparisons.logs.flight import ACCELERATION
from dropspin.comparisons.logs.flights import Flights
from dropspin.comparisons.logs.header import LENGTHS, TIMES, UPRIGHT, Header
from dropspin.comparisons.logs.log import Cause, Finding, Log, frame_rate
from dropspin.comparisons.logs.noise import Regression
from dropspin.comparisons.logs.other_conventions import in_unit
from dropspin.comparisons.logs.rest import rests
from dropspin.scenarios.rotations import unrotate
from dropspin.scenarios.state import UP

ALARM = 1e-4
"""Probability of a finding where there is nothing, of each value."""
UNIT = 0.05
"""Largest relative difference from the ratio of two units."""
LEAST_SCALE = 5e-4
"""The least relative difference of gravity that is a finding."""
NEARER = math.log(1.5)
"""Logarithm of the ratio of heights at rest to expected ones up to which these explain them: the floor may be at another height."""


def of_units(flights: Flights) -> Iterator[Finding]:
    """Of accelerations that are along another axis or far from gravity."""
    header, found = flights.log.header, flights.moving.values[ACCELERATION]
    if np.linalg.norm(found + header.gravity * UP) <= np.linalg.norm(flights.moving.half_widths(ALARM)[ACCELERATION]):
        return
    ratio, recorded = float(np.linalg.norm(found)) / header.gravity, unrotate(np.array(UPRIGHT[header.up]), -found)
    axis = int(np.argmax(np.abs(recorded)))
    up = ("-" if recorded[axis] < 0.0 else "") + "xyz"[axis]
    if up != header.up:
        yield Finding("up", causes=(Cause("upward axis", keys={"up": up}),))
    if abs(ratio - 1.0) <= UNIT:
        return
    gravity, at_rest = ratio * header.gravity, _lengths_at_rest(flights.log)
    off, off_in_time = (abs(math.log(at_rest / expected)) for expected in (ratio, 1.0))
    by_length, by_rate = off < min(NEARER, 0.5 * off_in_time), off_in_time < min(NEARER, 0.5 * off)
    lengths = _length_cause(header, at_rest)
    if lengths.name == "length unit" and not (by_length or by_rate):  # beside a wrong rate, or another gravity
        yield Finding("unit", gravity, header.gravity, causes=(lengths,), rests=at_rest)
        ratio, by_rate = ratio / at_rest, True
    single = (_length_cause(header, ratio), _rate_cause(flights.log, ratio), _local(ratio * header.gravity))
    causes = shown(*zip(single, (by_length, by_rate, by_rate), strict=True))
    units = tuple(cause for cause in causes if cause.name in ("length unit", "time unit"))
    yield Finding("unit", gravity, header.gravity, causes=units or causes, rests=at_rest)


def _lengths_at_rest(log: Log) -> float:
    """The recorded lengths over the true ones, by the heights at rest, read in whatever unit; NaN if they do not show it clearly."""
    now = LENGTHS[log.header.length_unit]
    scales = [(now / value, *rests(in_unit(log, "length_unit", unit)).scale()[:2]) for unit, value in LENGTHS.items()]
    clear = [(abs(math.log(scale)), factor * scale) for factor, scale, error in scales if 4.0 * error < UNIT * scale]
    return min(clear, default=(0.0, math.nan))[1]


def _local(gravity: float) -> Cause:
    return Cause("local gravity", keys={"gravity": float(f"{gravity:.4g}")})


def _length_cause(header: Header, ratio: float) -> Cause:
    """Lengths that are too long by a ratio: that of another unit, or a wrong scale."""
    for unit, value in LENGTHS.items():
        if unit != header.length_unit and abs(ratio * value / LENGTHS[header.length_unit] - 1.0) < UNIT:
            return Cause("length unit", keys={"length_unit": unit})
    return Cause("length scale", ratio - 1.0, {"length_scale": float(f"{ratio * header.length_scale:.4g}")})


def _rate_cause(log: Log, ratio: float) -> Cause:
    """Accelerations that are too large by a ratio, by another unit of time, or by a wrong rate in the header or in the times."""
    faster = math.sqrt(ratio)
    for unit, value in TIMES.items():
        if unit != log.header.time_unit and abs(ratio * (TIMES[log.header.time_unit] / value) ** 2 - 1.0) < UNIT:
            return Cause("time unit", keys={"time_unit": unit})
    return Cause("rate", faster - 1.0, {} if log.has_times else {"rate": float(f"{frame_rate(log.tosses)[0] / faster:.4g}")})


def gravity_interval(flights: Flights, drag: Regression, outside: float = 0.05) -> tuple[float, float]:
    """The interval that misses gravity with the probability `outside` [m/s²]: without drag, and with it too if it differs from 0."""
    found = [flights.moving, *([drag] if abs(drag.values[-1]) > drag.half_widths()[-1] else [])]
    middles, widths = [-one.values[1] for one in found], [one.half_widths(outside)[1] for one in found]
    return float(np.min(np.subtract(middles, widths))), float(np.max(np.add(middles, widths)))


def of_scale(flights: Flights, drag: Regression) -> Iterator[Finding]:
    """Of gravity that is a little too large or small, or not vertical.

    If the axes are tilted, gravity is as large as the whole acceleration; if something pushes the body sideways, as its vertical part.
    """
    header, found = flights.log.header, flights.moving
    x, fall, z = found.values[ACCELERATION].tolist()
    wide, (low, high) = found.half_widths(ALARM), gravity_interval(flights, drag, ALARM)
    level = math.hypot(x, z)
    is_tilted = level > math.hypot(wide[0], wide[2])
    whole = math.hypot(fall, level) if is_tilted else -fall
    high += whole + fall
    ratio = whole / header.gravity
    if not low <= header.gravity <= high and min(abs(ratio - 1.0), abs(fall / header.gravity + 1.0)) > LEAST_SCALE:
        at_rest, spread, _, _ = rests(flights.log).scale()
        by_length, by_rate = (abs(at_rest - expected) < 4.0 * spread + 0.004 for expected in (ratio, 1.0))
        single = (_length_cause(header, ratio), _rate_cause(flights.log, ratio), _local(whole))
        causes = shown(*zip(single, (by_length, by_rate, by_rate), strict=True))
        yield Finding("scale", whole, header.gravity, causes=causes, rests=at_rest)
    if is_tilted:
        yield Finding("tilt", math.atan2(level, -fall), 0.0, causes=(Cause("axes"), Cause("push")))


def shown(*causes: tuple[Cause, bool]) -> tuple[Cause, ...]:
    """The causes that the frames at rest show, or all if they show none."""
    return tuple(cause for cause, is_shown in causes if is_shown) or tuple(cause for cause, _ in causes)
