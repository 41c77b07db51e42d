"""The fields of a scene by dotted names, such as `floor.restitution`, which sweeps vary."""

import re
from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Any

from dropspin.scenarios.errors import DropspinError, did_you_mean
from dropspin.scenarios.loading import from_table
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.validation import key_of

TABLES = ("body", "floor", "wall", "gravity", "start", "damping", "ensemble")
Path = tuple[str | int, ...]
"""The keys and indices of a field."""


class NoSuchField(DropspinError):
    """A field that a scene does not have."""


def path_of(name: str) -> Path:
    """The keys and indices of a dotted name, such as `floor.restitution` or `start.position[1]`."""
    if not re.fullmatch(r"[a-z_]+((\.[a-z_]+)|(\[(0|[1-9][0-9]{0,5})\]))*", name):
        raise NoSuchField(f"{name!r} is not a valid field name; write it as floor.restitution or start.position[1].")
    return tuple(int(part) if part.isdigit() else part for part in re.findall(r"[a-z_]+|[0-9]+", name))


def content_of(scene: Scenario) -> dict[str, Any]:
    """The part of a scene's file that describes its physics, as a mapping without absent tables."""
    content = scene.model_dump(include={"duration", *TABLES}, exclude_none=True)
    if scene.floor is not None and scene.floor.impact_law == "cone":
        del content["floor"]["impact_law"]  # the keys of jobs that had no other law stay the same
    if content["body"].get("center_of_mass") == (0.0, 0.0, 0.0):
        del content["body"]["center_of_mass"]  # so do those of bodies that had no other centre of mass
    if scene.damping is not None and scene.damping.factors:
        content["damping"] = scene.damping.factors | {"factor_dt": scene.damping.factor_dt}
    return content


def verify_field(scene: Scenario, name: str) -> None:
    """Raise `NoSuchField` unless the scene has a field that may be set."""
    path = path_of(name)
    if path[0] not in ("duration", *TABLES) or (path[0] != "duration" and len(path) == 1):
        raise NoSuchField(f"no such field.{did_you_mean(str(path[0]), TABLES)} Allowed: duration, or a field of {', '.join(TABLES)}.")
    value: Any = content_of(scene)
    for depth, key in enumerate(path):
        if isinstance(key, int):
            if not isinstance(value, tuple) or key >= len(value):
                raise NoSuchField(f"{key_of(path[:depth])} is {value!r}, which has no entry {key}.")
        elif not isinstance(value, Mapping) or (key not in value and depth == 0):
            raise NoSuchField(f"scene {scene.name!r} has no [{path[0]}]; an absent table is not modelled.")
        elif key not in value:
            return  # an optional key, which the schema of the scene accepts or refuses
        value = value[key]


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
    table: Any = content
    for key, following in pairwise(path):
        if isinstance(following, int):
            table[key] = list(table[key])
        table = table[key]
    table[path[-1]] = value
