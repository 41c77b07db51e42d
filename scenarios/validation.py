"""Validation of the tables of a file. An error becomes one line with the place, the given value and the allowed values."""

import re
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from dropspin.scenarios.errors import DropspinError, did_you_mean
from dropspin.scenarios.field_types import LARGEST

Kind = TypeVar("Kind", bound=BaseModel)
Problem = Mapping[str, Any]
Alternatives = Mapping[tuple[str, str], str]
"""Texts for the other allowed values of a key, by key and pydantic's type of error, because pydantic reports each alternative
separately.
"""

NAMED_KEY = re.compile(r"([a-z_.]+): (.*)")
"""A problem that concerns several tables: the key to report, and the text."""


def validated(kind: type[Kind], where: str, content: Any) -> Kind:
    """Validate a table of a file.

    Args:
        kind: The model.
        where: The file, and the table in it.
        content: The table.

    Raises:
        DropspinError: The table is not valid; the message gives the place, the given value and the allowed values.
    """
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        raise DropspinError(f"{where}: {first_problem(kind, error)}") from None


def first_problem(kind: type[BaseModel], error: ValidationError, alternatives: Alternatives | None = None, root: str = "") -> str:
    """The first problem of a table as 'key: got value; what is allowed.'.

    Args:
        kind: The model.
        error: Pydantic's error.
        alternatives: Texts for the other allowed values of keys.
        root: The name of a mapping in Python, for which keys are formatted as scene['body']['mass']; by default they are formatted as in a
            file, body.mass.
    """
    problems = error.errors(include_url=False)
    # A key that takes a word or something else is reported once for each; for a value that is not a word, the word's problem is irrelevant.
    relevant = [problem for problem in problems if problem["type"] != "literal_error" or isinstance(problem["input"], str)]
    # An unknown key comes first: if it is misspelt, the key that is meant is missing, which is the same problem.
    unknown = [problem for problem in problems if problem["type"] == "extra_forbidden"]
    return _described(kind, (unknown or relevant or problems)[0], alternatives or {}, root)


def shown(value: Any) -> str:
    """A value in at most 60 characters."""
    try:
        text = " ".join(repr(value).split())
    except (ValueError, RecursionError):  # thousands of digits, or of lists within each other
        return f"a {type(value).__name__} too large to be shown"
    return text if len(text) <= 60 else text[:57] + "..."


def key_of(path: Sequence[str | int], root: str = "") -> str:
    """A key of a file, such as body.mass, or, with a root, that of a mapping, such as scene['body']['mass']."""
    if root:
        return root + "".join(f"[{part!r}]" for part in path)
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path).lstrip(".")


def _described(kind: type[BaseModel], problem: Problem, alternatives: Alternatives, root: str) -> str:
    """One problem as 'key: got value; what is allowed.'."""
    path, table = _located(kind, problem)
    key = key_of(path, root)
    prefix = f"{key}: " if key else ""
    value = shown(problem["input"])
    match problem["type"]:
        case "extra_forbidden":
            allowed = _keys(table, root)
            return f"{prefix}unknown key. Allowed: {', '.join(allowed)}.{did_you_mean(str(path[-1]), allowed)}"
        case "missing":
            return f"{prefix}missing; it has no default."
        case "union_tag_not_found" | "union_tag_invalid" as fault:
            name = problem["ctx"]["discriminator"].strip("'")
            field = next(part for part in reversed(path) if isinstance(part, str))
            tags = ", ".join(map(repr, _tagged(table, field, name)))
            got = "missing" if fault == "union_tag_not_found" else f"got {shown(problem['input'][name])}"
            return f"{key_of([*path, name], root)}: {got}; must be one of {tags}."
        case "value_error" if isinstance(problem["input"], dict):  # of a whole table: the text names keys and values
            named = NAMED_KEY.fullmatch(str(problem["ctx"]["error"])) if not path else None
            return f"{prefix}{problem['ctx']['error']}." if named is None else f"{key_of(named[1].split('.'), root)}: {named[2]}."
        case "value_error":
            return f"{prefix}got {value}; {problem['ctx']['error']}."
        case "too_short" | "too_long" as fault:
            bound, count = problem["ctx"]["min_length" if fault == "too_short" else "max_length"], problem["ctx"]["actual_length"]
            return f"{prefix}got {value}; must have at {'least' if fault == 'too_short' else 'most'} {_items(bound)}, has {count}."
        case "tuple_type" if isinstance(problem["input"], dict) and not root:
            return f"{prefix}got {value}; must be a list of tables, each of which begins with [[{key}]]."
        case "model_type" | "model_attributes_type":
            example = f", such as [{key}] with its keys below" if key and not root else ""
            return f"{prefix}got {value}; must be a {'mapping' if root else 'table'}{example}."
    message = re.sub("a (tuple|array)", "a list", problem["msg"].replace("Input should", "must").replace("valid ", ""))
    message = message.replace(f"{Decimal(repr(LARGEST)):f}", f"{LARGEST:g}")  # pydantic writes all of its zeros
    dotted = ".".join(part for part in path if isinstance(part, str))
    return f"{prefix}got {value}; {message}{alternatives.get((dotted, problem['type']), alternatives.get((dotted, '*'), ''))}."


def _items(count: int) -> str:
    return f"{count} item{'' if count == 1 else 's'}"


def _keys(table: type[BaseModel], root: str) -> list[str]:
    """The keys that a table may have."""
    return [field.alias or name for name, field in table.model_fields.items() if not _is_hidden(field, root)]


def _is_hidden(field: Any, root: str) -> bool:
    """Whether a field of a model is not a key of its file, or neither a key of its file nor of its mapping."""
    hidden = (field.json_schema_extra or {}).get("hidden")
    return hidden == "always" or (hidden == "in files" and not root)


def _located(kind: type[BaseModel], problem: Problem) -> tuple[list[str | int], type[BaseModel]]:
    """The keys and indices of a problem as in a file, and the model of the innermost table.

    Pydantic's location also names the member of a union that it tried; a file has no such key.
    """
    path: list[str | int] = []
    table = kind
    members: dict[str, type[BaseModel]] = {}
    location = problem["loc"]
    unknown = len(location) - 1 if problem["type"] == "extra_forbidden" else -1  # a key of the file, which may have any name
    for number, part in enumerate(location):
        if isinstance(part, str) and part in members and number != unknown:
            table, members = members[part], {}
        elif isinstance(part, int) or number == unknown or not _is_union_member(part):
            path.append(part)
            if isinstance(part, str) and part in table.model_fields:
                field = table.model_fields[part]
                members = _tagged(table, part, field.discriminator) if isinstance(field.discriminator, str) else {}
                inner = list(_models_in(field.annotation))
                table = inner[0] if len(inner) == 1 else table
    return path, table


def _is_union_member(part: str) -> bool:
    return "[" in part or part.startswith("constrained-") or part in ("float", "int")


def _tagged(table: type[BaseModel], key: str, discriminator: str) -> dict[str, type[BaseModel]]:
    """The models of a tagged union, or of a list of one, by tag."""
    models = _models_in(table.model_fields[key].annotation)
    return {tag: model for model in models for tag in get_args(model.model_fields[discriminator].annotation)}


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """The models that an annotation contains."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models_in(argument)
