"""Engines by name: built in, such as `mujoco[integrator=rk4]`; registered by another package; or a class, `my_module:MyEngine`."""

import re
import sys
import tomllib
from collections.abc import Mapping
from contextlib import redirect_stdout, suppress
from importlib import import_module
from importlib.metadata import EntryPoint, PackageNotFoundError, entry_points
from importlib.util import find_spec
from operator import attrgetter
from pathlib import Path
from shutil import which
from typing import NamedTuple

from dropspin.comparisons.engines.base import Engine, EngineBroken, EngineMissing
from dropspin.comparisons.engines.exceptions import described
from dropspin.comparisons.engines.packages import install_extra, is_npm, npm_package
from dropspin.scenarios.errors import DropspinError, UnknownName
from dropspin.scenarios.model import EARLIER_NAMES
from dropspin.scenarios.validation import shown


class _Home(NamedTuple):
    """The module and class of an engine's adapter, the package that it needs, the command that installs it, and more about that.

    Without a command, the extra of dropspin that has the engine's name installs it.
    """

    module: str
    adapter: str
    package: str = ""
    command: str = ""
    note: str = ""


GROUP = "dropspin.engines"
"""The entry-point group in which other packages register engines: name = "module:Class"."""
NO_NODE = "it runs in Node.js, and there is no node on PATH"
_TABLES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
BUILT_IN = {name: _Home(**home) for name, home in _TABLES["engines"].items()}
CURES: dict[str, str] = _TABLES["cures"]
"""By what the import of a package says: what to do."""
DISTRIBUTIONS: list[str] = _TABLES["distributions"]
"""The distributions of engines, whose versions a run records."""
MOVED = frozenset({"scenarios", "reference_impl", "comparisons", "reports"})
"""Packages of earlier versions that are parts of `dropspin` now."""


def engine_names() -> list[str]:
    """The names of all engines, installed or not.

    Returns:
        The names of the built-in engines, then of those that other packages register.
    """
    return [*BUILT_IN, *sorted(_entry_points())]


def engine(name: str) -> Engine:
    """The engine with a name and options, such as `mujoco[integrator=rk4]`, or of a class, such as `my_module:MyEngine`.

    Args:
        name: The name. `dropspin list engines` lists the engines, and `dropspin show NAME` the options of an engine.

    Returns:
        The engine, with its options.

    Raises:
        UnknownName: There is no such engine, option or value.
        EngineMissing: A package that the engine needs is not installed; the message says how to install it.
        EngineBroken: The engine cannot be imported or constructed.
        DropspinError: The class is not an engine.
    """
    base, options = parsed(name)
    return constructed(base, options)


def parsed(name: str) -> tuple[str, dict[str, str]]:
    """The name of an engine without its options, and the options."""
    if not isinstance(name, str):
        raise DropspinError(f"engine: got {name!r} ({type(name).__name__}); give a name such as 'mujoco'.")
    match = re.fullmatch(r"\s*([\w.:-]+)\s*(?:\[(.*)\])?\s*", name)
    if match is None:
        raise DropspinError(f"engine {name!r}: write a name, or a name with options, such as mujoco[integrator=rk4].")
    return EARLIER_NAMES.get(match.group(1), match.group(1)), _options(name, match.group(2) or "")


def constructed(base: str, options: Mapping[str, str]) -> Engine:
    """The engine of a name without options, with options; errors are those of `engine`."""
    adapter = _adapter(base)
    try:
        return adapter(options)
    except DropspinError:
        raise
    except (Exception, SystemExit) as error:
        raise EngineBroken(f"{base} cannot be constructed: {described(error)}.") from error


def is_foreign(base: str) -> bool:
    """Whether the code of an engine is not dropspin's: a class, or an engine of another package."""
    return ":" in base or (base not in BUILT_IN and base in _entry_points())  # which takes 7 ms to read


def _adapter(base: str) -> type[Engine]:
    """The class of an engine's name."""
    if ":" in base:
        module, _, attribute = base.partition(":")
        return _imported(base, module, attribute)
    if base not in BUILT_IN:
        brought = _entry_points()
        if base not in brought:
            raise DropspinError(f"{UnknownName('engine', base, engine_names())} Name an engine of your own as my_module:MyEngine.")
        return _imported(base, brought[base].module, brought[base].attr)
    home = BUILT_IN[base]
    # Checked before the import of the adapter, which imports its engine.
    if absent := absence(base):
        raise EngineMissing(f"{base} is not installed: {absent}{'' if absent == NO_NODE else home.note}.")
    try:
        return getattr(import_module(home.module), home.adapter)
    except (Exception, SystemExit) as error:
        text = described(error)
        cure = next((f"; {cure}" for pattern, cure in CURES.items() if re.search(pattern, text)), "")
        raise EngineBroken(f"{base} is installed, but {home.package} cannot be imported: {text}{cure}.") from error


def absence(base: str) -> str:
    """What a built-in engine lacks, or the command that installs it; empty if it is installed, and for other engines."""
    home = BUILT_IN.get(base, _Home("", ""))
    if not is_npm(home.package):
        return (home.command or install_extra(base)) if home.package and find_spec(home.package) is None else ""
    if which("node") is None:
        return NO_NODE
    with suppress(PackageNotFoundError):
        npm_package(home.package)
        return ""
    return home.command


def _entry_points() -> dict[str, EntryPoint]:
    """Engines of other packages, by name; they cannot replace the built-in ones."""
    return {point.name: point for point in entry_points(group=GROUP) if point.name not in BUILT_IN}


def _imported(name: str, module_name: str, attribute: str) -> type[Engine]:
    """The engine class of a module; what the import prints goes to the standard error."""
    if not re.fullmatch(r"\w+(\.\w+)*", module_name) or not re.fullmatch(r"\w+(\.\w+)*", attribute):
        raise DropspinError(f"engine {name!r}: write my_module:MyEngine, or my_package.my_module:MyEngine.")
    try:
        with redirect_stdout(sys.stderr):
            module = import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name is not None and f"{module_name}.".startswith(f"{error.name}."):
            raise DropspinError(f"engine {name!r}: no module {module_name!r} here or on Python's path.") from None
        if error.name in MOVED:
            raise EngineBroken(f"{name} cannot be used: it imports {error.name}, which is now dropspin.{error.name}.") from None
        raise EngineMissing(f"{name} needs the module {error.name}, which is not installed.") from None
    except (Exception, SystemExit) as error:
        raise EngineBroken(f"{name} cannot be used: its module {module_name} cannot be imported: {described(error)}.") from error
    try:
        adapter = attrgetter(attribute)(module)
    except AttributeError:
        known = [key for key, value in vars(module).items() if _is_engine(value)]
        raise UnknownName(f"{module_name}'s engine", attribute, known) from None
    if not _is_engine(adapter):
        raise DropspinError(f"engine {name!r}: {attribute} is not an engine; an engine is a class that inherits from dropspin.Engine.")
    verify_name(getattr(adapter, "name", ""), adapter, f"engine {name!r}: {attribute}")
    return adapter


def verify_name(given: object, adapter: type[Engine], where: str) -> None:
    """Raise `DropspinError` if results cannot have the name of an engine of a class, or if it is that of another, built-in engine."""
    if not isinstance(given, str) or not re.fullmatch(r"[A-Za-z][\w-]*", given, re.ASCII):
        why = "give it a name for results, of letters, digits, - and _, such as 'my-engine'"
        raise DropspinError(f"{where}.name is {shown(given)}; {why}.")
    home = BUILT_IN.get(given, _Home(adapter.__module__, adapter.__name__))
    if given in EARLIER_NAMES or (adapter.__module__, adapter.__name__) != home[:2]:
        raise DropspinError(f"{where}.name is {given!r}, which is a built-in engine; results need another name.")


def _is_engine(found: object) -> bool:
    return isinstance(found, type) and issubclass(found, Engine) and found is not Engine


def _options(name: str, listed: str) -> dict[str, str]:
    options: dict[str, str] = {}
    for item in filter(None, (part.strip() for part in listed.split(","))):
        key, equals, value = (part.strip() for part in item.partition("="))
        if not (key and equals and value):
            raise DropspinError(f"engine {name!r}: {item!r} must be option=value.")
        if key in options:
            raise DropspinError(f"engine {name!r}: {key} is given twice; give each option once.")
        options[key] = value
    return options
