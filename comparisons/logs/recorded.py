"""Findings about how a motion was recorded: the order of its quaternions, the frame of its spins, missing and repeated frames."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from dropspin.comparisons.logs.flight import FEWEST_FRAMES, SURPRISING, surprise
from dropspin.comparisons.logs.flights import Flights
from dropspin.comparisons.logs.log import UPRIGHT, Header, Irregularity, Log, Toss
from dropspin.comparisons.logs.rest import level_share
from dropspin.comparisons.logs.rotors import rotation
from dropspin.scenarios.rotations import conjugate, length, multiply, rotate, unrotate
from dropspin.scenarios.state import Array
from dropspin.scenarios.text import counted

MOST_ROTORS = 8
"""Flights whose rotation is tried in other readings."""


@dataclass(frozen=True)
class Finding:
    """What is wrong: `alternatives` that the recording cannot tell apart, the `cure` in the header, and what `separates` them."""

    kind: str
    what: str
    alternatives: tuple[str, ...] = ()
    cure: str = ""
    separates: str = ""


def _read_as(toss: Toss, header: Header, rolled: int, inverse: bool) -> Toss:
    """The toss with the columns of its quaternions in another order, or of the inverse rotation."""
    upright = np.array(UPRIGHT[header.up])
    read = multiply(conjugate(upright), toss.orientation)
    read = conjugate(read) if header.rotation == "world-to-body" else read
    read = np.roll(read, rolled, axis=1)
    read = conjugate(read) if (header.rotation == "world-to-body") != inverse else read
    return replace(toss, orientation=multiply(upright, read))


def of_quaternions(log: Log, flights: Flights) -> Iterator[Finding]:
    """Of quaternions that another reading explains: bodies then rest on faces, or turn as free bodies do."""
    other = "wxyz" if log.header.quaternion == "xyzw" else "xyzw"
    inverse = "body-to-world" if log.header.rotation == "world-to-body" else "world-to-body"
    rolled = -1 if other == "wxyz" else 1
    level, count = level_share(log)
    inertia = log.header.body.inertia_tensor
    is_ball = bool(np.allclose(inertia, inertia[0, 0] * np.eye(3)))  # a spin is constant then, in every reading
    turns = _restlessness([rotor.samples.values for rotor in flights.rotations])
    for roll, turned, cure in (
        (rolled, False, f'quaternion = "{other}"'),
        (0, True, f'rotation = "{inverse}"'),
        (rolled, True, f'quaternion = "{other}", rotation = "{inverse}"'),
    ):
        read = replace(log, tosses=tuple(_read_as(toss, log.header, roll, turned) for toss in log.tosses))
        tried = flights.found[:MOST_ROTORS] if not is_ball else []
        some = [replace(flight, toss=_read_as(flight.toss, log.header, roll, turned)) for flight in tried]
        again = _restlessness([rotation(flight, inertia).samples.values for flight in some]) if some else turns
        share, _ = level_share(read)
        if (count >= 3 and level < 0.7 and share > 0.9 and again < 2.0 * turns) or (again < 0.4 * turns and not share < 0.9 * level):
            where = (
                f"{level:.0%} of {count} tosses rest on a face as given, {share:.0%} so" if count else "the rotation is then a free body's"
            )
            yield Finding("quaternion", "the quaternions are in another order or of the inverse rotation", (), cure, where)
            return


def _restlessness(left: list[Array]) -> float:
    """How far the rotations of flights are from those of free bodies: the median of their root mean squares [rad]."""
    return float(np.median([np.sqrt(np.mean(values**2)) for values in left]))


def of_spins(flights: Flights) -> Iterator[Finding]:
    """Of recorded spins that are in another frame or unit than the header says."""
    pairs = []
    for flight, rotor in zip(flights.found, flights.rotations, strict=True):
        if flight.toss.angular_velocity is not None:
            given, exact = flight.toss.angular_velocity[flight.rows], rotor(flight.t)[1]
            turned = flight.toss.orientation[flight.rows]
            pairs.append((given, exact, rotate(turned, given), unrotate(turned, given)))
    if not pairs:
        return
    given, exact, from_body, to_body = (np.concatenate(parts) for parts in zip(*pairs, strict=True))

    def error(values: Array) -> float:
        return float(np.median(length(values - exact))) / float(np.median(length(exact)))

    in_world = flights.log.header.spin_frame == "world"
    readings = {
        ("body-frame spin", f'spin_frame = "{"body" if in_world else "world"}"'): from_body if in_world else to_body,
        ("spin in degrees", "multiply wx, wy, wz by π/180"): np.radians(given),
        ("spin of the opposite sign", "change the sign of wx, wy, wz"): -given,
    }
    best = min(readings, key=lambda reading: error(readings[reading]))
    if error(given) > 0.1:
        known = error(readings[best]) < 0.3 * error(given)
        yield Finding(
            "spin",
            f"the recorded spin differs by {error(given):.0%} from that of the quaternions" + (f": {best[0]}" if known else ""),
            (),
            best[1] if known else "",
        )


def of_frames(flights: Flights) -> Iterator[Finding]:
    """Of frames that are missing or repeated, of tosses without a flight, and of what the file shows by itself."""
    yield from map(_of_file, flights.log.irregularities)
    absent = [toss.name for toss, flight in zip(flights.log.tosses, flights.flights, strict=True) if flight is None]
    if absent:
        yield Finding(
            "no flight",
            f"no free flight of {FEWEST_FRAMES} frames in toss {', '.join(absent[:5])}{' …' if len(absent) > 5 else ''}",
            cure="record from the release on",
        )
    for flight, weight in zip(flights.found, flights.moving.weights, strict=True):
        own, dt = flights.moving.noise.of_weight(min(weight, 1.0)), float(np.median(np.diff(flight.toss.t)))
        # The last frame of a flight was left out before an impact; the frame after it is the first one that is not of the flight.
        frames = range(flight.end + 1, min(flight.end + 4, len(flight.toss)))
        for missing in (1, 2, 3):
            if len(frames) == 3 and all(surprise(flight, frame, flights.moving.values, own, missing * dt) < SURPRISING for frame in frames):
                yield Finding(
                    "frame dropped",
                    f"toss {flight.toss.name}: {missing} missing before frame {flight.end + 1}",
                    cure="give the times in a column t",
                )
                break
        if flight.first > 2:
            yield Finding(
                "late",
                f"toss {flight.toss.name}: its flight begins at frame {flight.first}",
                ("it is held until then", "the recording begins after an impact"),
            )


def _of_file(shown: Irregularity) -> Finding:
    """What the file shows by itself, in words."""
    place = f"toss {shown.toss}, frame {shown.frame}"
    match shown.kind:
        case "repeated":
            rows = counted(int(shown.value), "row repeats", "rows repeat")
            return Finding("repeated", f"{place}: {rows} the one before while the body moves", cure="leave out rows that were not measured")
        case "gap":
            return Finding("gap", f"{place}: {counted(int(shown.value), 'frame is', 'frames are')} missing before it, by the times")
        case "jitter":
            what = f"{place}: the times are uneven: a step of {1e3 * shown.value:.4g} ms, the usual one is {1e3 * shown.expected:.4g} ms"
            return Finding("jitter", what, cure="give the time of each frame without rounding; or, if the camera is even, no t but rate")
    what = f"the times have {shown.value:.5g} frames per second, the header has {shown.expected:.5g}"
    return Finding("rate", what, ("the column t is wrong", "the key rate is wrong"), f"rate = {shown.value:.5g}, or no column t")
