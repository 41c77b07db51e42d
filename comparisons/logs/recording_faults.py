"""Findings about how a motion was recorded: order of quaternions, frame of spins, missing and repeated frames, height of the floor."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import permutations

import numpy as np

from dropspin.comparisons.logs.flight import ACCELERATION, OFFSET, SURPRISING, Flight, noise_of, surprise, window_size
from dropspin.comparisons.logs.flights import Flights, highest
from dropspin.comparisons.logs.header import LENGTHS, TIMES, UPRIGHT, Header
from dropspin.comparisons.logs.log import Cause, Finding, Log, Toss
from dropspin.comparisons.logs.noise import Noise
from dropspin.comparisons.logs.rest import level_share, rests
from dropspin.comparisons.logs.rotors import rotation
from dropspin.comparisons.running.foreign_motions import missing_frames
from dropspin.scenarios.bodies import Box, Ellipsoid
from dropspin.scenarios.bodies.inertia import is_diagonal
from dropspin.scenarios.rotations import conjugate, cross, length, multiply, rotate, unrotate
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
MOST_NOISE, ALLOWED = 3.0, 0.1
"""Multiple of the noise of recorded rates, and share of their size, up to which they agree with the motion."""
UNTRACKED = 0.3
"""White noise of the orientations [rad] from which on they show no rotation: of a body that turns by half a turn between two frames."""
RESTS_NEAR = 0.04
"""Of the size of the body: how far above or below the floor it may rest, by errors of its own size and of tags."""
DEGREE, BETTER = 5, 1.02
"""Degree of the polynomials that compare times with equal steps. Uneven times are right unless equal steps fit by this factor better."""

ORDERS = ("body axes", "order of the moments")
"""Causes: all of the body's axes are in another order, or its moments of inertia alone."""
CLEARLY = 3.0
"""Ratio of the scatter of heights at rest with two orders of the lengths from which on the smaller one is the right one."""


def _read_as(toss: Toss, header: Header, rolled: int, inverse: bool) -> Toss:
    """The toss with the columns of its quaternions in another order, or of the inverse rotation."""
    upright = np.array(UPRIGHT[header.up])
    read = multiply(conjugate(upright), toss.orientation)
    read = conjugate(read) if header.rotation == "world-to-body" else read
    read = np.roll(read, rolled, axis=1)
    read = conjugate(read) if (header.rotation == "world-to-body") != inverse else read
    return replace(toss, orientation=multiply(upright, read))


def of_quaternions(log: Log, flights: Flights) -> Iterator[Finding]:
    """Of quaternions that another reading, or other axes of the body, explain: bodies then turn as free bodies do, or rest on faces."""
    level, count = level_share(log)
    inertia = log.header.body.inertia_tensor
    is_ball = bool(np.allclose(inertia, inertia[0, 0] * np.eye(3)))  # a spin is constant then, in every reading
    turns = _restlessness([rotor.samples.values for rotor in flights.rotations])
    tried = flights.found[:MOST_ROTORS] if not is_ball else []
    readings = []  # each with what it leaves of the difference from free bodies, and with the share of the tosses that end on a face
    for cause, rolled, inverse in _readings(log.header):
        read = _corrected(log, cause, partial(_read_as, header=log.header, rolled=rolled, inverse=inverse))
        some = [replace(flight, toss=_read_as(flight.toss, log.header, rolled, inverse)) for flight in tried]
        left = _restlessness([rotation(flight, inertia).samples.values for flight in some]) if some else turns
        readings.append((left, level_share(read)[0], cause))
    can_be_explained = bool(tried) and EXPLAINED * turns > LEAST_LEFT * flights.turning.noise.white
    orders = [
        (_restlessness([rotation(flight, exchanged).samples.values for flight in tried]), level, cause)
        for exchanged, cause in (orders_of_axes(log) if can_be_explained else ())
    ]
    found = [one for one in (*readings, *orders) if one[0] < EXPLAINED * turns and not one[1] < NEARLY * level]
    if not found and count >= 3 and level < 0.7:
        found = [one for one in readings if one[1] > NEARLY and one[0] < 2.0 * turns]
    if found:
        least = min(left for left, _, _ in found)
        best = [one for one in found if one[0] <= EQUALLY * least]
        left, share, _ = max(best, key=lambda one: one[1])
        causes = [cause for _, of_reading, cause in best if not of_reading < NEARLY * share]
        are_read = any(cause.name not in ORDERS for cause in causes)
        kind, value, expected = ("quaternion", level, share) if are_read else ("body axes", turns, left)
        yield Finding(kind, value, expected, causes=tuple(cause for number, cause in enumerate(causes) if cause not in causes[:number]))
    elif flights.turning.noise.white > UNTRACKED:
        yield Finding("rotation", flights.turning.noise.white, 0.0)


def _readings(header: Header) -> Iterator[tuple[Cause, int, bool]]:
    """The other readings of the quaternions: the cause, by how many columns they are rolled, and whether they are inverted."""
    other, rolled = ("wxyz", -1) if header.quaternion == "xyzw" else ("xyzw", 1)
    order = {"quaternion": other}
    direction = {"rotation": "body-to-world" if header.rotation == "world-to-body" else "world-to-body"}
    yield Cause("order of the quaternions", keys=order), rolled, False
    yield Cause("direction of the quaternions", keys=direction), 0, True
    yield Cause("order and direction of the quaternions", keys=order | direction), rolled, True


def in_other_readings(log: Log) -> Iterator[tuple[Finding, Log]]:
    """The recording in each other unit, and with each other reading of its quaternions, and the finding that this one is right.

    With a wrong unit or orientation, the point that the header says to be tracked does not fly, unless it is the centre of mass.
    """
    header = log.header
    for key, units, power in (("length_unit", LENGTHS, 1), ("time_unit", TIMES, -2)):
        now = getattr(header, key)
        for unit in units if header.rate is None or key == "length_unit" else ():
            cause, factor = Cause(key.replace("_", " "), keys={key: unit}), units[unit] / units[now]
            lengths, times = (factor, 1.0) if power == 1 else (1.0, factor)
            if unit != now:
                read = _corrected(log, cause, partial(_in_units, header=header, lengths=lengths, times=times))
                yield Finding("unit", header.gravity / factor**power, header.gravity, causes=(cause,)), read
    for cause, rolled, inverse in _readings(header):
        read = _corrected(log, cause, partial(_read_as, header=header, rolled=rolled, inverse=inverse))
        yield Finding("quaternion", level_share(log)[0], level_share(read)[0], causes=(cause,)), read


def _corrected(log: Log, cause: Cause, change: Callable[[Toss], Toss]) -> Log:
    """The recording with the keys of a cause in its header, and with each toss changed alike."""
    return replace(log, header=log.header.model_copy(update=dict(cause.keys)), tosses=tuple(map(change, log.tosses)))


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
    _, scatter = rests(log).above()
    vectors = {"half_extents": body.half_extents, "center_of_mass": body.center_of_mass} if isinstance(body, Box | Ellipsoid) else {}
    vectors |= {"inertia": body.moments} if vectors and isinstance(body.inertia, tuple) else {}
    for axes in permutations(range(3)):
        exchanged = inertia[np.ix_(axes, axes)]
        if not np.array_equal(exchanged, inertia):
            keys = {f"body.{name}": [vector[axis] for axis in axes] for name, vector in vectors.items() if vector and any(vector)}
            moments = {name: values for name, values in keys.items() if name == "body.inertia"}
            _, other = rests(replace(log, header=log.header.corrected(keys))).above()
            if not other > CLEARLY * scatter:
                yield exchanged, Cause(ORDERS[0], keys=keys)
            if moments and not scatter > CLEARLY * other:
                yield exchanged, Cause(ORDERS[1], keys=moments)


def _restlessness(left: list[Array]) -> float:
    """How far the rotations of flights are from those of free bodies: the median of their root mean squares [rad]."""
    return float(np.median([np.sqrt(np.mean(values**2)) for values in left]))


def of_rates(flights: Flights) -> Iterator[Finding]:
    """Of recorded velocities and spins that are not those of the positions and quaternions: in another frame or unit, or reversed."""
    each, in_world = zip(flights.found, flights.rotations, strict=True), flights.log.header.spin_frame == "world"
    rated = [pair for pair in each if pair[0].toss.angular_velocity is not None or pair[0].toss.velocity is not None]
    spun = [(flight, flight.toss.angular_velocity, rotor(flight.t)[1]) for flight, rotor in rated]
    frame, upright = Cause("spin frame", keys={"spin_frame": "body" if in_world else "world"}), np.array(UPRIGHT[flights.log.header.up])
    if flights.turning.noise.white < UNTRACKED:
        yield from _of_column("spin", spun, flights.turning.noise.white, frame, upright)
    moved = [(flight, flight.toss.velocity, _velocities(flight, rates, flights.log.header)) for flight, _, rates in spun]
    yield from _of_column("velocity", moved, flights.moving.noise.white, Cause("velocity frame"), upright)


def _velocities(flight: Flight, spins: Array, header: Header) -> Array:
    """Velocities in the rows of a flight [m/s]: of the centre of mass, or of the tracked point if recorded speeds, in any unit, are."""
    arms = rotate(flight.toss.orientation[flight.rows], header.tracked_from_centre)
    _, first, second = np.polynomial.polynomial.polyfit(flight.t, flight.toss.position[flight.rows] - arms, 2)
    centre = np.asarray(first + 2.0 * flight.t[:, np.newaxis] * second)
    given = centre if flight.toss.velocity is None else flight.toss.velocity[flight.rows]
    speeds = length(given)
    return max(centre, centre + cross(spins, arms), key=lambda exact: float(speeds @ length(exact)) / float(np.linalg.norm(exact)))


def _of_column(
    kind: str, columns: Sequence[tuple[Flight, Array | None, Array]], white: float, frame: Cause, upright: Array
) -> Iterator[Finding]:
    """Of recorded rates that differ from those of the motion: a finding for each of the fewest causes with which they agree.

    Args:
        kind: The kind of the finding.
        columns: Each flight with its recorded rates, if any, and with those of the motion in its rows.
        white: The white noise of the poses.
        frame: The cause that the rates are in the other frame.
        upright: The rotation from the axes of the recording, a quaternion.
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

    def explained(rates: Array, factor: float) -> bool:
        """Whether the rates over a factor agree with those of the motion."""
        return float(np.median(length(rates / factor - exact))) <= max(MOST_NOISE * (rough / abs(factor) + noise), ALLOWED * size)

    if explained(given, 1.0):
        return
    found: list[tuple[Cause | None, ...]] = []
    of_body, of_world = rotate(turned, unrotate(upright, given)), rotate(upright, unrotate(turned, given))  # if they were of the other
    for in_frame, rates in (((), given), ((frame,), of_body), ((frame,), of_world)):
        factor = float(np.sum(rates * exact)) / (float(np.sum(exact**2)) or 1.0)
        is_scaled = abs(abs(factor) - 1.0) > ALLOWED
        if factor != 0.0 and explained(rates, factor):
            in_degrees = kind == "spin" and abs(math.radians(abs(factor)) - 1.0) < ALLOWED
            unit = Cause("degrees" if in_degrees else f"unit of the {kind}", abs(factor) - 1.0)
            found.append((*in_frame, *[Cause(f"sign of the {kind}")] * (factor < 0.0), *[unit] * is_scaled))
    difference = float(np.median(length(given - exact))) / size
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
    irregularities = flights.log.irregularities
    if any(finding.kind == "jitter" for finding in irregularities):
        times_are_right = _residual(flights, equal_steps=False) <= BETTER * _residual(flights, equal_steps=True)
        irregularities = tuple(finding for finding in irregularities if finding.kind != "jitter" or not times_are_right)
    yield from irregularities
    noise = noise_of(flights.log)
    for toss, flight in zip(flights.log.tosses, flights.flights, strict=True):
        if flight is None:
            yield Finding("no flight", 0.0, window_size(toss, noise, flights.moving.values[ACCELERATION]), toss.name)
    for flight, weight in zip(flights.found, flights.moving.weights, strict=True):
        own = flights.moving.noise.of_weight(min(weight, 1.0))
        for part in (flight.backwards(), flight):
            missing = _interrupted(part, flights.moving.values, own, by_bad_frames=False)
            bad = 0 if missing else _interrupted(part, flights.moving.values, own, by_bad_frames=True)
            if missing or bad:
                frame = flight.end + 1 if part is flight else flight.first - 1 - bad
                yield Finding("frame dropped" if missing else "bad frame", missing or bad, 0.0, flight.toss.name, frame)
            elif part is not flight and flight.first > 2:
                yield Finding("late", flight.first, 0.0, flight.toss.name, flight.first, (Cause("held"), Cause("earlier impact")))


def _interrupted(flight: Flight, shared: Array, noise: Noise, *, by_bad_frames: bool) -> int:
    """How many frames are missing at the end of a flight, or are not of it: the number with which the next ones are of it; 0 if none."""
    dt = float(np.median(np.diff(flight.toss.t)))
    for number in (1, 2, 3):
        # The last frame of a flight was left out before an impact; the frame after it is the first one that is not of the flight.
        first, delay = (flight.end + 1 + number, 0.0) if by_bad_frames else (flight.end + 1, number * dt)
        frames = range(first, min(first + 3, len(flight.toss)))
        if len(frames) == 3 and all(surprise(flight, frame, shared, noise, delay) < SURPRISING for frame in frames):
            return number
    return 0


def of_floor(flights: Flights, alarm: float) -> Iterator[Finding]:
    """Of bodies that rest above the floor or below it by more than errors of the scale and of the tracked point explain, or fly below it.

    `alarm` is the probability with which these errors may be larger.
    """
    header, found, resting = flights.log.header, flights.moving, rests(flights.log)
    above, error = resting.above()
    if header.floor is None:
        return
    if not flights.show_offset.all() or not math.isfinite(above):
        height, toss = min((highest(header, flight), flight.toss.name) for flight in flights.found)
        if height < 0.0:
            yield Finding("below", -height, 0.0, toss)
        return
    wide, off = found.half_widths(alarm), header.tracked_from_centre - found.values[OFFSET]
    by_scale = (abs(found.values[1] / header.gravity + 1.0) + wide[1] / header.gravity) * float(np.mean(np.abs(resting.expected)))
    by_point = float(np.linalg.norm(np.abs(off) + wide[OFFSET]))
    if abs(above) > 4.0 * error + by_scale + by_point + RESTS_NEAR * header.body.size:
        height = round(header.floor_height + above, 4)
        yield Finding("floor", above, 0.0, causes=(Cause("floor", keys={"floor_height": height}),))
