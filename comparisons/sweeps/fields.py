"""The fields of a scene by dotted names, such as `floor.restitution` and `start.position[1]`."""

import re
from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Any

from dropspin.scenarios import DropspinError, Scenario
from dropspin.scenarios.errors import did_you_mean
from dropspin.scenarios.loading import FEATURES, from_table

TABLES = ("body", *(name for name in FEATURES if name != "expect"))
Path = tuple[str | int, ...]


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


def _dotted(path: Path) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path).lstrip(".")
