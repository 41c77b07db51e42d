"""An engine's name, its options with their values, and the label that they make, such as `mujoco[integrator=rk4]`."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple, Self

from dropspin.comparisons.measuring.symmetries import REPRESENTED
from dropspin.scenarios.errors import DropspinError, UnknownName
from dropspin.scenarios.validation import shown

FEWEST_VALUES = 3
"""Values of an option that sets the accuracy: extrapolation needs as many."""


class NumericOption(NamedTuple):
    """The default and the range of a numeric option.

    Attributes:
        default: Its value where it is not given.
        least: The least value allowed.
        most: The largest value allowed.
    """

    default: float
    least: float
    most: float


@dataclass(frozen=True)
class Configured:
    """What has a name and options.

    Attributes:
        options: The options that differ from the defaults.
    """

    options: Mapping[str, str] = field(default_factory=dict)

    name: ClassVar[str]
    choices: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    """Each option's values, the default first."""
    numbers: ClassVar[Mapping[str, NumericOption]] = {}
    """Each numeric option's default and range."""
    accuracy: ClassVar[Mapping[str, tuple[float | str, ...]]] = {}
    """Options besides the time step that set the accuracy, each with three values or more, coarsest first: {"rtol": (1e-4, 1e-6, 1e-8)}.

    Where an error does not vanish as dt → 0, `run` refines these options together with the time step.
    """
    representations: ClassVar[tuple[str, ...]] = ()
    """Names of `choices` on which the motion does not depend: they represent the same scene in different ways, such as a box as a mesh, or
    add a body that is far away.

    `symmetries` compares the motions.
    """

    def __post_init__(self) -> None:
        chosen = {option: self._canonical(option, value) for option, value in sorted(self.options.items())}
        object.__setattr__(self, "options", {option: value for option, value in chosen.items() if value != self._default(option)})
        for option in self.representations:
            self._verify_known("representation", option, self.choices)
        for option, values in self.accuracy.items():
            self._verify_known("accuracy option", option, [*self.choices, *self.numbers])
            if len(set(values)) < FEWEST_VALUES:
                raise DropspinError(
                    f"{self.name}.accuracy[{option!r}]: got {shown(values)}; give at least {FEWEST_VALUES} values, coarsest first."
                )

    def _canonical(self, option: str, value: str) -> str:
        """An option's value in its canonical spelling, so that equal options have equal labels."""
        self._verify_known("option", option, [*self.choices, *self.numbers])
        if option not in self.numbers:
            self._verify_known(option, value, self.choices[option])
            return value
        allowed = self.numbers[option]
        try:
            number = float(value)
        except ValueError:
            number = float("nan")
        if not allowed.least <= number <= allowed.most:
            raise DropspinError(f"{self.name}'s {option}: got {value!r}; it is a number from {allowed.least:g} to {allowed.most:g}.")
        return _spelled(number)

    def _verify_known(self, kind: str, given: str, known: Collection[str]) -> None:
        if given not in known:
            raise UnknownName(f"{self.name}'s {kind}", given, known)

    def _default(self, option: str) -> str:
        return _spelled(self.numbers[option].default) if option in self.numbers else self.choices[option][0]

    def option(self, name: str) -> str:
        """An option's value, given or default."""
        return self.options.get(name, self._default(name))

    @property
    def is_default(self) -> bool:
        """Whether the engine keeps its own defaults (profile=default)."""
        return self.options.get("profile") == "default"

    @property
    def label(self) -> str:
        """The canonical name: `name[option=value,…]`, options sorted, defaults left out."""
        listed = ",".join(f"{key}={value}" for key, value in self.options.items())
        return f"{self.name}[{listed}]" if listed else self.name

    def _with(self, options: Mapping[str, str]) -> Self:
        return replace(self, options={**self.options, **options})

    def accuracy_levels(self) -> list[Self]:
        """The engine with each set of values of its accuracy options, coarsest first; empty if it has none."""
        count = min(map(len, self.accuracy.values()), default=0)
        finest = {option: values[-count:] for option, values in self.accuracy.items()}
        return [self._with({option: _spelled(values[level]) for option, values in finest.items()}) for level in range(count)]

    def refined(self, dts: Sequence[float]) -> list[tuple[float, Self]]:
        """The finest of some time steps [s], coarsest first, and the engine at each, its accuracy options refined with the step."""
        levels = self.accuracy_levels()
        count = min(len(dts), len(levels))
        return list(zip(sorted(dts)[:count][::-1], levels[-count:], strict=True))

    def represented_otherwise(self) -> dict[str, Self]:
        """The engine with each other value of each option in `representations`, by text such as `with body=mesh`."""
        return {
            f"{REPRESENTED}{option}={value}": self._with({option: value})
            for option in self.representations
            for value in self.choices[option]
            if value != self.option(option)
        }


def _spelled(value: float | str) -> str:
    """An option's value as text: a number with six digits if these are exact, else with all."""
    if isinstance(value, str):
        return value
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
