"""What a sweep changes: fields of a scene by dotted names, such as `start.position[1]`, and the axes that give their values."""

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios import DropspinError, Scenario
from dropspin.scenarios.drawing import uniform
from dropspin.scenarios.errors import did_you_mean
from dropspin.scenarios.loading import FEATURES, from_table

Indices = NDArray[np.int64]
Path = tuple[str | int, ...]
Spacing = Literal["linear", "log"]
TABLES = ("body", *(name for name in FEATURES if name != "expect"))


@dataclass(frozen=True)
class Listed:
    """An axis with the values of a list.

    Attributes:
        name: The dotted name of the field that it sets.
        values: The values.
    """

    name: str
    values: tuple[Any, ...]

    def __len__(self) -> int:
        return len(self.values)

    @property
    def is_numeric(self) -> bool:
        """Whether all values are numbers."""
        return all(type(value) in (int, float) for value in self.values)

    def at(self, indices: Indices) -> NDArray[Any]:
        """The values at some indices: float64, or objects where not all are numbers."""
        return np.fromiter(self.values, float if self.is_numeric else object, len(self))[indices]


@dataclass(frozen=True)
class Spaced:
    """An axis with evenly spaced values, both ends included, computed from their indices, so that any number of them takes no memory."""

    name: str
    first: float
    last: float
    count: int
    spacing: Spacing
    is_numeric = True

    def __len__(self) -> int:
        return self.count

    @property
    def values(self) -> tuple[Any, ...]:
        """The values with which a spec is verified: the two ends."""
        return self.first, self.last

    def at(self, indices: Indices) -> NDArray[Any]:
        """The values at some indices."""
        values = self._between(indices / (self.count - 1))
        values[indices == self.count - 1] = self.last  # without rounding
        return values

    def _between(self, fractions: NDArray[np.float64]) -> NDArray[np.float64]:
        """The values at fractions of the distance from the first to the last, or of the distance between their logarithms."""
        if self.spacing == "linear":
            return self.first + (self.last - self.first) * fractions
        # `math.pow`, because the last bit of NumPy's power may depend on the length of the array.
        return np.array([self.first * math.pow(self.last / self.first, fraction) for fraction in fractions.tolist()])


@dataclass(frozen=True)
class Drawn(Spaced):
    """An axis with random values: each depends only on the seed, the name of the axis and its index."""

    seed: int

    def at(self, indices: Indices) -> NDArray[Any]:
        return self._between(uniform(self.seed, self.name, indices))


SweepAxis = Listed | Spaced


class NoSuchField(DropspinError):
    """A field that a scene does not have."""


def path_of(name: str) -> Path:
    """The keys and indices of a dotted name."""
    if not re.fullmatch(r"[a-z_]+((\.[a-z_]+)|(\[(0|[1-9][0-9]{0,5})\]))*", name):
        raise NoSuchField(f"{name!r} is not a valid field name; write it as floor.restitution or start.position[1].")
    return tuple(int(part) if part.isdigit() else part for part in re.findall(r"[a-z_]+|[0-9]+", name))


def content_of(scene: Scenario) -> dict[str, Any]:
    """The part of a scene's file that describes its physics, as a mapping without absent tables."""
    content = scene.model_dump(include={"duration", *TABLES}, exclude_none=True)
    if scene.floor is not None and scene.floor.impact_law == "cone":
        del content["floor"]["impact_law"]  # the keys of jobs that had no other law stay the same
    return content


def verify_field(scene: Scenario, name: str) -> None:
    """Raise `NoSuchField` unless the scene has a field that may be set."""
    path = path_of(name)
    if path[0] not in ("duration", *TABLES) or (path[0] != "duration" and len(path) == 1):
        raise NoSuchField(f"no such field.{did_you_mean(str(path[0]), TABLES)} Allowed: duration, or a field of {', '.join(TABLES)}.")
    found: Any = content_of(scene)
    for depth, key in enumerate(path):
        if isinstance(key, int):
            if not isinstance(found, tuple) or key >= len(found):
                raise NoSuchField(f"{_dotted(path[:depth])} is {found!r}, which has no entry {key}.")
        elif not isinstance(found, Mapping) or (key not in found and depth == 0):
            raise NoSuchField(f"scene {scene.name!r} has no [{path[0]}]; an absent table is not modelled.")
        elif key not in found:
            return  # an optional key, which the schema of the scene accepts or refuses
        found = found[key]


def _dotted(path: Path) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path).lstrip(".")


def with_fields(scene: Scenario, values: Iterable[tuple[str, Any]]) -> Scenario:
    """The scene with some fields set.

    Raises:
        SceneError: The result is not a valid scene.
    """
    content = content_of(scene)
    for name, value in values:
        set_field(content, path_of(name), value)
    return from_table(scene.name, "", content)


def set_field(content: dict[str, Any], path: Path, value: Any) -> None:
    """Set a field of a nested mapping; tuples along its path become lists."""
    found: Any = content
    for key, following in pairwise(path):
        if isinstance(following, int):
            found[key] = list(found[key])
        found = found[key]
    found[path[-1]] = value
