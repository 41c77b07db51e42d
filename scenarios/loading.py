"""Loading of a `Scenario` by the name or number of a catalogue scene, the name of a random scene, from a TOML file, or from a mapping."""

import os
import re
import sys
import tomllib
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from dropspin.scenarios.bodies.mesh_files import read_mesh
from dropspin.scenarios.errors import DropspinError, SceneError, SceneWarning, did_you_mean
from dropspin.scenarios.field_types import LARGEST
from dropspin.scenarios.files import read_file
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.problems import scene_name
from dropspin.scenarios.recording import with_recording
from dropspin.scenarios.validation import Alternatives, first_problem, shown

CATALOGUE = Path(__file__).parent / "catalogue"
DRAWN = r"draw-([0-9]{1,20})-([0-9]{1,4})"
"""The name of a random scene of `draw`, with its seed and its number."""
MAX_FILE_SIZE = 1_000_000  # bytes; a scene of ten thousand vertices is smaller
ALONG_FLOOR = 1e-6  # of gravity, across a floor to which it is parallel
DEEPEST = 30
"""Largest depth of nested tables and lists in a file; a baseline has six."""
ALTERNATIVES: Alternatives = {
    **{(f"{surface}.friction", "literal_error"): ", or a Coulomb coefficient of 0 or more" for surface in ("floor", "wall")},
    **{(f"{surface}.friction", "*"): ", or be 'none' or 'infinite'" for surface in ("floor", "wall")},
    ("body.inertia", "*"): ", or three positive moments [Ixx, Iyy, Izz], or a tensor of three such rows",
}


def names() -> list[str]:
    """The names of the catalogue's scenes.

    Returns:
        The names, sorted; `load` accepts each of them.
    """
    return sorted(path.stem for path in CATALOGUE.glob("*.toml"))


def load(scene: str | Path | Mapping[str, Any]) -> Scenario:
    """Load a scene.

    Args:
        scene: The name or the number (`DS-012`) of a catalogue scene, the name of a random scene, the path of a TOML file, or a mapping
            with the same keys. A mapping may have arrays instead of lists, and a key `name`, which is `scene` by default.

    Returns:
        The scene; all values are in SI units. Python warns of values that are valid but probably not intended.

    Raises:
        SceneError: The scene is not valid. The message gives the file or mapping, the key, the value and the allowed values.
    """
    if isinstance(scene, Mapping):
        return _plausible(from_mapping(_with_files(dict(scene), Path(), "scene")), "scene")
    if not isinstance(scene, str | Path):
        raise SceneError(f"scene: got {shown(scene)} ({type(scene).__name__}); give a catalogue name, a path or a mapping.")
    if isinstance(scene, str) and (drawn := re.fullmatch(DRAWN, scene)):
        from dropspin.scenarios.draw import drawn_scene

        return drawn_scene(*map(int, drawn.groups()))
    if isinstance(scene, str):
        scene = scene_name(scene)
    path = _find(scene)
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise SceneError(f"{str(path)!a}: the file's name is not UTF-8 text; rename it.") from None
    loaded = from_table(path.stem, str(scene), _with_files(read_toml(path, str(scene)), path.parent, str(scene)))
    return loaded if path.parent == CATALOGUE else _plausible(loaded, str(scene))


def _with_files(content: dict[str, Any], folder: Path, where: str) -> dict[str, Any]:
    """The content of a scene's file with that of the files that it names; messages begin with `where`."""
    try:
        return with_recording(with_mesh(content, folder), folder)
    except SceneError as error:
        raise SceneError(f"{where}: {error}") from None


def with_mesh(content: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The content of a scene's file with the mesh that `body.file` names, relative to the folder of the file, times `body.scale`."""
    body = content.get("body")
    if not isinstance(body, Mapping) or body.get("shape") != "mesh" or "file" not in body:
        return content
    keys = {key: value for key, value in body.items() if key not in ("file", "scale")}
    file, scale = body["file"], body.get("scale", 1.0)
    if not isinstance(file, str | Path):
        raise SceneError(f"body.file: got {shown(file)}; must be the path of a file .obj or .stl.")
    if isinstance(scale, bool) or not isinstance(scale, int | float) or not 0.0 < scale <= LARGEST:
        raise SceneError(f"body.scale: got {shown(scale)}; must be a number above 0.")
    if extra := {"points", "faces"} & set(keys):
        raise SceneError(f"body.{min(extra)}: the file of a mesh gives points and faces; give either these or file.")
    try:
        points, faces = read_mesh(folder / file, str(folder / file))
    except DropspinError as error:
        raise SceneError(f"body.file: {error}") from None
    return {**content, "body": {**keys, "points": scale * points, "faces": faces}}


def _plausible(scene: Scenario, where: str) -> Scenario:
    """A scene that a user gives, with a warning of each value that is probably not meant.

    Raises:
        SceneError: A body that strikes a floor has moments of inertia that no body of its size has.
    """
    body, g = scene.body, scene.acceleration
    if body.excess_inertia:
        message = f"{where}: body.inertia: {body.excess_inertia}"
        if scene.floor is not None:
            raise SceneError(message)
        warnings.warn(f"{message} Without a floor, the size has no effect.", SceneWarning, stacklevel=3)
    if body.ambiguity:
        warnings.warn(f"{where}: body: {body.ambiguity}", SceneWarning, stacklevel=3)
    if scene.floor is not None and g.any() and abs(g[1]) <= ALONG_FLOOR * np.linalg.norm(g):
        warnings.warn(
            f"{where}: gravity.acceleration: got {g.tolist()}, along the floor, so that the body does not fall onto it; "
            "y is up and the floor is y = 0: with z up, write (x, z, -y) for each vector (x, y, z), and exchange lengths along y and z.",
            SceneWarning,
            stacklevel=3,
        )
    return scene


def _find(scene: str | Path) -> Path:
    text = str(scene)
    if isinstance(scene, str) and re.fullmatch(r"[a-z0-9-]{1,100}", text) and (CATALOGUE / f"{text}.toml").is_file():
        return CATALOGUE / f"{text}.toml"
    path = Path(scene)
    if path.suffix == ".toml" or path.parent != Path() or os.path.exists(path):
        return path
    raise SceneError(
        f"scene {text!r} is not in the catalogue and no file of that name exists."
        f"{did_you_mean(text, names())} Give the path of a .toml file or one of: {', '.join(names())}."
    )


def read_toml(path: Path, name: str, kind: str = "scene", largest: int = MAX_FILE_SIZE, *, is_merged: bool = False) -> dict[str, Any]:
    """The content of a TOML file.

    Args:
        path: The file.
        name: The path as the user gave it, for messages.
        kind: The word for such a file, for messages.
        largest: Largest allowed size [bytes].
        is_merged: Whether git may have merged the file line by line; equal lines then count once, unless it has headings.

    Raises:
        SceneError: The path is not a TOML file, or cannot be read.
    """
    text, remedy = "", f"a {kind} is a TOML file in UTF-8"
    try:
        raw = read_file(path, name, kind, largest)
        text = raw.decode("utf-8-sig")
        content = tomllib.loads(_each_once(text) if is_merged else text)
    except DropspinError as error:
        raise SceneError(str(error)) from None
    except UnicodeDecodeError as error:
        reason = "is a binary file, which is not UTF-8 text" if b"\0" in raw else f"byte {error.start} is not UTF-8 text"
        raise SceneError(f"{name}: {reason}; {remedy}.") from None
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"{name}: not TOML: {error}; {remedy}.") from None
    except RecursionError:
        raise SceneError(f"{name}: nested too deeply to be a {kind}.") from None
    except ValueError:  # of Python's limit for converting decimal digits
        raise SceneError(f"{name}: has a whole number {TOO_LARGE}.") from None
    _verify_sizes(content, name, kind)
    return content


def _each_once(text: str) -> str:
    """A text with an empty line in place of each line that it had before; as it is with headings, below which equal lines differ."""
    if re.search(r"^\s*\[", text, re.MULTILINE):
        return text
    lines = text.split("\n")
    first = {line: len(lines) - 1 - number for number, line in enumerate(reversed(lines))}
    return "\n".join(line if first[line] == number else "" for number, line in enumerate(lines))


TOO_LARGE = "that exceeds the range of floating-point numbers"


def _verify_sizes(content: dict[str, Any], name: str, kind: str) -> None:
    """Raise `SceneError` for what no `kind` has and messages could not show: deep nesting, whole numbers of thousands of digits."""
    level: list[Any] = [content]
    for _ in range(DEEPEST):
        level = [part for node in level for part in (node.values() if isinstance(node, dict) else node)]
        if any(type(part) is int and part.bit_length() > sys.float_info.max_exp for part in level):
            raise SceneError(f"{name}: has a whole number {TOO_LARGE}.")
        level = [part for part in level if isinstance(part, dict | list)]
    if level:
        raise SceneError(f"{name}: nested too deeply to be a {kind}.")


def from_mapping(scene: Mapping[str, Any]) -> Scenario:
    """The scene of a mapping, whose values may be NumPy arrays and scalars."""
    if "origin" in scene:
        raise SceneError(f"scene['origin']: got {shown(scene['origin'])}; the key is not allowed.")
    try:
        return Scenario.model_validate({"name": "scene", **_without_numpy(scene)})
    except ValidationError as error:
        raise SceneError(first_problem(Scenario, error, ALTERNATIVES, "scene")) from None


def _without_numpy(value: Any) -> Any:
    """A value with NumPy arrays converted to lists and NumPy scalars to Python numbers."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        return {key: _without_numpy(item) for key, item in value.items()}
    return [_without_numpy(item) for item in value] if isinstance(value, list | tuple) else value


def from_table(name: str, origin: str, content: dict[str, Any]) -> Scenario:
    """The scene of the content of a file or a mapping.

    Args:
        name: The name of the scene.
        origin: The path of the file as the user gave it; empty if there is none.
        content: The tables.

    Raises:
        SceneError: The scene is not valid.
    """
    where = origin or f"scene {name!r}"
    for key in ("name", "origin"):
        if key in content:
            raise SceneError(f"{where}: {key}: got {shown(content[key])}; the key is not allowed; the name of a scene is that of its file.")
    try:
        return Scenario.model_validate({"name": name, "origin": origin, **content})
    except ValidationError as error:
        raise SceneError(f"{where}: {first_problem(Scenario, error, ALTERNATIVES)}") from None
