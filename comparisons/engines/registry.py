"""Engines by name: `mujoco`, `mujoco[integrator=rk4]`."""

import re
from importlib import import_module
from importlib.util import find_spec

from comparisons.engines.base import Engine, EngineMissing
from scenarios.errors import DropspinError, UnknownName

BUILT_IN = {
    "document": "comparisons.engines.document:Document",
    "mujoco": "comparisons.engines.mujoco_engine:MuJoCo",
    "pybullet": "comparisons.engines.pybullet_engine:PyBullet",
}
INSTALL_HINTS = {
    "mujoco": "pip install mujoco",
    "pybullet": "pip install pybullet (it has wheels for CPython 3.10 and 3.11 on Linux x86-64; elsewhere it needs a compiler)",
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
    module, kind = BUILT_IN[base].split(":")
    created: Engine = getattr(import_module(module), kind)(_options(name, listed))
    if created.package and find_spec(created.package) is None:
        raise EngineMissing(f"{created.label} is not installed: {INSTALL_HINTS[created.package]}.")
    return created


def _options(name: str, listed: str) -> dict[str, str]:
    options: dict[str, str] = {}
    for item in filter(None, (part.strip() for part in listed.split(","))):
        key, equals, value = (part.strip() for part in item.partition("="))
        if not (key and equals and value):
            raise DropspinError(f"engine {name!r}: {item!r} is not option=value.")
        options[key] = value
    return options
