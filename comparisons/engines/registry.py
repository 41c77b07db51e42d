"""Engines by name: `mujoco`, `mujoco[integrator=rk4]`."""

import re
from importlib import import_module
from importlib.util import find_spec
from typing import NamedTuple

from comparisons.engines.base import Engine, EngineMissing
from scenarios.errors import DropspinError, UnknownName


class _Home(NamedTuple):
    """Where an engine's adapter is, and what it needs installed."""

    module: str
    adapter: str
    package: str = ""
    how_to_install: str = ""


BUILT_IN = {
    "document": _Home("comparisons.engines.document", "Document"),
    "mujoco": _Home("comparisons.engines.mujoco_engine", "MuJoCo", "mujoco", "pip install mujoco"),
    "pybullet": _Home(
        "comparisons.engines.pybullet_engine",
        "PyBullet",
        "pybullet",
        "pip install pybullet (it has wheels for CPython 3.10 and 3.11 on Linux x86-64; elsewhere it needs a compiler)",
    ),
}


def engine_names() -> list[str]:
    """The engines that can be named, installed or not."""
    return list(BUILT_IN)


def engine(name: str) -> Engine:
    """The engine of a name with options, such as `mujoco[integrator=rk4]`.

    Raises:
        UnknownName: There is no such engine, option or value.
        EngineMissing: Its package is not installed; the text says how to get it.
    """
    match = re.fullmatch(r"\s*([\w.:-]+)\s*(?:\[(.*)\])?\s*", name)
    if match is None:
        raise DropspinError(f"engine {name!r}: write a name, or a name with options, such as mujoco[integrator=rk4].")
    base, listed = match.group(1), match.group(2) or ""
    if base not in BUILT_IN:
        raise UnknownName("engine", base, BUILT_IN)
    home = BUILT_IN[base]
    # Before the adapter, which imports its engine.
    if home.package and find_spec(home.package) is None:
        raise EngineMissing(f"{base} is not installed: {home.how_to_install}.")
    created: Engine = getattr(import_module(home.module), home.adapter)(_options(name, listed))
    return created


def _options(name: str, listed: str) -> dict[str, str]:
    options: dict[str, str] = {}
    for item in filter(None, (part.strip() for part in listed.split(","))):
        key, equals, value = (part.strip() for part in item.partition("="))
        if not (key and equals and value):
            raise DropspinError(f"engine {name!r}: {item!r} is not option=value.")
        if key in options:
            raise DropspinError(f"engine {name!r}: {key} is given twice; give each option once.")
        options[key] = value
    return options
