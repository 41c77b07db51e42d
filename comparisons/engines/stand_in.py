"""Stand-ins: what is known of a custom engine outside its process, where its code is not imported.

The adapter's module is imported, and the engine constructed, in the engine's own process only. There `traits` describes it; elsewhere a
stand-in has its name, its options and their values, and can be configured, but not run.
"""

from typing import Annotated, Any, ClassVar, NoReturn

from pydantic import BaseModel, ConfigDict, Field

from dropspin.comparisons.engines.adapter_code import adapter_code
from dropspin.comparisons.engines.base import Engine, EngineBroken
from dropspin.comparisons.engines.options import NumericOption
from dropspin.comparisons.engines.settings import Setting
from dropspin.scenarios import DropspinError, Scenario
from dropspin.scenarios.text import Text
from dropspin.scenarios.validation import validated

LONGEST_SUMMARY = 500
STATED = ("name", "choices", "numbers", "settings", "accuracy", "compiles")
"""Attributes of a class that a stand-in has too."""
Short = Annotated[Text, Field(max_length=100)]


class Traits(BaseModel):
    """What an engine's class states, as plain data.

    Attributes:
        source: What the engine is asked for by: module:Class, or a registered name.
        name: The name of its label.
        summary: The first line of its docstring.
        choices: Each option's values, the default first.
        numbers: Each numeric option's default and range.
        settings: The settings of its library that can be given.
        accuracy: The values of options that set the accuracy.
        options: The options that were given and differ from the defaults.
        compiles: Whether it compiles when a scene is first simulated.
        code: A hash of the adapter's code: of every module that it loads, outside the standard library and installed packages, and of
            libraries and scripts below its folder.
        modules: The same without what an engine may build when it is first used.
    """

    model_config = ConfigDict(strict=True, frozen=True)

    source: str
    name: Short
    summary: Annotated[Text, Field(max_length=LONGEST_SUMMARY)]
    choices: dict[Short, tuple[Short, ...]]
    numbers: dict[Short, NumericOption]
    settings: dict[Short, Setting]
    accuracy: dict[Short, tuple[Short | float, ...]]
    options: dict[Short, Short]
    compiles: bool
    code: str | None
    modules: str | None


class StandIn(Engine):
    """A custom engine, outside its process."""

    traits: ClassVar[Traits]

    def prepare(self, scene: Scenario, dt: float) -> NoReturn:
        raise NotImplementedError(f"{self.label} is simulated in its own process only")

    def __reduce__(self) -> tuple[Any, ...]:
        return stand_in, (self.traits.model_copy(update={"options": dict(self.options)}),)


def traits(source: str, engine: Engine, loaded: frozenset[str]) -> Traits:
    """Describe an engine; called in its process.

    Args:
        source: What it was asked for by, without options.
        engine: The engine.
        loaded: Names of the modules that its import loaded.

    Raises:
        EngineBroken: What it states of itself is not of the types that the protocol has.
    """
    kind = type(engine)
    summary = (kind.__doc__ or "").strip().partition("\n")[0][:LONGEST_SUMMARY]
    stated = {"source": source, "summary": summary, "options": _plain(engine.options)}
    stated |= {"code": adapter_code(kind, loaded), "modules": adapter_code(kind, loaded, with_below=False)}
    stated |= {name: _plain(getattr(kind, name)) for name in STATED}
    try:
        found = validated(Traits, source, stated)
    except DropspinError as error:
        raise EngineBroken(f"{source} cannot be used: {error}") from None
    label = stand_in(found).label
    if engine.label != label:
        raise EngineBroken(f"{source} cannot be used: its label is {engine.label!r:.100}; it must be {label!r}, of its name and options.")
    return found


def _plain(mapping: Any) -> Any:
    """A mapping as a dict of tuples, which is what the class should state; anything else is left for validation to refuse."""
    if not hasattr(mapping, "items"):
        return mapping
    return {key: tuple(value) if type(value) is list else value for key, value in mapping.items()}


def code_of(engine: Engine) -> str | None:
    """The hash of an engine's code; None for a class that is not in a file."""
    return engine.traits.code if isinstance(engine, StandIn) else adapter_code(type(engine))


def stand_in(known: Traits) -> StandIn:
    """The stand-in of an engine."""
    members = {"traits": known} | {name: getattr(known, name) for name in STATED}
    kind: type[StandIn] = type("StandIn", (StandIn,), members)
    return kind(known.options)
