"""A setting of an engine's library that can be given as an option, and the files that have the settings of the built-in adapters."""

import math
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from dropspin.scenarios.text import printable

Value = bool | int | float | str | tuple[float, ...]
"""The value of a setting."""
SWITCH = {"false": 0, "no": 0, "off": 0, "disable": 0, "0": 0, "true": 1, "yes": 1, "on": 1, "enable": 1, "1": 1}
"""What may be written for off and for on, in small letters."""


class Setting(NamedTuple):
    """A documented setting of an engine's library, which users change with the option of the same name.

    Attributes:
        default: The default of the library: a number (an `int` if it is an integer), several numbers, a `bool`, or one of `values`.
        what: A description in a few words.
        calibrated: The value with which dropspin makes the engine simulate scenes as specified (the calibrated value); None if it is the
            default, or computed.
        why: The reason for the calibrated value.
        unit: The unit of the value.
        least: The smallest allowed value.
        most: The largest allowed value.
        values: The allowed words; if there are two, the first means off.
        is_computed: Whether the calibrated value is computed from the scene and the time step.
        needs: Other options that must have certain values for this setting to have an effect: each with these values.
    """

    default: Value
    what: str
    calibrated: Value | None = None
    why: str = ""
    unit: str = "1"
    least: float = 0.0
    most: float = math.inf
    values: tuple[str, ...] = ()
    is_computed: bool = False
    needs: tuple[tuple[str, ...], ...] = ()

    @property
    def allowed(self) -> str:
        """The allowed values in words."""
        if isinstance(self.default, bool):
            return "one of false, true"
        if self.values:
            return f"one of {', '.join(self.values)}"
        size = len(self.default) if isinstance(self.default, tuple) else 1
        number = f"{size} numbers" if size > 1 else f"a {'whole ' * isinstance(self.default, int)}number"
        from_to = "" if self.least == -math.inf else f" from {self.least:g}" + f" to {self.most:g}" * (self.most < math.inf)
        return number + from_to

    def parsed(self, text: str) -> Value | None:
        """Convert a text, such as `0.02 1`, to the value of the setting; None if the value is not allowed."""
        switch = SWITCH.get(text.lower())
        if isinstance(self.default, bool):
            return None if switch is None else bool(switch)
        if self.values:
            word = self.values[switch] if switch is not None and len(self.values) == 2 else text
            return word if word in self.values else None
        try:
            numbers = [float(part) for part in (text if switch is None else str(switch)).split()]
        except ValueError:
            return None
        if not all(self.least <= number <= self.most and math.isfinite(number) for number in numbers):
            return None
        if isinstance(self.default, tuple):
            return tuple(numbers) if len(numbers) == len(self.default) else None
        if len(numbers) != 1 or (isinstance(self.default, int) and not numbers[0].is_integer()):
            return None
        return int(numbers[0]) if isinstance(self.default, int) else numbers[0]


def settings_beside(file: str) -> dict[str, dict[str, Setting]]:
    """The settings of the TOML file with the name of a Python file, by table; the keys of a setting are the attributes of `Setting`."""
    tables = tomllib.loads(Path(file).with_suffix(".toml").read_text(encoding="utf-8")).items()
    return {
        kind: {name: Setting(**{key: _as_tuple(value) for key, value in one.items()}) for name, one in table.items()}
        for kind, table in tables
    }


def _as_tuple(value: Any) -> Any:
    """A value of TOML, with tuples for lists."""
    return tuple(map(_as_tuple, value)) if isinstance(value, list) else value


def calibrated_values(settings: Mapping[str, Setting]) -> dict[str, Value]:
    """The values of the calibrated profile that are neither the library's own nor computed."""
    return {name: setting.calibrated for name, setting in settings.items() if setting.calibrated is not None}


def spelled(value: Value | Sequence[float]) -> str:
    """An option's value as text: a number with six digits if these are exact, else with all; several with spaces between them."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Sequence):
        return " ".join(map(spelled, value))
    return f"{value:g}" if float(f"{value:g}") == value else repr(float(value))


def as_option(reported: Any) -> str:
    """The value of a setting as a simulation reports it, in the form of an option, if it is one; else any text."""
    numbers = isinstance(reported, list) and all(isinstance(part, int | float) for part in reported)
    return printable(spelled(reported) if numbers or isinstance(reported, str | int | float) else str(reported))
