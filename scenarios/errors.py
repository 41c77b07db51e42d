"""Errors caused by the input; their messages can be shown to the user unchanged.

DropspinError
├── SceneError      a file or mapping that is not a valid scene
└── UnknownName     a scene, engine, option or metric that does not exist
"""

import difflib
from collections.abc import Collection, Iterable


class DropspinError(Exception):
    """Raised for invalid input. The message is one line with the place, the given value and the allowed values."""


class SceneError(DropspinError):
    """Raised if a scene cannot be loaded."""


class SceneWarning(UserWarning):
    """A scene has values that are possible, but probably not meant."""


class UnknownName(DropspinError):
    """Raised for a name that is not in the list of known names.

    Args:
        what: The kind of thing that the name denotes, such as `engine`.
        given: The name.
        known: All known names; the message suggests the most similar one.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        known = sorted(known)
        super().__init__(f"{kind} {name!r} is unknown.{did_you_mean(name, known)} Known: {', '.join(known) or 'none'}.")


def verify_known(kind: str, names: Iterable[str], known: Collection[str]) -> None:
    """Raise `UnknownName` for the first of some names that is not among the known ones; `kind` is the kind of thing that they denote."""
    for name in names:
        if name not in known:
            raise UnknownName(kind, name, known)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """' Did you mean …?' with the nearest known name, or an empty string."""
    return "".join(f" Did you mean {meant!r}?" for meant in difflib.get_close_matches(name, list(known), n=1, cutoff=0.55))
