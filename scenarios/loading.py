"""From a name, a path or a mapping to a `Scenario`; bad input gets one line that says what is wrong and what is allowed."""

import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from scenarios.body import Box, Sphere, Vertices
from scenarios.errors import SceneError, did_you_mean
from scenarios.model import Damping, Ensemble, Expectation, Floor, Gravity, Scenario, Start

CATALOGUE = Path(__file__).parent / "catalogue"
LARGEST_FILE = 1_000_000  # bytes; a scene of ten thousand vertices takes less
FEATURES: dict[str, type[BaseModel]] = {
    "floor": Floor,
    "gravity": Gravity,
    "start": Start,
    "damping": Damping,
    "ensemble": Ensemble,
    "expect": Expectation,
}
INTERNAL = frozenset({"name", "origin"})
SHAPES: dict[str, type[BaseModel]] = {"sphere": Sphere, "box": Box, "vertices": Vertices}


def names() -> list[str]:
    """The scenes of the catalogue, in its order: drops before spins, as a newcomer meets them."""
    return sorted(path.stem for path in CATALOGUE.glob("*.toml"))


def load(scene: str | Path | Mapping[str, Any]) -> Scenario:
    """Load a scene by its catalogue name, from the path of a TOML file, or from a mapping with the same keys.

    Raises:
        SceneError: It is not a scene. The text names the file, the key, the value and what is allowed.
    """
    if isinstance(scene, Mapping):
        name = scene.get("name", "scene")
        return _validate(str(name), "", {key: value for key, value in scene.items() if key != "name"})
    if not isinstance(scene, str | Path):
        raise SceneError(f"scene: got {_shown(scene)} ({type(scene).__name__}); give a catalogue name, a path or a mapping.")
    path = _find(scene)
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise SceneError(f"{str(path)!a}: the file's name is not UTF-8 text; rename it.") from None
    return _validate(path.stem, str(scene), read_toml(path, str(scene)))


def _find(scene: str | Path) -> Path:
    text = str(scene)
    if "\0" in text:
        raise SceneError(f"scene {text!r}: no file has such a name.")
    if isinstance(scene, str) and re.fullmatch(r"[a-z0-9-]{1,100}", text) and (CATALOGUE / f"{text}.toml").is_file():
        return CATALOGUE / f"{text}.toml"
    path = Path(scene)
    if path.suffix == ".toml" or path.parent != Path() or os.path.exists(path):
        return path
    raise SceneError(
        f"scene {text!r} is not in the catalogue and no file of that name exists."
        f"{did_you_mean(text, names())} Give the path of a .toml file or one of: {', '.join(names())}."
    )


def read_toml(path: Path, given: str, what: str = "scene", largest: int = LARGEST_FILE) -> dict[str, Any]:
    """The content of a TOML file.

    Args:
        path: The file.
        given: As it was asked for.
        what: The word for what such a file is.
        largest: How long it may be [bytes].

    Raises:
        SceneError: It is no TOML file, or cannot be read.
    """
    try:
        with path.open("rb") as file:
            content = file.read(largest + 1)
        if len(content) > largest:
            raise SceneError(f"{given}: more than {largest:,} bytes; no {what} is that long.")
        return tomllib.loads(content.decode("utf-8-sig"))
    except IsADirectoryError:
        raise SceneError(f"{given}: is a directory; a {what} is one TOML file.") from None
    except OSError as error:
        raise SceneError(f"{given}: {error.strerror}; give the path of a readable .toml file.") from None
    except UnicodeDecodeError as error:
        raise SceneError(f"{given}: byte {error.start} is not UTF-8 text; a {what} is a TOML file in UTF-8.") from None
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"{given}: not TOML: {error}.") from None
    except RecursionError:
        raise SceneError(f"{given}: nested too deeply to be a {what}.") from None


def _validate(name: str, origin: str, content: dict[str, Any]) -> Scenario:
    where = origin or f"scene {name!r}"
    for key in INTERNAL & content.keys():
        raise SceneError(f"{where}: {key}: got {_shown(content[key])}; a scene's name is its file's, the key is not allowed.")
    try:
        return Scenario.model_validate({"name": name, "origin": origin, **content})
    except ValidationError as error:
        problems = error.errors(include_url=False)
        # A key that takes a word or something else is reported once for each; the word is beside the point for a number.
        telling = [problem for problem in problems if problem["type"] != "literal_error" or isinstance(problem["input"], str)]
        others = len({_without_union_members(problem["loc"])[:2] for problem in problems}) - 1
        more = f" ({others} more in this file)" if others else ""
        raise SceneError(f"{where}: {_described((telling or problems)[0])}{more}") from None


def _described(problem: Any) -> str:
    """One pydantic problem as 'key: got value; what is allowed'."""
    location = _without_union_members(problem["loc"])
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".")
    given = _shown(problem["input"])
    kind = problem["type"]
    if kind == "extra_forbidden":
        allowed = _keys_allowed(problem["loc"])
        guess = did_you_mean(str(location[-1]), allowed)
        return f"{key}: unknown key, with the value {given}.{guess} Allowed: {', '.join(allowed)}."
    if kind == "missing":
        return f"{key}: missing; it has no default."
    if kind == "union_tag_not_found":
        return f"{key}.shape: missing; must be one of {', '.join(map(repr, SHAPES))}."
    if kind == "union_tag_invalid":
        return f"{key}.shape: got {_shown(problem['input']['shape'])}; must be one of {', '.join(map(repr, SHAPES))}."
    if kind == "value_error" and isinstance(problem["input"], dict):  # a whole table: the text itself names keys and values
        return f"{key}: {problem['ctx']['error']}.".removeprefix(": ")
    if kind == "value_error":
        return f"{key}: got {given}; {problem['ctx']['error']}."
    if kind in ("too_short", "too_long"):
        bound = problem["ctx"].get("min_length") if kind == "too_short" else problem["ctx"]["max_length"]
        wanted = f"must have {'at least' if kind == 'too_short' else 'at most'} {bound} entries"
        return f"{key}: got {given}; {wanted}, has {problem['ctx']['actual_length']}."
    if kind in {"model_type", "model_attributes_type"}:
        return f"{key}: got {given}; must be a table, such as [{key}] with its keys below."
    message = problem["msg"].replace("Input should be", "must be").replace("valid ", "")
    return f"{key}: got {given}; {message}{_alternatives(location, kind)}."


def _without_union_members(location: tuple[Any, ...]) -> tuple[Any, ...]:
    """Pydantic names the tried member of a union in the location; a file has no such key."""
    return tuple(
        part
        for index, part in enumerate(location)
        if not (isinstance(part, str) and (("[" in part) or (index > 0 and location[index - 1] == "body" and part in SHAPES)))
        and part not in ("float", "constrained-float")
    )


def _alternatives(location: tuple[Any, ...], kind: str) -> str:
    """What else a key takes, where pydantic reports on one alternative alone."""
    if location == ("floor", "friction"):
        return ", or a Coulomb coefficient of 0 or more" if kind == "literal_error" else ", or be 'none' or 'infinite'"
    if location == ("body", "inertia"):
        return ", or three positive moments [Ixx, Iyy, Izz]"
    return ""


def _keys_allowed(location: tuple[Any, ...]) -> list[str]:
    table: type[BaseModel] = Scenario
    if len(location) > 1:
        table = SHAPES[location[1]] if location[0] == "body" else FEATURES[location[0]]
    return [key for key in table.model_fields if key not in INTERNAL]


def _shown(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else text[:57] + "..."
