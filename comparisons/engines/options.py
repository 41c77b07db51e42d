"""An engine's name, its options with their values, and the label that they make, such as `mujoco[integrator=rk4]`."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple, Self

from dropspin.comparisons.engines.settings import SWITCH, Setting, spelled
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


ELSEWHERE = {
    "the time step of the run; give it with --dt": ("dt", "timestep", "fixedTimeStep"),
    "the scene's: change the table gravity": ("gravity",),
    "the scene's: change the table body": ("mass", "inertia", "localInertiaDiagonal"),
    "the scene's: change the table damping": ("damping", "dof_damping"),
}
"""What is no option of an engine because it is given elsewhere."""


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

    @property
    def given_numbers(self) -> set[str]:
        """The numeric options that were given, but for those that set the accuracy."""
        return set(self.options).intersection(self.numbers).difference(self.accuracy)

    def without(self, names: Collection[str]) -> Self:
        """The same engine without some of its options, and without settings that then have no effect."""
        return replace(self, options=self.acting({name: text for name, text in self.options.items() if name not in names}))

    def acting(self, options: Mapping[str, str]) -> dict[str, str]:
        """Options without the settings that have no effect beside the others."""
        needs = {name: self.settings[name].needs if name in self.settings else () for name in options}
        is_met = {need: options.get(need[0], self._default(need[0])) in need[1:] for of_one in needs.values() for need in of_one}
        left = {name: text for name, text in options.items() if all(is_met[need] for need in needs[name])}
        return left if len(left) == len(options) else self.acting(left)  # which others may need

    def allows(self, name: str, value: str) -> bool:
        """Whether a text is a value of a setting, one of its words if these are not those of a switch, or of an option in `choices`."""
        if name in self.choices:
            return value in self.choices[name]
        setting = self.settings[name]
        return setting.parsed(value) is not None if all(word in SWITCH for word in setting.values) else value in setting.values

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
