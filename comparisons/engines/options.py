"""An engine's name, its options with their values, and the label that they make, such as `mujoco[integrator=rk4]`."""

import math
import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

from dropspin.comparisons.measuring.symmetries import REPRESENTED
from dropspin.scenarios.errors import DropspinError, verify_known
from dropspin.scenarios.validation import shown

FEWEST_VALUES = 3
"""Values of an option that sets the accuracy: extrapolation needs as many."""


class NumericOption(NamedTuple):
    """The default and the range of a numeric option.

    Attributes:
        default: The value if the option is not given.
        least: The smallest allowed value.
        most: The largest allowed value.
    """

    default: float
    least: float
    most: float


Value = bool | int | float | str | tuple[float, ...]
"""The value of a setting."""
SWITCH = {"false": 0, "no": 0, "off": 0, "disable": 0, "0": 0, "true": 1, "yes": 1, "on": 1, "enable": 1, "1": 1}
"""What may be written for off and for on, in small letters."""
ELSEWHERE = {
    "the time step of the run; give it with --dt": ("dt", "timestep", "fixedTimeStep"),
    "the scene's: change the table gravity": ("gravity",),
    "the scene's: change the table body": ("mass", "inertia", "localInertiaDiagonal"),
    "the scene's: change the table damping": ("damping", "dof_damping"),
}
"""What is no option of an engine because it is given elsewhere."""


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


@dataclass(frozen=True)
class Configured:
    """The name and the options of an engine.

    Attributes:
        options: The options that differ from the defaults.
    """

    options: Mapping[str, str] = field(default_factory=dict)

    name: ClassVar[str]
    choices: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    """The allowed values of each option, with the default first."""
    numbers: ClassVar[Mapping[str, NumericOption]] = {}
    """The default and the range of each numeric option."""
    settings: ClassVar[Mapping[str, Setting]] = {}
    """The settings of the engine's library that can be given as options, by their documented names."""
    accuracy: ClassVar[Mapping[str, tuple[float | str, ...]]] = {}
    """Options that set the accuracy besides the time step, with three or more values, least accurate first: {"rtol": (1e-4, 1e-6, 1e-8)}.

    If an error does not vanish as dt → 0, `run` refines these options together with the time step.
    """
    representations: ClassVar[tuple[str, ...]] = ()
    """Names of `choices` on which the motion does not depend: they represent the same scene in different ways, such as a box as a mesh, or
    add a body that is far away.

    `symmetries` compares the motions.
    """

    def __post_init__(self) -> None:
        names = {_bare(name): name for name in self._known}
        chosen = [(names.get(_bare(option), option), value) for option, value in self.options.items()]
        options = {option: self._canonical(option, value) for option, value in sorted(chosen)}
        if len(options) < len(chosen):
            raise DropspinError(f"{self.name}: an option is given twice; give each of {', '.join(options)} once.")
        object.__setattr__(
            self, "options", {name: text for name, text in options.items() if name in self.settings or text != self._default(name)}
        )
        for setting in self.given:
            if (unmet := self.unmet_need(setting)) is not None:
                other, *needed = unmet
                actual, wanted = f"{other}={self.option(other)}", " or ".join(f"{other}={value}" for value in needed)
                raise DropspinError(f"engine {self.label!r}: {setting} has no effect with {actual}; it needs {wanted}.")
        verify_known(f"{self.name}'s representation", self.representations, self.choices)
        for option, values in self.accuracy.items():
            verify_known(f"{self.name}'s accuracy option", [option], self._known)
            if len(set(values)) < FEWEST_VALUES:
                raise DropspinError(
                    f"{self.name}.accuracy[{option!r}]: got {shown(values)}; give at least {FEWEST_VALUES} values, coarsest first."
                )

    def _canonical(self, option: str, value: str) -> str:
        """An option's value in its canonical spelling, so that equal options have equal labels."""
        for why, names in ELSEWHERE.items():
            if option not in self._known and _bare(option) in map(_bare, names):
                raise DropspinError(f"{self.name}'s {option} is {why}.")
        if option == "profile" and option not in self.choices:
            raise DropspinError(f"{self.name} has no profiles; dropspin show SCENE -e {self.name} prints the settings that it always has.")
        verify_known(f"{self.name}'s option", [option], self._known)
        if option in self.settings:
            setting = self.settings[option]
            parsed = setting.parsed(value)
            if parsed is None:
                raise DropspinError(
                    f"{self.name}'s {option}: got {value!r}; it is {setting.allowed}, by default {spelled(setting.default)}."
                )
            return spelled(parsed)
        if option not in self.numbers:
            verify_known(f"{self.name}'s {option}", [value], self.choices[option])
            return value
        allowed = self.numbers[option]
        try:
            number = float(value)
        except ValueError:
            number = float("nan")
        if not allowed.least <= number <= allowed.most:
            raise DropspinError(f"{self.name}'s {option}: got {value!r}; it is a number from {allowed.least:g} to {allowed.most:g}.")
        return spelled(number)

    @property
    def _known(self) -> list[str]:
        return [*self.choices, *self.numbers, *self.settings]

    def _default(self, option: str) -> str:
        """An option's value where it is not given; of a setting, where it is not computed either."""
        if option in self.settings:
            default, _, calibrated, *_ = self.settings[option]
            return spelled(default if self.is_default or calibrated is None else calibrated)
        return spelled(self.numbers[option].default) if option in self.numbers else self.choices[option][0]

    def option(self, name: str) -> str:
        """The value of an option, which is the default if the option was not given."""
        return self.options.get(name, self._default(name))

    @property
    def options_in_force(self) -> dict[str, str]:
        """The value of each option in `choices`."""
        return {name: self.option(name) for name in self.choices}

    @property
    def given(self) -> dict[str, Any]:
        """The values of the settings that were given explicitly."""
        return {name: self.settings[name].parsed(text) for name, text in self.options.items() if name in self.settings}

    def given_of(self, kind: Collection[str]) -> dict[str, Any]:
        """The values of the settings of a kind that were given explicitly."""
        return {name: value for name, value in self.given.items() if name in kind}

    def unmet_need(self, setting: str) -> tuple[str, ...] | None:
        """An option and the values with which a setting would have an effect; None if the setting has an effect."""
        return next((need for need in self.settings[setting].needs if self.option(need[0]) not in need[1:]), None)

    @property
    def is_default(self) -> bool:
        """Whether the engine has its own default settings (`profile=default`)."""
        return self.options.get("profile") == "default"

    @property
    def is_calibrated(self) -> bool:
        """Whether all settings have their calibrated values."""
        return not self.is_default and not self.given

    @property
    def calibrated(self) -> Self:
        """The same engine with calibrated settings; its other options stay."""
        return self.without(["profile", *self.settings])

    def without(self, names: Collection[str]) -> Self:
        """The same engine without some of its options, and without settings that then have no effect."""
        left = {name: text for name, text in self.options.items() if name not in names}
        needs = {name: self.settings[name].needs for name in left if name in self.settings}
        acting = {name for name in needs if all(left.get(option, self._default(option)) in values for option, *values in needs[name])}
        return replace(self, options={name: text for name, text in left.items() if name not in needs or name in acting})

    @property
    def label(self) -> str:
        """The name with sorted options, `name[option=value,…]`; options with their default value are left out."""
        listed = ",".join(f"{key}={value}" for key, value in self.options.items())
        return f"{self.name}[{listed}]" if listed else self.name

    def _with(self, options: Mapping[str, str]) -> Self:
        return replace(self, options={**self.options, **options})

    def accuracy_levels(self) -> list[Self]:
        """The engine with each set of values of its accuracy options, least accurate first; empty if it has no such options."""
        count = min(map(len, self.accuracy.values()), default=0)
        finest = {option: values[-count:] for option, values in self.accuracy.items()}
        return [self._with({option: spelled(values[level]) for option, values in finest.items()}) for level in range(count)]

    def refined(self, dts: Sequence[float]) -> list[tuple[float, Self]]:
        """The smallest given time steps [s], one for each accuracy level, in descending order, each with the engine at this level."""
        levels = self.accuracy_levels()
        count = min(len(dts), len(levels))
        return list(zip(sorted(dts)[:count][::-1], levels[-count:], strict=True))

    def represented_otherwise(self) -> dict[str, Self]:
        """By a text such as `with body=mesh`, the engine with each other value of each option in `representations`."""
        return {
            f"{REPRESENTED}{option}={value}": self._with({option: value})
            for option in self.representations
            for value in self.choices[option]
            if value != self.option(option)
        }


def _bare(name: str) -> str:
    """The name of an option without underscores, in small letters: `linear_damping` is `linearDamping`."""
    return name.replace("_", "").lower()


def spelled(value: Value | Sequence[float]) -> str:
    """An option's value as text: a number with six digits if these are exact, else with all; several with spaces between them."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Sequence):
        return " ".join(map(spelled, value))
    return f"{value:g}" if float(f"{value:g}") == value else repr(float(value))


def parts_of(label: str) -> tuple[str, list[str]]:
    """The name of an engine and its options, such as `integrator=rk4`, in the order of its label."""
    name, _, listed = label.removesuffix("]").partition("[")
    return name, listed.split(",") if listed else []


def engine_name(label: str) -> str:
    """The name of an engine without the options in its label."""
    return parts_of(label)[0]


def calibrated_label(label: str) -> str | None:
    """The label of the calibrated profile of an engine whose label has profile=default; None for any other label."""
    name, options = parts_of(label)
    if "profile=default" not in options:
        return None
    left = ",".join(option for option in options if option != "profile=default")
    return f"{name}[{left}]" if left else name
