"""From the names of engines to entries of a run: a custom engine is imported and constructed only in its own process."""

import sys
from collections.abc import Iterable, Sequence

from dropspin.comparisons.engines.base import Engine, EngineBroken, EngineMissing
from dropspin.comparisons.engines.registry import engine as engine_named
from dropspin.comparisons.engines.registry import is_foreign, parsed, verify_name
from dropspin.comparisons.engines.stand_in import Traits, stand_in, traits
from dropspin.comparisons.running.arguments import EngineEntry, described_value, several
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.process_limits import ONE_MINUTE, ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.scenarios import DropspinError


def engine_entry(engine: Engine | str, resources: ResourceLimits = ONE_MINUTE) -> EngineEntry:
    """An engine by its name, or an engine object, as an entry of a run.

    Args:
        engine: The engine or its name.
        resources: What the import and the construction of a custom engine may use.

    Raises:
        DropspinError: There is no engine of that name, or it is neither an engine nor a name.
    """
    try:
        return present_entry(engine, resources)
    except (EngineMissing, EngineBroken) as error:
        return EngineEntry(str(engine).strip(), None, "missing" if isinstance(error, EngineMissing) else "broken", str(error))


def engine_entries(
    engines: Engine | str | Iterable[Engine | str], default: Sequence[str] = (), resources: ResourceLimits = ONE_MINUTE
) -> list[EngineEntry]:
    """One engine or several, or default ones if none is given.

    Raises:
        DropspinError: Two engines have the same name.
    """
    asked = several("engines", engines) or list(default)
    entries = [engine_entry(one, resources) for one in asked]
    given: dict[str, str] = {}
    for entry, one in zip(entries, asked, strict=True):
        words = one if isinstance(one, str) else f"{type(one).__module__}:{type(one).__qualname__}"
        if entry.label in given:
            both = f"{given[entry.label]} and {words} both have the name {entry.label}"
            raise DropspinError(f"engines: {both}; name one of them, or give one another name.")
        given[entry.label] = words
    return entries


def present_entry(engine: Engine | str, resources: ResourceLimits = ONE_MINUTE) -> EngineEntry:
    """An engine by its name, or an engine object, that can run.

    Raises:
        EngineMissing: A package that it needs is not installed.
        EngineBroken: It cannot be imported or constructed.
        DropspinError: There is no engine of that name, or it is neither an engine nor a name.
    """
    if isinstance(engine, Engine):
        verify_name(getattr(engine, "name", ""), type(engine), f"engine: {type(engine).__qualname__}")
        return EngineEntry(engine.label, engine)
    if not isinstance(engine, str):
        raise DropspinError(f"engine: got {described_value(engine)}; give a name such as 'mujoco', or an Engine.")
    name = engine.strip()
    found = _stand_in(name, resources) if is_foreign(parsed(name)[0]) else engine_named(name)
    return EngineEntry(found.label, found)


def _stand_in(name: str, resources: ResourceLimits) -> Engine:
    """The stand-in of a custom engine, described in a process of its own."""
    with EngineProcesses(resources) as processes:
        found = processes.call(EngineEntry(name, None), _describe, name)
    if isinstance(found, Breakdown):
        raise EngineBroken(f"{name} cannot be used: its import or construction failed: {found.reason}.")
    if isinstance(found, DropspinError):
        raise found
    return stand_in(found)


def _describe(entry: EngineEntry, name: str) -> Traits | DropspinError:
    """In a process of its own: what an engine states of itself, or why it cannot take part."""
    before = frozenset(sys.modules)
    try:
        return traits(parsed(name)[0], engine_named(name), frozenset(sys.modules) - before)
    except DropspinError as error:  # of a type that may need more than a text
        return (type(error) if isinstance(error, EngineMissing | EngineBroken) else DropspinError)(str(error))
