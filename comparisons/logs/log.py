"""A recording: its tosses in SI units, y up, quaternions [x, y, z, w] from body to world.

What the file shows by itself, without the laws of motion, are facts: rows that repeat, missing frames, uneven times, another rate.
"""

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.logs.formats import FORMATS, ORIENTATION, POSITION, SPIN, VELOCITY, read_columns
from dropspin.comparisons.logs.header import LENGTHS, TIMES, UPRIGHT, Header
from dropspin.comparisons.running.foreign_motions import is_uneven, missing_frames, problems_of_order
from dropspin.scenarios.errors import DropspinError, SceneWarning, UnknownName
from dropspin.scenarios.loading import read_toml, with_mesh
from dropspin.scenarios.rotations import conjugate, dot, length, multiply, rotate
from dropspin.scenarios.state import Array
from dropspin.scenarios.validation import validated

SHIPPED = Path(__file__).parents[2] / "scenarios" / "recordings"
NEAR_UNIT = 0.05
"""Largest difference from 1 of the length of a quaternion; two digits round it by 0.01."""
MOVES, USUAL, FINEST, ROUNDED = 0.1, 0.9, 10.0, 1e-9
"""Share of a toss's usual step, a quantile of its steps other than 0, and multiple of the least difference of two steps (other than errors
of floating point, relative to the usual step) from which on a body moves: below, rounding of the file may repeat a row. Longer steps, which
catch up after a freeze or lead to an outlier, are few.
"""
NOISY, SMOOTHEST, ENOUGH = 0.01, 0.1, 9
"""Fourth differences of positions or quaternions, over the usual step, from which on no two rows are equal, even at rest: a quantile of
more than so many, which impacts do not raise.
"""
UNSURE = 0.5
"""Range of the steps between frames, over the usual step, from which on a long step does not show that frames are missing."""
OTHER_RATE = 2e-3
"""Relative difference of two rates that is none of rounding."""


@dataclass(frozen=True, eq=False)
class Toss:
    """One throw of a body, in SI units, with y up and the floor at y = 0.

    Attributes:
        name: The value of the column `toss`.
        t: Times since the first frame [s], shape (n,).
        position: Position of the tracked point [m], shape (n, 3).
        orientation: Unit quaternions [x, y, z, w], body to world, without jumps of sign, shape (n, 4).
        velocity: Velocity of the tracked point [m/s], shape (n, 3), or None if it was not recorded.
        angular_velocity: Angular velocity in the world frame [rad/s], shape (n, 3), or None if it was not recorded.
    """

    name: str
    t: Array
    position: Array
    orientation: Array
    velocity: Array | None = None
    angular_velocity: Array | None = None

    def __len__(self) -> int:
        return len(self.t)

    def until(self, end: int | None) -> "Toss":
        """Its poses before a frame."""
        return Toss(self.name, self.t[:end], self.position[:end], self.orientation[:end])

    @cached_property
    def time_step(self) -> float:
        """The median time between two frames [s]."""
        return float(np.median(np.diff(self.t)))


@dataclass(frozen=True)
class Cause:
    """A possible cause of a finding.

    Attributes:
        name: The name, such as `length scale`; `dropspin.reports.stories.log_findings` describes each.
        share: For a scale or a rate, the ratio of the recorded value to the true one, minus 1.
        keys: The keys of the header that correct the error, with their values; a key of the body is written `body.inertia`.
    """

    name: str
    share: float = math.nan
    keys: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Finding:
    """An error of a recording or its header.

    Attributes:
        kind: The kind, such as `scale`; `dropspin.reports.stories.log_findings` describes each. These kinds concern the rows of the file:
            `repeated` (rows repeat the previous one while the body moves), `repeated position` and `repeated orientation` (that alone),
            `gap` (frames are missing), `jitter` (the times are uneven) and `rate` (the frame rate differs from that of the header).
        value: The measured value, in SI units.
        expected: The value according to the header, or the usual value, in SI units.
        toss: The name of the toss; empty for the whole recording.
        frame: The frame of the toss, counted from 0.
        causes: The possible causes; if there are several, the recording does not distinguish them.
        rests: Evidence from bodies at rest: the ratio of their heights to the expected ones, the difference of the heights on opposite
            faces [m], or their scatter with the remedy [m].
    """

    kind: str
    value: float = math.nan
    expected: float = math.nan
    toss: str = ""
    frame: int | None = None
    causes: tuple[Cause, ...] = ()
    rests: float = math.nan


@dataclass(frozen=True, eq=False)
class Log:
    """A recording of a body's motion, in SI units.

    Attributes:
        header: The content of the header file.
        tosses: The tosses, in the order of the file.
        origin: The argument of `load_log`.
        irregularities: Irregularities of the file, such as repeated rows, missing frames, uneven times or another frame rate.
        has_times: Whether the file has times; else they follow from the rate of the header.
    """

    header: Header
    tosses: tuple[Toss, ...]
    origin: str
    irregularities: tuple[Finding, ...]
    has_times: bool = False


def log_names() -> list[str]:
    """The names of the recordings that dropspin has."""
    return sorted(path.stem for path in SHIPPED.glob("*.toml"))


def load_log(recording: str | Path) -> Log:
    """Load a recording.

    Args:
        recording: The path of the recording's header, a TOML file, or the name of a recording that comes with dropspin, such as
            `toss-cube`.

    Returns:
        The recording in SI units, with y up and quaternions [x, y, z, w] from body to world. Python warns of moments of inertia that no
        body of this mass and size has.

    Raises:
        DropspinError: A file is absent, damaged or too large, a key or a column is wrong, or the values are impossible for a recording.
    """
    given = str(recording)
    path = SHIPPED / f"{given}.toml" if given in log_names() else Path(recording)
    if not path.suffix and not path.exists():
        raise UnknownName("recording", given, log_names())
    if path.suffix.lower() in FORMATS:
        raise DropspinError(f"{given}: is the data of a recording; give its header, a TOML file with the keys data and [body].")
    header = validated(Header, given, with_mesh(read_toml(path, given, "recording"), path.parent))
    if header.body.excess_inertia:
        warnings.warn(f"{given}: body.inertia: {header.body.excess_inertia}", SceneWarning, stacklevel=2)
    columns, names = read_columns(path.parent / header.data, str(Path(given).parent / header.data), header.topic)
    header = header.model_copy(update={"data": str((path.parent / header.data).resolve())})
    where = f"{given}: data"
    if not len(names):
        raise DropspinError(f"{where}: has no rows; give a row for each frame.")
    if "t" not in columns and header.rate is None:
        raise DropspinError(f"{given}: neither a column t nor the key rate says when the frames were taken; give one.")
    labels, first, index = np.unique(names, return_index=True, return_inverse=True)
    parts = {str(labels[number]): np.flatnonzero(index == number) for number in np.argsort(first)}
    tosses = [_toss(where, header, name, columns, rows) for name, rows in parts.items()]
    poses = np.column_stack([columns[column] for column in (*POSITION, *ORIENTATION)])
    irregularities = _irregularities(header, tosses, [poses[rows] for rows in parts.values()])
    return Log(header, tuple(tosses), given, tuple(irregularities), "t" in columns)


def _toss(where: str, header: Header, name: str, columns: dict[str, Array], rows: NDArray[np.intp]) -> Toss:
    """The rows of a toss in SI units and dropspin's conventions."""

    def of(group: tuple[str, ...]) -> Array:
        return np.column_stack([columns[column][rows] for column in group])

    t = columns["t"][rows] * TIMES[header.time_unit] if "t" in columns else np.arange(len(rows)) / (header.rate or 1.0)
    for problem in problems_of_order(t):
        row = f" (row {rows[1 + np.argmin(np.diff(t) > 0.0)] + 1})" if len(t) > 1 else ""
        raise DropspinError(f"{where}: toss {name}: {problem}{row}.")
    quaternions = of(ORIENTATION)
    lengths = length(quaternions)
    if (off := np.abs(lengths - 1.0) > NEAR_UNIT).any():
        raise DropspinError(
            f"{where}: toss {name}: the quaternion of row {rows[np.argmax(off)] + 1} has length {lengths[np.argmax(off)]:.3g}; "
            "give unit quaternions, and leave out rows without tracking."
        )
    upright, scale = np.array(UPRIGHT[header.up]), LENGTHS[header.length_unit] / header.length_scale
    orientation = quaternions / lengths[:, None]
    orientation = np.roll(orientation, -1, axis=1) if header.quaternion == "wxyz" else orientation
    orientation = conjugate(orientation) if header.rotation == "world-to-body" else orientation
    position = scale * rotate(upright, of(POSITION)) - [0.0, header.floor_height, 0.0]
    spin = None
    if SPIN[0] in columns:
        spin = of(SPIN) / TIMES[header.time_unit]
        spin = rotate(upright, rotate(orientation, spin) if header.spin_frame == "body" else spin)
    velocity = scale / TIMES[header.time_unit] * rotate(upright, of(VELOCITY)) if VELOCITY[0] in columns else None
    return Toss(name, t - t[0], position, _without_jumps(multiply(upright, orientation)), velocity, spin)


def _without_jumps(quaternions: Array) -> Array:
    """The quaternions with the signs for which neighbours are near each other."""
    signs = np.where(dot(quaternions[1:], quaternions[:-1]) < 0.0, -1.0, 1.0)
    return quaternions * np.cumprod(np.concatenate([[1.0], signs]))[:, None]


def _irregularities(header: Header, tosses: list[Toss], poses: list[Array]) -> Iterator[Finding]:
    """What the rows, with poses as in the file, and the times show; times that follow from the rate of the header are even."""
    for toss, rows in zip(tosses, poses, strict=True):
        yield from _repeated(toss.name, rows)
        yield from _uneven(toss)
    if header.rate is None:
        return
    rate, error = frame_rate(tosses)
    if abs(rate / header.rate - 1.0) <= OTHER_RATE + error:
        return
    # Times of two digits may have steps of one and of two units, of which the longer ones look like missing frames.
    fits = all(is_uneven(np.diff(toss.t)) and (np.diff(np.rint(header.rate * toss.t)) == 1.0).all() for toss in tosses)
    if not fits:
        yield Finding("rate", rate, header.rate, causes=(Cause("times"), Cause("rate of the header", keys={"rate": rate})))


def frame_rate(tosses: Sequence[Toss]) -> tuple[float, float]:
    """The rate of the frames, with those that are missing [1/s], and its relative error by times that are rounded or uneven.

    Over half of a toss, in the median, because rounded times have steps of which the usual one is not the mean.
    """
    rates, errors = [], []
    for toss in tosses:
        steps, half = np.diff(toss.t), len(toss) // 2
        missing = missing_frames(steps)
        frames = np.concatenate([[0], np.cumsum(1 + missing)])
        spans = toss.t[half:] - toss.t[:-half]
        rates.append((frames[half:] - frames[:-half]) / spans)
        errors.append(float(np.ptp(steps[missing == 0]) / np.median(spans)))
    return float(np.median(np.concatenate(rates))), float(np.median(errors))


def _repeated(toss: str, rows: Array) -> Iterator[Finding]:
    """Rows (n, 7) that repeat the previous one while the body moves, or of which the position or the orientation alone does.

    Positions decide whether the body moves. In rows without noise, it may stop at once, or slide without turning.
    """
    position, orientation = np.diff(rows[:, :3], axis=0), np.diff(_without_jumps(rows[:, 3:]), axis=0)
    (moves, noisy), (turns, turns_noisily) = _moving(position), _moving(orientation)
    stays, keeps = ~position.any(axis=1), ~orientation.any(axis=1)
    for kind, equal, steps, goes, ends in (
        ("repeated", stays & keeps, position, moves, noisy),
        ("repeated position", stays & turns & noisy, position, moves, True),
        ("repeated orientation", keeps & moves & turns_noisily, orientation, turns, True),
    ):
        edges = np.flatnonzero(np.diff(np.pad(equal, 1))).reshape(-1, 2).tolist()
        runs = [(begin, end) for begin, end in edges if _is_frozen(begin, end, steps, goes, ends)]
        if runs:
            yield Finding(kind, float(sum(end - begin for begin, end in runs)), 0.0, toss, runs[0][0] + 1)


def _moving(steps: Array) -> tuple[NDArray[np.bool_], bool]:
    """In which steps, shape (n, k), a body moves by more than rounding explains, and whether noise makes all rows differ."""
    sizes = length(steps)
    if not sizes.any():
        return sizes > 0.0, False
    usual, changes = np.quantile(sizes[sizes > 0.0], USUAL), np.abs(np.diff(steps, axis=0))
    finest = FINEST * changes[changes > ROUNDED * usual].min(initial=usual)
    rough = length(np.diff(steps[sizes > 0.0], n=3, axis=0))
    return sizes > max(MOVES * usual, finest), len(rough) > ENOUGH and bool(np.quantile(rough, SMOOTHEST) > max(NOISY * usual, finest))


def _is_frozen(begin: int, end: int, steps: Array, moves: NDArray[np.bool_], ends: bool) -> bool:
    """Whether steps that are 0 are beside those of a motion, at the ends of a toss too. One alone may be between a fall and a rebound."""
    beside = [row for row in (begin - 1, end) if 0 <= row < len(steps)]
    if len(beside) < 2:
        return ends and bool(beside) and bool(moves[beside].all())
    return bool(moves[beside].all()) and (end - begin > 1 or float(steps[begin - 1] @ steps[end]) > 0.0)


def _uneven(toss: Toss) -> Iterator[Finding]:
    """Missing frames, and times that are not equally spaced beside them."""
    steps = np.diff(toss.t)
    missing, usual = missing_frames(steps), float(np.median(steps))
    for frame in np.flatnonzero(missing) if np.ptp(steps[missing == 0]) < UNSURE * usual else ():
        yield Finding("gap", float(missing[frame]), 0.0, toss.name, int(frame) + 1)
    if is_uneven(steps[missing == 0]):
        worst = int(np.argmax(np.where(missing, 0.0, np.abs(steps - usual))))
        yield Finding("jitter", float(steps[worst]), usual, toss.name, worst + 1)
