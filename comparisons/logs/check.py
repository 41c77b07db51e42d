"""What a recording says about itself, from free flight and from rest: units, axes, rate, gravity, centre of mass, inertia, drag.

A finding is a value that differs from the header's by more than noise does once in 10,000 sound recordings. It has several causes where
neither the motion nor the frames at rest tell them apart.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dropspin.comparisons.logs.falling import flights_in_any_units
from dropspin.comparisons.logs.flight import OFFSET, falls, positions
from dropspin.comparisons.logs.flights import Flights, flights_of
from dropspin.comparisons.logs.gravity import ALARM, gravity_interval, of_scale, of_units, shown
from dropspin.comparisons.logs.header import Header
from dropspin.comparisons.logs.log import Cause, Finding, Log, load_log
from dropspin.comparisons.logs.noise import Regression, regression
from dropspin.comparisons.logs.other_conventions import in_other_readings, of_lengths, of_quaternions, orders_of_axes
from dropspin.comparisons.logs.recording_faults import of_floor, of_frames, of_rates, ratios_of_rates
from dropspin.comparisons.logs.rest import rests
from dropspin.comparisons.running.arguments import ignore
from dropspin.scenarios.bodies.inertia import in_numbers
from dropspin.scenarios.errors import DropspinError
from dropspin.scenarios.state import Array

LEAST_DECAY = 0.01
"""The least decay of the spin [1/s] that is a finding; engines have a larger damping."""
CENTRES = tuple(f"centre of mass, {axis}" for axis in "xyz")
RATIOS = ("I_x / I_y over the header's", "I_z / I_y over the header's")
"""Names of values."""
MOST_LOG = 300.0
"""Logarithm of which twice is near that of the largest number: values and intervals that are larger are not determined."""
OF_SIZE, OF_RATIO, OF_DECAY = 0.1, 0.1, 0.5
"""Half widths of intervals beyond which a value counts as not identifiable: a share of the size, a logarithm, and [1/s]."""


@dataclass(frozen=True)
class Value:
    """A value with its 95 % interval. The flights do not determine the value if the half width of the interval is larger than `useful`."""

    name: str
    value: float
    low: float
    high: float
    unit: str
    useful: float = math.inf

    @property
    def half_width(self) -> float:
        """The half width of the interval."""
        return 0.5 * (self.high - self.low)

    @property
    def is_identifiable(self) -> bool:
        """Whether the flights determine the value."""
        return not self.half_width > self.useful


@dataclass(frozen=True)
class TossFacts:
    """The flight of a toss: its first frame, its number of frames (0 without a flight), and its noise relative to the other tosses."""

    name: str
    first: int
    frames: int
    noise: float


@dataclass(frozen=True, eq=False)
class Check:
    """The result of `log_check`: values, findings and properties of each toss, from the flights found in a recording."""

    values: tuple[Value, ...]
    findings: tuple[Finding, ...]
    tosses: tuple[TossFacts, ...]
    flights: Flights

    @property
    def corrected(self) -> Header:
        """The header, corrected by the keys of each finding that has a single cause."""
        keys = [finding.causes[0].keys for finding in self.findings if len(finding.causes) == 1]
        return self.flights.log.header.corrected({key: value for of_one in keys for key, value in of_one.items()})

    @property
    def reads_the_columns_right(self) -> bool:
        """Whether the header states units, axes, their order, quaternions and the floor correctly; an error of the scale is ignored."""
        wrong = {"up", "unit", "quaternion", "body axes", "lengths", "floor", "below", "end below"}
        return wrong.isdisjoint(finding.kind for finding in self.findings)


def log_check(recording: Flights | Log | str | Path, on_progress: Callable[[str, float], None] | None = None) -> Check:
    """Check the header of a recording against the flights in it, and against the frames in which the body is at rest.

    Args:
        recording: The recording, an argument of `load_log`, or the flights found in a recording.
        on_progress: Called with a description of the current work and the fraction of the flights that is done.

    Returns:
        The measured values with their intervals, the findings, and the properties of each toss.

    Raises:
        DropspinError: The recording cannot be loaded, or no toss has a free flight.
    """
    log = load_log(recording) if isinstance(recording, str | Path) else recording
    if isinstance(log, Log):
        try:
            flights = flights_in_any_units(log, ALARM, on_progress or ignore)
        except DropspinError:
            other = _in_another_reading(log)
            if other is None:
                raise
            check = log_check(other[1])
            return replace(check, findings=(other[0], *check.findings))
    else:
        flights = log
    drag = regression([positions(flight, with_drag=True) for flight in flights.found])
    found = [*of_units(flights), *of_quaternions(flights.log, flights), *of_rates(flights), *of_frames(flights)]
    values = tuple(_values(flights, drag))
    check = Check(values, tuple(found), tuple(_tosses(flights)), flights)
    if check.reads_the_columns_right:
        check = replace(check, findings=(*found, *of_lengths(flights.log)))
    if not check.reads_the_columns_right:  # heights are not known either
        return replace(check, findings=tuple(one for one in check.findings if one.kind not in ("mid-air", "moved again", "leap")))
    known = {value.name: value.is_identifiable for value in values}
    off = list(_of_offset(flights, known))
    if off:  # the tracked point of a body that turns fast about another point seems not to fly
        found = [finding for finding in found if finding.kind not in ("no flight", "late", "mid-air", "leap")]
    # The last frames of a flight may be of the impact.
    found += [Finding("misread", toss=one.toss.name, frame=frame) for one in flights.found for frame in one.misread if frame < one.end - 3]
    found += [*of_scale(flights, drag), *off, *_of_inertia(flights, drag, known), *of_floor(flights, ALARM)]
    return replace(check, findings=tuple(found))


def _in_another_reading(log: Log) -> tuple[Finding, Flights] | None:
    """The other reading in which the tosses fall longest, and its flights; None if less than half of the tosses fall in it."""
    readings = [(finding, read, falls(read, read.header.acceleration)) for finding, read in in_other_readings(log)]
    finding, read, fallen = max(readings, key=lambda reading: sum(map(len, reading[2])))
    flights = flights_of(read, read.header.acceleration) if 2 * len(fallen) >= len(log.tosses) else None
    return None if flights is None else (finding, flights)


def _of_offset(flights: Flights, known: Mapping[str, bool]) -> Iterator[Finding]:
    """Of a centre of mass that is not where the header says, along the axes along which it is identifiable."""
    header, found = flights.log.header, flights.moving
    off = np.where([known[name] for name in CENTRES], header.tracked_from_centre - found.values[OFFSET], 0.0)
    by_scale = abs(found.values[1] / header.gravity + 1.0) * float(np.linalg.norm(header.tracked_from_centre))
    is_off = np.abs(off) > found.half_widths(ALARM)[OFFSET] + by_scale
    if is_off.any():
        _, _, moved, error = rests(flights.log).scale()
        seen, allowed = np.isfinite(moved) & is_off, 4.0 * error + 0.2 * np.abs(off)
        # δ is the error of the tracked point: 0 if the centre of mass is the cause, -off if the point is.
        by_mass, by_point = (bool(seen.any() and (np.abs(moved - wrong) < allowed)[seen].all()) for wrong in (0.0, -off))
        inertia = {} if isinstance(header.body.inertia, tuple) else {"body.inertia": in_numbers(header.body.inertia_tensor)}
        keys = {"body.center_of_mass": _rounded(header.body.centre + off)} | inertia
        point = {"tracked_point": _rounded(np.asarray(header.tracked_point) - off)}
        causes = shown((Cause("centre of mass", keys=keys), by_mass), (Cause("tracked point", keys=point), by_point))
        opposite = 2.0 * float(np.abs(moved[seen]).max()) if seen.any() else math.nan
        yield Finding("centre of mass", float(np.linalg.norm(off)), 0.0, causes=causes, rests=opposite)


def _rounded(values: Array) -> list[float]:
    return [round(value, 4) for value in values.tolist()]


def _of_inertia(flights: Flights, drag: Regression, known: Mapping[str, bool]) -> Iterator[Finding]:
    """Of ratios of moments of inertia that differ from the header's, of drag and lost spin, as far as they are identifiable."""
    found, body = _turning(flights), flights.log.header.body
    are_known = [known[name] for name in RATIOS]
    ratios = np.where(are_known, found.values[:2], 0.0)
    stretched = np.exp(0.5 * np.array([ratios[0], 0.0, ratios[1]]))
    keys = {"body.inertia": in_numbers(body.inertia_tensor * np.outer(stretched, stretched))}
    wide = found.half_widths(ALARM)[:2]
    orders = tuple(_orders_that_fit(flights.log, ratios, np.where(are_known, wide, np.inf)))
    causes = (*orders, Cause("other moments" if orders else "moments of inertia", keys=keys))
    for kind, value, error in zip(("inertia, x", "inertia, z"), ratios, wide, strict=True):
        if abs(value) > max(error, 0.01):
            yield Finding(kind, math.exp(value), 1.0, causes=causes)
    if known["drag"] and abs(drag.values[-1]) > drag.half_widths(ALARM)[-1]:
        yield Finding("drag" if drag.values[-1] > 0.0 else "no drag", float(drag.values[-1]), 0.0)
    if known["decay of the spin"] and found is flights.spinning:
        yield Finding("spin decay", float(found.values[-1]), 0.0)


def _turning(flights: Flights) -> Regression:
    """Ratios of inertia: with the decay of the spin if there is any."""
    decay, error = flights.spinning.values[-1], flights.spinning.half_widths(ALARM)[-1]
    return flights.spinning if abs(decay) > max(error, LEAST_DECAY) else flights.turning


def _orders_that_fit(log: Log, ratios: Array, wide: Array) -> Iterator[Cause]:
    """The orders of the body's axes, and a constant spin, with which ratios are as measured: logarithms over the header's, shape (2,)."""
    own = np.diag(log.header.body.inertia_tensor)
    for inertia, cause in (*orders_of_axes(log), (np.eye(3), Cause("constant spin"))):
        changes = np.log(np.diag(inertia) / own)
        if (np.abs(changes[[0, 2]] - changes[1] - ratios) <= wide).all():
            yield cause


def _values(flights: Flights, drag: Regression) -> Iterator[Value]:
    """The values that flights give, each with its interval or with what it needs."""
    header, found = flights.log.header, flights.moving
    fall, (low, high) = -float(found.values[1]), gravity_interval(flights, drag)
    yield Value("gravity", fall, low, high, "m/s²")
    yield Value("length scale", fall / header.gravity, low / header.gravity, high / header.gravity, "")
    yield from centre_of_mass(flights)
    turning = _turning(flights)
    logarithms = np.clip([turning.values[:2], turning.half_widths()[:2]], -MOST_LOG, MOST_LOG).T
    for name, (value, error) in zip(RATIOS, logarithms.tolist(), strict=True):
        middle = math.exp(value)
        yield Value(name, middle, math.exp(value - error), math.exp(value + error), "", middle * math.sinh(OF_RATIO))
    for name, decaying in (("drag", drag), ("decay of the spin", flights.spinning)):
        rate, error = decaying.values[-1], decaying.half_widths()[-1]
        yield Value(name, rate, rate - error, rate + error, "1/s", OF_DECAY)
    yield from (Value(*ratio, "") for ratio in ratios_of_rates(flights))
    for name, noise, unit in (("position", found.noise, "m"), ("orientation", flights.turning.noise, "rad")):
        yield Value(f"white noise of {name}", noise.white, math.nan, math.nan, unit)
        yield Value(f"slow noise of {name}", noise.slow, math.nan, math.nan, f"{unit}/s^1.5")


def centre_of_mass(flights: Flights) -> Iterator[Value]:
    """The coordinates of the centre of mass in the frame of the shape, by flights."""
    header = flights.log.header
    centres = np.asarray(header.tracked_point) - flights.moving.values[OFFSET]
    widths = np.where(flights.show_offset, flights.moving.half_widths()[OFFSET], np.inf)
    for name, centre, error in zip(CENTRES, centres, widths, strict=True):
        yield Value(name, centre, centre - error, centre + error, "m", OF_SIZE * header.body.size)


def _tosses(flights: Flights) -> list[TossFacts]:
    each = zip(flights.found, flights.moving.weights, strict=True)
    facts = [TossFacts(flight.toss.name, flight.first, len(flight), 1.0 / math.sqrt(weight)) for flight, weight in each]
    by_name = {one.name: one for one in facts}
    return [by_name.get(toss.name, TossFacts(toss.name, 0, 0, math.nan)) for toss in flights.log.tosses]
