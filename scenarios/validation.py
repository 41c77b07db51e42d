"""From tables of files to models, with one line for what is wrong."""

from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from scenarios import DropspinError

Kind = TypeVar("Kind", bound=BaseModel)


def validated(kind: type[Kind], where: str, content: Any) -> Kind:
    """A table of a file as a model.

    Args:
        kind: The model; what it allows is what is allowed.
        where: The file, and the table in it.
        content: The table.

    Raises:
        DropspinError: It is none; the text says where, what was given, what is allowed.
    """
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        location = [part for part in problem["loc"] if isinstance(part, int) or part.isidentifier()]
        key = "".join(f"[{part}]" if isinstance(part, int) else f": {part}" for part in location)
        if problem["type"] == "extra_forbidden":
            allowed = [field.alias or name for name, field in kind.model_fields.items()]
            raise DropspinError(f"{where}{key}: unknown key. Allowed: {', '.join(allowed)}.") from None
        if problem["type"] == "missing":
            raise DropspinError(f"{where}{key}: missing; it has no default.") from None
        said = str(problem["ctx"]["error"]) if problem["type"] == "value_error" else problem["msg"].replace("Input should", "must")
        given = " ".join(repr(problem["input"]).split())
        raise DropspinError(f"{where}{key}: got {given if len(given) <= 60 else given[:57] + '...'}; {said}.") from None
