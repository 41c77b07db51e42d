"""The measured tosses that a scene may be compared with, and the file in which `dropspin log check` writes them.

A toss begins at the end of its flight, in the state that the flight gives. Its frames are those of the recording from there on. The flight
allows other states as well: these are drawn from their distribution, so that each engine shows what they make of the motion.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from dropspin.scenarios.errors import DropspinError, SceneError, did_you_mean
from dropspin.scenarios.field_types import AS_LISTS, Positive, Table, rows
from dropspin.scenarios.files import read_file
from dropspin.scenarios.rotations import length
from dropspin.scenarios.state import ORIENTATION, PARTS, Array
from dropspin.scenarios.text import Text
from dropspin.scenarios.validation import shown, validated

STARTS = 20
"""States in which a toss may begin: the estimate, and 19 drawn ones, the largest of 20 values being each of them with probability 1/20."""
NEAR_UNIT = 1e-3
"""Largest difference from 1 of the length of a quaternion: they are written with six digits."""
LARGEST_FILE = 200_000_000  # bytes


class Toss(Table):
    """A measured toss from the end of its flight on.

    Attributes:
        name: Its name in the recording.
        t: Times of its frames from the start on [s], shape (n,), above 0.
        position: The centre of mass in these frames [m], shape (n, 3).
        orientation: Unit quaternions, shape (n, 4).
        starts: The states in which it may begin, shape (STARTS, 13); the first one is the estimate.
    """

    model_config = ConfigDict(arbitrary_types_allowed=True)

    name: Text
    t: Annotated[Array, rows("numbers"), AS_LISTS]
    position: Annotated[Array, rows("rows of 3 numbers", 3), AS_LISTS]
    orientation: Annotated[Array, rows("rows of 4 numbers", 4), AS_LISTS]
    starts: Annotated[Array, rows("rows of 13 numbers", 13), AS_LISTS]

    @model_validator(mode="after")
    def _is_a_motion(self) -> Self:
        if not len(self.t) == len(self.position) == len(self.orientation):
            raise ValueError("t, position and orientation need one row for each frame")
        if not (np.diff(self.t, prepend=0.0) > 0.0).all():
            raise ValueError("t must be above 0 and increase")
        if len(self.starts) != STARTS:
            raise ValueError(f"starts has {len(self.starts)} states; it needs {STARTS}")
        for quaternions in (self.orientation, self.starts[:, ORIENTATION]):
            if (np.abs(length(quaternions) - 1.0) > NEAR_UNIT).any():
                raise ValueError("orientations must be unit quaternions")
        return self


class Noise(Table):
    """Standard deviations of the noise of one frame [m, rad]."""

    position: Positive
    orientation: Positive


class Recording(Table):
    """The measured tosses of one body.

    Attributes:
        name: The name of the recording.
        noise: The noise of a frame.
        tosses: The tosses; the scene itself starts as the first one.
    """

    name: Text
    noise: Noise
    tosses: Annotated[tuple[Toss, ...], Field(min_length=1)]

    # By the digest; pydantic would compare arrays.
    def __eq__(self, other: object) -> bool:
        return isinstance(other, Recording) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    @cached_property
    def digest(self) -> str:
        """A hash of all that errors depend on."""
        sha = hashlib.sha256(repr(self.noise).encode())
        for toss in self.tosses:
            for values in (toss.t, toss.position, toss.orientation, toss.starts):
                sha.update(values.tobytes())
        return sha.hexdigest()

    @property
    def duration(self) -> float:
        """A time that is 10 to 20 ms longer than the longest toss [s], so that the last frame is before the last time step."""
        return math.ceil(100.0 * max(float(toss.t[-1]) for toss in self.tosses) + 1.0) / 100.0


def with_recording(content: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The content of a scene's file with the tosses of the file that `recording.file` names, which give start and duration.

    Raises:
        SceneError: The file is absent or damaged, or has no such toss, or the scene has another start.
    """
    table = content.get("recording")
    if not isinstance(table, Mapping) or "file" not in table:
        return content
    for key in table:
        if key not in ("file", "toss"):
            raise SceneError(f"recording.{key}: unknown key.{did_you_mean(str(key), ('file', 'toss'))} Allowed: file, toss.")
    if "start" in content:
        raise SceneError("start: the recording gives the start; leave out [start], or [recording].")
    if not isinstance(table["file"], str | Path):
        raise SceneError(f"recording.file: got {shown(table['file'])}; must be the path of a file .json that dropspin log check wrote.")
    try:
        recording = _read(folder / table["file"], str(folder / table["file"]))
    except DropspinError as error:
        raise SceneError(f"recording.file: {error}") from None
    if (wanted := table.get("toss")) is not None:
        names = [toss.name for toss in recording.tosses]
        if wanted not in names:
            raise SceneError(f"recording.toss: got {shown(wanted)}; no such toss. Known: {shown(', '.join(names))}.")
        recording = Recording(name=recording.name, noise=recording.noise, tosses=(recording.tosses[names.index(wanted)],))
    return {"duration": recording.duration, **content, "recording": recording, "start": start_of(recording)}


def start_of(recording: Recording) -> dict[str, Any]:
    """The table of the start of a scene with a recording."""
    return {name: recording.tosses[0].starts[0, part].tolist() for name, part in PARTS.items()}


def _read(path: Path, name: str) -> Recording:
    raw = read_file(path, name, "recording", LARGEST_FILE)
    try:
        content = json.loads(raw)
    except (ValueError, RecursionError):
        raise DropspinError(f"{name}: is not JSON, or damaged; give the file .json that dropspin log check wrote.") from None
    return validated(Recording, name, content)
