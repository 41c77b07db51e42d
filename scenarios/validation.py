"""From the tables of a file to pydantic models; an error becomes one line that says where, what was given and what is allowed."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from scenarios.errors import DropspinError, did_you_mean

Kind = TypeVar("Kind", bound=BaseModel)
Problem = Mapping[str, Any]
Alternatives = Mapping[tuple[str, str], str]
"""Words for the other values that a key takes, by key and pydantic's type of error: pydantic reports each alternative alone."""

NAMED_KEY = re.compile(r"([a-z_.]+): (.*)")
"""A problem of several tables together: the key that it names, and the text."""


def validated(kind: type[Kind], where: str, content: Any) -> Kind:
    """A table of a file as a model.

    Args:
        kind: The model.
        where: The file, and the table in it.
        content: The table.

    Raises:
        DropspinError: The table is not valid; the text says where, what was given, what is allowed.
    """
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        raise DropspinError(f"{where}: {first_problem(kind, error)}") from None


def first_problem(kind: type[BaseModel], error: ValidationError, alternatives: Alternatives | None = None, root: str = "") -> str:
    """The first problem of a table as 'key: got value; what is allowed.', and how many other keys have problems.

    Args:
        kind: The model.
        error: Pydantic's error.
        alternatives: Words for the other values that keys take.
        root: For a mapping in Python its name: keys are then given as scene['body']['mass']; by default as body.mass, as in a file.
    """
    problems = error.errors(include_url=False)
    # A key that takes a word or something else is reported once for each; for a value that is not a word, the word's problem is irrelevant.
    relevant = [problem for problem in problems if problem["type"] != "literal_error" or isinstance(problem["input"], str)]
    others = len({tuple(_located(kind, problem["loc"])[0][:2]) for problem in problems}) - 1
    more = f" (and {others} more {'problem' if others == 1 else 'problems'})" if others else ""
    return f"{_described(kind, (relevant or problems)[0], alternatives or {}, root)}{more}"


def shown(value: Any) -> str:
    """A value in at most 60 characters."""
    try:
        text = " ".join(repr(value).split())
    except (ValueError, RecursionError):  # thousands of digits, or of lists within each other
        return f"a {type(value).__name__} too large to be shown"
    return text if len(text) <= 60 else text[:57] + "..."


def _key(path: Sequence[str | int], root: str) -> str:
    """A key of a file, such as body.mass; with a root that of a mapping, such as scene['body']['mass']."""
    if root:
        return root + "".join(f"[{part!r}]" for part in path)
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path).lstrip(".")


def _described(kind: type[BaseModel], problem: Problem, alternatives: Alternatives, root: str) -> str:
    """One problem as 'key: got value; what is allowed.'."""
    path, table = _located(kind, problem["loc"])
    key = _key(path, root)
    prefix = f"{key}: " if key else ""
    given = shown(problem["input"])
    match problem["type"]:
        case "extra_forbidden":
            allowed = [field.alias or name for name, field in table.model_fields.items() if not _is_hidden(field, root)]
            return f"{prefix}unknown key. Allowed: {', '.join(allowed)}.{did_you_mean(str(path[-1]), allowed)}"
        case "missing":
            return f"{prefix}missing; it has no default."
        case "union_tag_not_found" | "union_tag_invalid" as fault:
            name, tags = problem["ctx"]["discriminator"].strip("'"), ", ".join(map(repr, _tagged(table, path[-1])))
            found = "missing" if fault == "union_tag_not_found" else f"got {shown(problem['input'][name])}"
            return f"{_key([*path, name], root)}: {found}; must be one of {tags}."
        case "value_error" if isinstance(problem["input"], dict):  # of a whole table: the text names keys and values
            named = NAMED_KEY.fullmatch(str(problem["ctx"]["error"])) if not path else None
            return f"{prefix}{problem['ctx']['error']}." if named is None else f"{_key(named[1].split('.'), root)}: {named[2]}."
        case "value_error":
            return f"{prefix}got {given}; {problem['ctx']['error']}."
        case "too_short" | "too_long" as fault:
            bound, count = problem["ctx"]["min_length" if fault == "too_short" else "max_length"], problem["ctx"]["actual_length"]
            return f"{prefix}got {given}; must have at {'least' if fault == 'too_short' else 'most'} {_items(bound)}, has {count}."
        case "model_type" | "model_attributes_type":
            return f"{prefix}got {given}; must be a {'mapping' if root else f'table, such as [{key}] with its keys below'}."
    dotted, message = _key(path, ""), problem["msg"].replace("Input should", "must").replace("valid ", "").replace("a tuple", "a list")
    return f"{prefix}got {given}; {message}{alternatives.get((dotted, problem['type']), alternatives.get((dotted, '*'), ''))}."


def _items(count: int) -> str:
    return f"{count} item{'' if count == 1 else 's'}"


def _is_hidden(field: Any, root: str) -> bool:
    """Whether a field of a model is not a key of its file, or not of its mapping either."""
    hidden = (field.json_schema_extra or {}).get("hidden")
    return hidden == "always" or (hidden == "in files" and not root)


def _located(kind: type[BaseModel], location: tuple[Any, ...]) -> tuple[list[str | int], type[BaseModel]]:
    """The keys and indices of a problem as a file has them, and the model of the last table on the way.

    Pydantic's location also names the member of a union that it tried; a file has no such key.
    """
    path: list[str | int] = []
    table = kind
    members: dict[str, type[BaseModel]] = {}
    for part in location:
        if isinstance(part, str) and part in members:
            table, members = members[part], {}
        elif isinstance(part, int) or not _is_union_member(part):
            path.append(part)
            if isinstance(part, str) and part in table.model_fields:
                members = _tagged(table, part)
                inner = list(_models_in(table.model_fields[part].annotation))
                table = inner[0] if len(inner) == 1 else table
    return path, table


def _is_union_member(part: str) -> bool:
    return "[" in part or part.startswith("constrained-") or part in ("float", "int")


def _tagged(table: type[BaseModel], name: Any) -> dict[str, type[BaseModel]]:
    """The models of a field that is a tagged union, by tag; empty for other fields."""
    field = table.model_fields.get(name)
    if field is None or not isinstance(field.discriminator, str):
        return {}
    models = _models_in(field.annotation)
    return {tag: model for model in models for tag in get_args(model.model_fields[field.discriminator].annotation)}


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """The models that an annotation contains."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models_in(argument)
