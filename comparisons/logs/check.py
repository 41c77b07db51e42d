"""What a recording says about itself, from free flight and from rest: units, axes, rate, gravity, centre of mass, inertia, drag.

A finding is a value that differs from the header's by more than noise does once in 10,000 sound recordings. Where the motion alone cannot
tell two causes apart, both are alternatives, and what separates them is said.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from dropspin.comparisons.logs.flight import (
    ACCELERATION,
    DRAG,
    FEWEST_FRAMES,
    OFFSET,
    accelerations,
    is_near,
    positions,
    window_size,
    without,
)
from dropspin.comparisons.logs.flights import Flights, flights_of
from dropspin.comparisons.logs.log import LENGTHS, UPRIGHT, Log, load_log
from dropspin.comparisons.logs.noise import Regression, regression
from dropspin.comparisons.logs.recorded import Finding, of_frames, of_quaternions, of_spins
from dropspin.comparisons.logs.rest import rests
from dropspin.scenarios.errors import DropspinError
from dropspin.scenarios.rotations import unrotate
from dropspin.scenarios.state import Array

ALARM = 1e-4
"""Probability of a finding where there is nothing, of each value."""
UNIT = 0.05
"""Largest relative difference from the ratio of two units."""
OF_TIME = {1e-6: "times are in ms", 0.25: "the rate is half of the true one", 4.0: "the rate is twice the true one"}
"""Ratios of gravity to the true one, and what gives them."""
MOST_LOG = 700.0
"""Logarithm near that of the largest number: intervals that are wider are not determined."""
USEFUL = {"centre of mass": 0.1, "ratio of inertia": 0.1, "drag": 0.5}
"""Half widths of intervals beyond which a value counts as not identifiable: a share of the size, a share, and 1/s."""


@dataclass(frozen=True)
class Value:
    """A value with its 95 % interval; `note` says what would make it identifiable where it is not, and is None where it is."""

    name: str
    value: float
    low: float
    high: float
    unit: str
    note: str | None = None


@dataclass(frozen=True)
class TossFacts:
    """A toss: `frames` of its flight from `first` on, 0 without one, and its `noise` over that of the others."""

    name: str
    first: int
    frames: int
    noise: float


@dataclass(frozen=True, eq=False)
class Check:
    """Values, findings and a line for each toss, by the flights that were found."""

    values: tuple[Value, ...]
    findings: tuple[Finding, ...]
    tosses: tuple[TossFacts, ...]
    flights: Flights

    @property
    def reads_the_columns_right(self) -> bool:
        """Whether units, axes and quaternions are what the header says, but for an error of the scale."""
        return not any(finding.kind in ("up", "unit", "quaternion") for finding in self.findings)


def log_check(recording: Log | str | Path) -> Check:
    """What the flights and the rests of a recording say about its header.

    Args:
        recording: The recording, or what `load_log` takes.

    Returns:
        Its values with their intervals, its findings, and its tosses.

    Raises:
        DropspinError: It cannot be loaded, or no toss has a free flight.
    """
    log = recording if isinstance(recording, Log) else load_log(recording)
    down = np.array([0.0, -log.header.gravity, 0.0])
    acceleration = _acceleration(log, down)
    flights = flights_of(log, acceleration)
    if flights is None:
        raise DropspinError(
            f"{log.origin}: no toss has {FEWEST_FRAMES} frames of free flight with one acceleration; film from the release on, and give "
            "the rate of the frames."
        )
    drag = _drag(flights)
    found = [*_of_units(flights), *of_quaternions(log, flights), *of_spins(flights), *of_frames(flights)]
    check = Check(tuple(_values(flights, drag)), tuple(found), tuple(_tosses(flights)), flights)
    if not check.reads_the_columns_right:
        return check
    return replace(check, findings=(*found, *_of_scale(flights), *_of_offset(flights), *_of_inertia(flights, drag)))


def _acceleration(log: Log, down: Array) -> Array:
    """The free acceleration: the header's, if most tosses fall with it, else that of other units and axes that most tosses fall with."""
    pieces = [accelerations(toss, window_size(toss)) for toss in log.tosses if len(toss) >= window_size(toss)]

    def falling(acceleration: Array) -> int:
        return sum(bool(is_near(of_toss, acceleration).any()) for of_toss in pieces)

    if 2 * falling(down) > len(log.tosses):
        return down
    factors = {a / b for a, b in product(LENGTHS.values(), repeat=2)} | {1e6, *OF_TIME}
    candidates = [factor * sign * np.roll(down, turn) for factor in sorted(factors) for turn in range(3) for sign in (1.0, -1.0)]
    candidates += [of_toss[0] for of_toss in pieces]
    return max([down, *candidates], key=falling)


def _half_widths(found: Regression) -> Array:
    """Beyond which a value is a finding, shape (m,)."""
    return found.half_widths_of(ALARM)


def _of_units(flights: Flights) -> Iterator[Finding]:
    """Of accelerations that are along another axis or far from gravity."""
    header, found = flights.log.header, flights.moving.values[ACCELERATION]
    ratio, recorded = float(np.linalg.norm(found)) / header.gravity, unrotate(np.array(UPRIGHT[header.up]), -found)
    axis = int(np.argmax(np.abs(recorded)))
    up = ("-" if recorded[axis] < 0.0 else "") + "xyz"[axis]
    if up != header.up:
        yield Finding("up", f"bodies fall along {_opposite(up)}, the header says up = {header.up!r}", cure=f'up = "{up}"')
    if abs(ratio - 1.0) > UNIT:
        lengths = [unit for unit, value in LENGTHS.items() if abs(ratio * value / LENGTHS[header.length_unit] - 1.0) < UNIT]
        alternatives = [f"lengths are in {unit}" for unit in lengths]
        alternatives += [what for factor, what in OF_TIME.items() if abs(ratio / factor - 1.0) < UNIT]
        cure = f'length_unit = "{lengths[0]}"' if lengths else f"a rate divided by {math.sqrt(ratio):.4g}"
        yield Finding(
            "unit",
            f"gravity is {float(np.linalg.norm(found)):.4g} m/s²",
            tuple(alternatives)
            or (f"lengths are {ratio:.4g} times the true ones", f"the rate is {math.sqrt(ratio):.4g} times the true one"),
            cure,
            "the height at rest on a known face, or a length in the record",
        )


def _opposite(axis: str) -> str:
    return axis[1:] if axis.startswith("-") else f"-{axis}"


def _of_scale(flights: Flights) -> Iterator[Finding]:
    """Of gravity that is a little too large or small, or not vertical."""
    header, found = flights.log.header, flights.moving
    x, fall, z = found.values[ACCELERATION]
    wide = _half_widths(found)
    ratio, error = -fall / header.gravity, wide[1] / header.gravity
    if abs(ratio - 1.0) > error:
        by_length = f"lengths are {abs(ratio - 1.0):.1%} {'short' if ratio < 1.0 else 'long'}"
        by_rate = f"the rate is {abs(1.0 / math.sqrt(ratio) - 1.0):.1%} {'low' if ratio < 1.0 else 'high'}"
        scaled, rated = f"length_scale = {ratio * header.length_scale:.4g}", f"rate = {_rate(flights.log) / math.sqrt(ratio):.4g}"
        at_rest, spread, _, _ = rests(flights.log).scale()
        near = [abs(at_rest - expected) < 4.0 * spread + 0.004 for expected in (ratio, 1.0)]
        separates = f"heights at rest are {at_rest:.4g} of the expected ones"
        if near == [True, False]:
            yield Finding("scale", by_length, (), scaled, separates)
        elif near == [False, True]:
            yield Finding("rate", by_rate, (), rated, separates)
        else:
            heard = "a resting height on a known face, or the rate of the camera by a clock in the picture"
            yield Finding("scale", f"gravity is {-fall:.4g} m/s²", (by_length, by_rate), f"{scaled}, or {rated}", heard)
    if math.hypot(x, z) > math.hypot(wide[0], wide[2]):
        angle = math.degrees(math.atan2(math.hypot(x, z), -fall))
        yield Finding("tilt", f"gravity is {angle:.2g}° from the upward axis", ("the axes are tilted", "something pushes sideways"))


def _rate(log: Log) -> float:
    return 1.0 / float(np.median(np.concatenate([np.diff(toss.t) for toss in log.tosses])))


def _of_offset(flights: Flights) -> Iterator[Finding]:
    """Of a centre of mass that is not where the header says."""
    header, found = flights.log.header, flights.moving
    off = np.asarray(header.tracked_point) - header.body.centre - found.values[OFFSET]
    if (np.abs(off) > _half_widths(found)[OFFSET]).any():
        centre, tracked = header.body.centre + off, np.asarray(header.tracked_point) - off
        what = f"the tracked point turns about a point {1e3 * np.linalg.norm(off):.2g} mm from the centre of mass given"
        mass = f"the centre of mass is at {_listed(centre)} m"
        point = f"the tracked point is at {_listed(tracked)} m"
        _, _, moved, error = rests(flights.log).scale()
        seen = np.isfinite(moved) & (np.abs(off) > _half_widths(found)[OFFSET])
        # δ is the error of the tracked point: -off if that is the cause, 0 if the centre of mass is.
        by_point = seen.any() and bool((np.abs(moved + off) < 4.0 * error + 0.2 * np.abs(off))[seen].all())
        by_mass = seen.any() and bool((np.abs(moved) < 4.0 * error + 0.2 * np.abs(off))[seen].all())
        where = f"heights at rest on opposite faces differ by {2e3 * float(np.abs(moved[seen]).max()):.2g} mm" if seen.any() else ""
        if by_mass != by_point:
            cure = f"[body] center_of_mass = {_listed(centre)}" if by_mass else f"tracked_point = {_listed(tracked)}"
            yield Finding("centre of mass" if by_mass else "tracked point", f"{what}: {mass if by_mass else point}", (), cure, where)
        else:
            cure = f"[body] center_of_mass = {_listed(centre)}, or tracked_point = {_listed(tracked)}"
            yield Finding("centre of mass", what, (mass, point), cure, "heights at rest on opposite faces")


def _listed(values: Array) -> str:
    return "[" + ", ".join(f"{value:.4f}" for value in values) + "]"


def _of_inertia(flights: Flights, drag: Regression) -> Iterator[Finding]:
    """Of ratios of moments of inertia that differ from the header's, and of drag."""
    found = flights.turning
    for name, value, wide in zip(("I_x / I_y", "I_z / I_y"), found.values, _half_widths(found), strict=True):
        if abs(value) > max(wide, 0.01):
            yield Finding("inertia", f"{name} is {math.exp(value):.3g} times that of the header", cure="[body] inertia")
    if drag.values[-1] > _half_widths(drag)[-1]:
        yield Finding("drag", f"the speed decays at {drag.values[-1]:.2g} 1/s")


def _drag(flights: Flights) -> Regression:
    samples = [without(positions(flight), flights.moving.values, ACCELERATION, OFFSET, DRAG) for flight in flights.found]
    return regression(samples)


def _values(flights: Flights, drag: Regression) -> Iterator[Value]:
    """The values that flights give, each with its interval or with what it needs."""
    header, found = flights.log.header, flights.moving
    wide = found.half_widths
    fall, error = -found.values[1], wide[1]
    yield Value("gravity", fall, fall - error, fall + error, "m/s²")
    yield Value("length scale", fall / header.gravity, (fall - error) / header.gravity, (fall + error) / header.gravity, "")
    tosses = len(flights.found)
    centres = np.asarray(header.tracked_point) - found.values[OFFSET]
    for axis, centre, error in zip("xyz", centres, wide[OFFSET], strict=True):
        enough = USEFUL["centre of mass"] * header.body.size
        needs = None if error < enough else f"about {math.ceil(tosses * (error / enough) ** 2)} such tosses, or faster ones"
        yield Value(f"centre of mass, {axis}", centre, centre - error, centre + error, "m", needs)
    turning = flights.turning
    for name, value, error in zip(("I_x / I_y", "I_z / I_y"), turning.values, turning.half_widths, strict=True):
        low, middle, high = (math.exp(min(value + step, MOST_LOG)) for step in (-error, 0.0, error))
        needs = None if error < USEFUL["ratio of inertia"] else "tosses of 0.3 s that spin at 8 rad/s or more, about different axes"
        yield Value(f"{name} over the header's", middle, low, high, "", needs)
    rate, error = drag.values[-1], drag.half_widths[-1]
    yield Value("drag", rate, rate - error, rate + error, "1/s", None if error < USEFUL["drag"] else "longer flights")
    for name, noise, unit in (("position", found.noise, "m"), ("orientation", turning.noise, "rad")):
        yield Value(f"white noise of {name}", noise.white, math.nan, math.nan, unit)
        yield Value(f"slow noise of {name}", noise.slow, math.nan, math.nan, f"{unit}/s^1.5")


def _tosses(flights: Flights) -> Iterator[TossFacts]:
    weights = iter(flights.moving.weights)
    for toss, flight in zip(flights.log.tosses, flights.flights, strict=True):
        if flight is None:
            yield TossFacts(toss.name, 0, 0, math.nan)
        else:
            yield TossFacts(toss.name, flight.first, len(flight), 1.0 / math.sqrt(next(weights)))
