"""Findings about how a motion was recorded: frame of spins, missing and repeated frames, height of the floor."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from dropspin.comparisons.logs.afterwards import leap
from dropspin.comparisons.logs.flight import ACCELERATION, OFFSET, SURPRISING, Flight, departures, noise_of, surprise, window_size
from dropspin.comparisons.logs.flights import NEAR_FLOOR, Flights, heights, heights_in
from dropspin.comparisons.logs.header import UPRIGHT, Header
from dropspin.comparisons.logs.intervals import intervals_of_means
from dropspin.comparisons.logs.log import Cause, Finding
from dropspin.comparisons.logs.noise import Noise
from dropspin.comparisons.logs.other_conventions import UNTRACKED
from dropspin.comparisons.logs.rest import rests
from dropspin.comparisons.running.foreign_motions import missing_frames
from dropspin.scenarios.rotations import cross, length, rotate, unrotate
from dropspin.scenarios.state import Array

_Rated = Sequence[tuple[Flight, Array | None, Array]]

MOST_NOISE, ALLOWED = 3.0, 0.1
"""Multiple of the noise of recorded rates, and share of their size, up to which they agree with the motion."""
RESTS_NEAR = 0.02
"""Of the size of the body: how far above or below the floor it may rest, by errors of its own size and of tags."""
ENDS_NEAR = 0.04
"""Of the size of the body: how far below the floor flights may end, the last frame of which may be one of a contact."""
SINKS = 0.25
"""Of the size of the body: how far below the floor it may be in the two frames after, in a contact that is soft."""
SAME_SIZE = 0.02
"""Relative difference of heights on several faces from the expected ones, up to which the size of the body is right."""
BAD_FRAMES = (1, 2, 3)
"""Numbers of bad frames that are tried."""
CHANCE_ALONG_ONE = 58.6
"""Squared distance over variance up to which chance may move a frame, if all noise is along one axis, as in depth of a single camera: three
times χ² with one degree of freedom exceeds it once in 1e5.
"""
FILTERED = 8
"""Frames before and after an impact, or from the first one on, that a filter of positions may have moved off the flight."""
CLEAR = 20.0
"""Turn or way of a flight, over the noise, from which the ratio of its recorded rates to those of the motion is known."""
DEGREE, BETTER = 5, 1.02
"""Degree of the polynomials that compare times with equal steps. Uneven times are right unless equal steps fit by this factor better."""


def of_rates(flights: Flights) -> Iterator[Finding]:
    """Of recorded velocities and spins that are not those of the positions and quaternions: in another frame or unit, or reversed."""
    in_world, upright = flights.log.header.spin_frame == "world", np.array(UPRIGHT[flights.log.header.up])
    frame, (spun, moved) = Cause("spin frame", keys={"spin_frame": "body" if in_world else "world"}), _rated(flights)
    if flights.turning.noise.white < UNTRACKED:
        yield from _of_column("spin", spun, flights.turning.noise.white, frame, upright, in_body=not in_world)
    yield from _of_column("velocity", moved, flights.moving.noise.white, Cause("velocity frame"), upright)


def _rated(flights: Flights) -> tuple[_Rated, _Rated]:
    """Each flight with its recorded spins, and with its velocities, if it has any, and with those of the motion in its rows."""
    each = zip(flights.found, flights.rotations, strict=True)
    rated = [pair for pair in each if pair[0].toss.angular_velocity is not None or pair[0].toss.velocity is not None]
    spun = [(flight, flight.toss.angular_velocity, rotor(flight.t)[1]) for flight, rotor in rated]
    return spun, [(flight, flight.toss.velocity, _velocities(flight, rates, flights.log.header)) for flight, _, rates in spun]


def ratios_of_rates(flights: Flights) -> Iterator[tuple[str, float, float, float]]:
    """Names of recorded rates, and their ratio to those of the motion with its interval, which needs `FEWEST` flights.

    Flights that hardly turn, or move, are left out.
    """
    names, noises = (
        ("spin over that of the orientations", "velocity over that of the positions"),
        (flights.turning.noise, flights.moving.noise),
    )
    for name, columns, noise in zip(names, _rated(flights), noises, strict=True):
        known = [(flight, given[flight.rows], exact) for flight, given, exact in columns if given is not None]
        clear = [row for row in known if np.median(length(row[2])) * row[0].duration > CLEAR * noise.white]
        ratios = np.array([[np.sum(given * exact) / np.sum(exact**2)] for _, given, exact in clear if exact.any()])
        (low,), (high,) = intervals_of_means(ratios.reshape(-1, 1))
        if len(ratios):  # of ratios that hardly differ, those of the flights bound the mean
            yield name, float(ratios.mean()), float(max(low, ratios.min())), float(min(high, ratios.max()))


def _velocities(flight: Flight, spins: Array, header: Header) -> Array:
    """Velocities in the rows of a flight [m/s]: of the centre of mass, or of the tracked point if recorded speeds, in any unit, are."""
    arms = rotate(flight.toss.orientation[flight.rows], header.tracked_from_centre)
    _, first, second = np.polynomial.polynomial.polyfit(flight.t, flight.toss.position[flight.rows] - arms, 2)
    centre = np.asarray(first + 2.0 * flight.t[:, np.newaxis] * second)
    given = centre if flight.toss.velocity is None else flight.toss.velocity[flight.rows]
    speeds = length(given)
    return max(centre, centre + cross(spins, arms), key=lambda exact: float(speeds @ length(exact)) / float(np.linalg.norm(exact)))


def _of_column(
    kind: str,
    columns: _Rated,
    white: float,
    frame: Cause,
    upright: Array,
    *,
    in_body: bool = False,
) -> Iterator[Finding]:
    """Of recorded rates that differ from those of the motion: a finding for each of the fewest causes with which they agree.

    Args:
        kind: The kind of the finding.
        columns: Each flight with its recorded rates, if any, and with those of the motion in its rows.
        white: The white noise of the poses.
        frame: The cause that the rates are in the other frame.
        upright: The rotation from the axes of the recording, a quaternion.
        in_body: Whether the header says that they are in the frame of the body.
    """
    known = [(flight, given[flight.rows], exact, given[flight.first : flight.end]) for flight, given, exact in columns if given is not None]
    if not known:
        return
    given, exact = (np.concatenate([row[field] for row in known]) for field in (1, 2))
    turned = np.concatenate([flight.toss.orientation[flight.rows] for flight, *_ in known])
    # Second differences of white noise are √6 times as large, and those of a motion are small.
    rough = float(np.median(np.concatenate([length(np.diff(rates, n=2, axis=0)) for *_, rates in known]))) / math.sqrt(6.0)
    noise = white / float(np.median([flight.duration for flight, *_ in known]))
    size = float(np.median(length(exact))) or float(np.median(length(given)))

    def factor_of(rates: Array) -> float:
        """The factor by which the rates are those of the motion, by least squares."""
        return float(np.sum(rates * exact)) / (float(np.sum(exact**2)) or 1.0)

    def explained(rates: Array, factor: float) -> bool:
        """Whether the rates over a factor agree with those of the motion."""
        return float(np.median(length(rates / factor - exact))) <= max(MOST_NOISE * (rough / abs(factor) + noise), ALLOWED * size)

    off = abs(factor_of(given) - 1.0)  # of rates that are cut off, more than half may be right
    if explained(given, 1.0) and not (off > ALLOWED and off * size > MOST_NOISE * (rough + noise)):
        return
    found: list[tuple[Cause | None, ...]] = []
    frames = [(), (frame,)][:: -1 if in_body else 1]
    recorded = unrotate(turned if in_body else upright, given)
    # A mirror that reverses an axis leaves the component of a spin along it alone; no more is tried of velocities.
    for axis in ("", *"xyz") if kind == "spin" else ("",):
        columns_read = recorded * [1.0 if axis in ("", other) else -1.0 for other in "xyz"]
        for in_frame, rates in zip(frames, (rotate(upright, columns_read), rotate(turned, columns_read)), strict=True):
            factor = factor_of(rates)
            is_scaled = abs(abs(factor) - 1.0) > ALLOWED
            if (factor > 0.0 or (factor < 0.0 and not axis)) and explained(rates, factor):
                in_degrees = kind == "spin" and abs(math.radians(abs(factor)) - 1.0) < ALLOWED
                unit = Cause("degrees" if in_degrees else f"unit of the {kind}", abs(factor) - 1.0)
                mirror = [Cause(f"mirror {axis}")] if axis else []
                found.append((*in_frame, *mirror, *[Cause(f"sign of the {kind}")] * (factor < 0.0), *[unit] * is_scaled))
    difference = max(float(np.median(length(given - exact))) / size, off)
    for cause in min(found, key=len, default=(None,)):
        yield Finding(kind, difference, 0.0, causes=() if cause is None else (cause,))


def _residual(flights: Flights, *, equal_steps: bool) -> float:
    """Sum of squares that a polynomial leaves of the positions in flight, over the recorded times or over equal steps [m²]."""
    total = 0.0
    for flight in flights.found:
        steps = np.diff(flight.toss.t[flight.first : flight.end])
        frames = 1 + missing_frames(steps) if equal_steps else steps
        t = np.concatenate([[0.0], np.cumsum(frames)])
        position = flight.toss.position[flight.first : flight.end]
        total += float(np.polynomial.chebyshev.chebfit(2.0 * t / t[-1] - 1.0, position, DEGREE, full=True)[1][0].sum())
    return total


def of_frames(flights: Flights) -> Iterator[Finding]:
    """Of frames that are missing or repeated, of tosses without a flight, and of what the file shows by itself."""
    irregularities = _irregularities(flights)
    yield from irregularities
    held, flown = {one.toss: one.frame for one in irregularities if "repeated" in one.kind}, {flight.toss.name for flight in flights.found}
    uneven = any(finding.kind == "jitter" for finding in irregularities)  # of which frames seem off their flight
    above = {} if uneven else _in_mid_air(flights)
    noise, mid_air = noise_of(flights.log), {name: ends for name, ends in above.items() if name not in held}
    for toss in flights.log.tosses:
        if toss.name not in flown | held.keys():
            yield Finding("no flight", 0.0, window_size(toss, noise, flights.moving.values[ACCELERATION]), toss.name)
    after = flights.afterwards if flights.log.header.floor is not None and not uneven else []  # of other flights nothing more is used
    leaps = {one.rotor.flight.toss.name: leap(one) for one in after if one.rotor.flight.toss.name not in held}
    for flight, weight, again in zip(flights.found, flights.moving.weights, flights.moved_again, strict=True):
        if after and again is not None:
            yield Finding("moved again", 0.0, 0.0, flight.toss.name, again)
        own = flights.moving.noise.of_weight(min(weight, 1.0))
        for part in (flight.backwards(), flight):
            missing, bad, by_chance = _at_end(part, flights.moving.values, own)
            frame = flight.end + 1 if part is flight else flight.first - 1 - bad
            if missing or bad:
                if held.get(flight.toss.name) != frame and (missing or not (uneven or by_chance)):
                    yield Finding("frame dropped" if missing else "bad frame", missing or bad, 0.0, flight.toss.name, frame)
            elif by_chance:
                pass
            elif part is flight and flight.toss.name in mid_air:
                height, is_near = mid_air[flight.toss.name]
                causes = (Cause("frames missing"), Cause("touched"), *[Cause("filter")] * is_near)
                yield Finding("mid-air", height, 0.0, flight.toss.name, flight.end - 1, causes)
            elif part is flight and (missed := leaps.get(flight.toss.name)) is not None:
                yield Finding("leap", 0.0, 0.0, flight.toss.name, missed)
            elif part is not flight and flight.first > 2 and flight.toss.name not in held:
                causes = (Cause("held"), Cause("earlier impact"), *[Cause("filter")] * (flight.first <= FILTERED))
                yield Finding("late", flight.first, 0.0, flight.toss.name, flight.first, causes)


def _irregularities(flights: Flights) -> tuple[Finding, ...]:
    """Those of the file, without uneven times that the motion shows to be right."""
    found = flights.log.irregularities
    if not any(finding.kind == "jitter" for finding in found):
        return found
    times_are_right = _residual(flights, equal_steps=False) <= BETTER * _residual(flights, equal_steps=True)
    return tuple(finding for finding in found if finding.kind != "jitter" or not times_are_right)


def _at_end(flight: Flight, shared: Array, noise: Noise) -> tuple[int, int, bool]:
    """How many frames are missing after a flight, or bad, and whether chance alone may have moved those after it off the flight."""
    missing = _interrupted(flight, shared, noise, by_bad_frames=False)
    bad = 0 if missing else _interrupted(flight, shared, noise, by_bad_frames=True)
    beyond = range(flight.end, min(flight.end + (1 + bad if bad else FILTERED), len(flight.toss)))
    return missing, bad, all(surprise(flight, frame, shared, noise) < CHANCE_ALONG_ONE for frame in beyond)


def _interrupted(flight: Flight, shared: Array, noise: Noise, *, by_bad_frames: bool) -> int:
    """How many frames are missing at the end of a flight, or are not of it: the number with which the next ones are of it; 0 if none."""
    dt = flight.toss.time_step
    for number in BAD_FRAMES if by_bad_frames else _likely_missing(flight, shared):
        # The last frame of a flight was left out before an impact; the frame after it is the first one that is not of the flight.
        first, delay = (flight.end + 1 + number, 0.0) if by_bad_frames else (flight.end + 1, number * dt)
        frames = range(first, min(first + 3, len(flight.toss)))
        if len(frames) == 3 and all(surprise(flight, frame, shared, noise, delay) < SURPRISING for frame in frames):
            return number
    return 0


def _likely_missing(flight: Flight, shared: Array) -> Iterator[int]:
    """The number of missing frames, of up to as many as the flight has, with which the next frames are nearest to it, if there are any.

    Beyond so many frames, a flight predicts little.
    """
    toss, next_ones = flight.toss, np.arange(flight.end + 1, flight.end + 4)
    if next_ones[-1] < len(toss):
        numbers = np.arange(1, len(flight) + 1)
        t = toss.t[next_ones] - toss.t[flight.first] + numbers[:, np.newaxis] * toss.time_step
        left = toss.position[next_ones] - _continued(flight, shared, t, toss.orientation[next_ones])
        yield int(numbers[np.argmin(np.sum(left**2, axis=(1, 2)))])


def _continued(flight: Flight, shared: Array, t: Array, orientation: Array) -> Array:
    """The tracked point at times from the first frame of a flight on [s], with orientations then: straight on, and as bodies fall."""
    samples, t = departures(flight, shared), t[..., np.newaxis]
    start, velocity = np.polynomial.polynomial.polyfit(samples.t, samples.values, 1)
    return np.asarray(start + velocity * t + shared[ACCELERATION] * t**2 / 2.0 + rotate(orientation, shared[OFFSET]))


def _in_mid_air(flights: Flights) -> dict[str, tuple[float, bool]]:
    """How high the flights end that would not be near the floor three frames after their last one [m], by the name of the toss.

    With it, whether they would be `FILTERED` frames after it.

    Empty if these are more than half of the flights, and may end on one floor, which is elsewhere then.
    """
    header, found = flights.log.header, {}
    for rotor in flights.rotations if header.floor is not None else ():
        flight, toss = rotor.flight, rotor.flight.toss
        t = toss.t[flight.end - 1] - toss.t[flight.first] + np.arange(1 + FILTERED) * toss.time_step
        above = heights(header, _continued(flight, flights.moving.values, t, rotor(t)[0]), rotor(t)[0])
        if flight.end < len(toss) and above[:4].min() > NEAR_FLOOR * header.body.size:
            found[toss.name] = float(above[0]), bool(above.min() < NEAR_FLOOR * header.body.size)
    return found if 2 * len(found) <= len(flights.found) or rests(flights.log).are_apart(header.body.size) else {}


def of_floor(flights: Flights, alarm: float) -> Iterator[Finding]:
    """Of bodies that rest above the floor or below it by more than errors of the scale and of the tracked point explain, or fly below it.

    Heights on several faces tell a floor at another height from a body of another size.

    `alarm` is the probability with which these errors may be larger.
    """
    header, found, resting = flights.log.header, flights.moving, rests(flights.log)
    above, error = resting.above()
    if header.floor is None or resting.are_apart(header.body.size):
        return
    if not flights.show_offset.all() or not math.isfinite(above):
        flown = [heights_in(header, flight) for flight in flights.found]
        height, toss = min((float(one.max()), flight.toss.name) for one, flight in zip(flown, flights.found, strict=True))
        landed = [heights_in(header, replace(flight, end=min(flight.end + 2, len(flight.toss)))).min() for flight in flights.found]
        deep = 4.0 * found.noise.white + ENDS_NEAR * header.body.size
        if height < 0.0:
            yield Finding("below", -height, 0.0, toss)
        elif (end := float(np.median([one[-1] for one in flown]))) < -deep or (end := float(np.median(landed))) < -SINKS * header.body.size:
            yield Finding("end below", -end, 0.0)
        return
    wide, off = found.half_widths(alarm), header.tracked_from_centre - found.values[OFFSET]
    by_scale = (abs(found.values[1] / header.gravity + 1.0) + wide[1] / header.gravity) * float(np.mean(np.abs(resting.expected)))
    by_point = float(np.linalg.norm(np.abs(off) + wide[OFFSET]))
    if abs(above) > 4.0 * error + by_scale + by_point + RESTS_NEAR * header.body.size:
        floor, (stretch, spread) = (
            Cause("floor", keys={"floor_height": round(header.floor_height + above, 4)}),
            resting.stretch(header.body.size),
        )
        lengths = -found.values[1] / header.gravity
        is_size = min(abs(stretch - 1.0), abs(stretch - lengths)) > 4.0 * spread + SAME_SIZE
        causes = (Cause("size of the body"),) if is_size else (floor, Cause("size of the body")) if math.isnan(stretch) else (floor,)
        yield Finding("floor", above, 0.0, causes=causes, rests=stretch)
