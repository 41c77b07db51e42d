"""The engine protocol: subclass `Engine` and `Simulation` to bring an engine of your own.

The file is longer than 300 lines because it is the whole protocol, most of it docstrings.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import metadata
from types import TracebackType
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.engines.npm_packages import is_npm, npm_version
from dropspin.comparisons.measuring.symmetries import REPRESENTED
from dropspin.scenarios import Scenario, Truth
from dropspin.scenarios.bodies.inertia import is_diagonal
from dropspin.scenarios.errors import DropspinError, UnknownName
from dropspin.scenarios.validation import shown

Array = NDArray[np.float64]


_distribution_version = cache(metadata.version)
"""Cached, because each query parses its metadata."""


def version(package: str) -> str:
    """The installed version of a distribution, or of a package of npm."""
    return npm_version(package) if is_npm(package) else _distribution_version(package)


def numpy_array(given: Any) -> NDArray[Any]:
    """What an engine returned, as NumPy reads it, or by DLPack if it cannot."""
    only_dlpack = hasattr(given, "__dlpack__") and not hasattr(given, "__array__")
    return np.from_dlpack(given) if only_dlpack else np.asarray(given)


class EngineMissing(DropspinError):
    """An engine whose package is not installed; the text says how to get it."""


class EngineBroken(DropspinError):
    """An installed engine that cannot be imported or constructed; the text says why, and how to repair it where that is known."""


class Diverged(Exception):
    """A simulation broke down; the text says at which step and why."""


@dataclass(frozen=True)
class AsBuilt:
    """The body and gravity that an engine built, read back from it.

    Attributes:
        mass: [kg].
        inertia: About the centre of mass, in the body frame [kg m²], shape (3, 3).
        gravity: [m/s²], shape (3,).
    """

    mass: float
    inertia: Array
    gravity: Array


MINOR = 0.01
"""Share of a metric's scale."""


class KnownLimitation(NamedTuple):
    """A known limitation of an engine that a simulation met.

    Attributes:
        message: The limitation in a sentence, with the value it reached.
        explained_errors: By metric, the largest error that it explains. A failed measurement within that is `limited` instead of failed;
            all others are judged as usual.
    """

    message: str
    explained_errors: Mapping[str, float] = {}

    @property
    def is_minor(self) -> bool:
        """Whether it explains errors below 1 % alone; it is then mentioned where it explains one, and not by itself."""
        return bool(self.explained_errors) and max(self.explained_errors.values()) < MINOR


class Simulation(ABC):
    """One scene at one time step, built and ready to step; a context manager.

    Attributes:
        velocity_lag: Time by which velocity lags position [s]: half a step under semi-implicit Euler, 0 where both have the same time.
        settings: The settings in force, versions included, stored with the results; values that JSON can hold.
        known_limitations: Known limitations of the engine that the simulation met: a sentence, which is reported, or a `KnownLimitation`,
            which also explains errors.
    """

    velocity_lag: float = 0.0
    settings: Mapping[str, Any] = {}
    known_limitations: Sequence[str | KnownLimitation] = ()

    @abstractmethod
    def advance(self, steps: int) -> None:
        """Take some native steps and nothing else: this is what is timed."""

    @abstractmethod
    def state(self) -> Array:
        """Position, orientation [x, y, z, w], velocity, angular velocity; all in the world frame, y up, shape (13,)."""

    def record(self, steps: int, every: int = 1) -> Array:
        """States now and after each `every` of `steps` steps, shape (1 + steps // every, 13)."""
        rows = np.empty((1 + steps // every, 13))
        rows[0] = self.state()
        for row in rows[1:]:
            self.advance(every)
            row[:] = self.state()
        return rows

    def as_built(self) -> AsBuilt | None:
        """What the engine built, read back from the engine itself; None if it cannot say."""
        return None

    def close(self) -> None:  # noqa: B027 - optional
        """Release what the simulation holds."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


class BatchSimulation(ABC):
    """Many scenes at one time step, stepped together by the engine; a context manager.

    Attributes:
        velocity_lag: As that of a `Simulation` [s].
    """

    velocity_lag: float = 0.0

    @abstractmethod
    def advance(self, steps: int) -> None:
        """Take some native steps and nothing else: this is what is timed."""

    @abstractmethod
    def states(self) -> Array:
        """The state of each, as `Simulation.state` gives it, shape (size, 13); an array that NumPy or DLPack can read."""

    def record(self, steps: int, every: int = 1) -> Array:
        """States now and after each `every` of `steps` steps, shape (size, 1 + steps // every, 13)."""
        rows = [numpy_array(self.states()).astype(float)]
        for _ in range(steps // every):
            self.advance(every)
            rows.append(numpy_array(self.states()).astype(float))
        return np.stack(rows, axis=1)

    def limitations_of(self, scene: Scenario, states: Array) -> Sequence[str | KnownLimitation]:
        """The known limitations that one of the scenes met, as those of a `Simulation`, from its states after each step, shape (n, 13)."""
        return ()

    def close(self) -> None:  # noqa: B027 - optional
        """Release what the simulation holds."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


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


FEWEST_VALUES = 3
"""Values of an option that sets the accuracy: extrapolation needs as many."""
PROFILES = ("calibrated", "default")
"""Settings that reproduce the scene as closely as the engine can; and the engine's defaults, with only the obvious settings made."""
FLOOR_HALF_SIZE = 1e3
"""Of a floor that is a box or a mesh [m]: thick enough that nothing tunnels, and engines in double precision lose no digits with it."""
LATE_IMPACTS = "impacts detected late"
SEMI_IMPLICIT_EULER = "semi-implicit Euler"
EXPLICIT_GYROSCOPIC = "semi-implicit Euler with the gyroscopic term explicit"
IMPLICIT_GYROSCOPIC = "semi-implicit Euler with the gyroscopic term implicit"
MIDPOINT_GYROSCOPIC = "semi-implicit Euler with rotations by the implicit midpoint rule"


def may_tumble(scene: Scenario) -> bool:
    """Whether a body of unequal moments of inertia spins at the start, or may after an impact; only then do gyroscopic terms matter."""
    moments = np.linalg.eigvalsh(scene.body.inertia_tensor)
    return bool(np.ptp(moments) > 1e-12 * moments[-1]) and (any(scene.start.angular_velocity) or scene.floor is not None)


def refusal_of_hull(scene: Scenario, name: str) -> str | None:
    """Why a scene's body is not represented by its corners, which an engine calls `name`; None if it can be."""
    if scene.floor is None:
        return f"there is no shape without a floor, and no {name}"
    return f"a {name} would only approximate a ball" if scene.body.is_ball else None


def refusal_of_axes(scene: Scenario, does: str) -> str | None:
    """Why the products of inertia of a scene's body are in the way of what an adapter does, such as `damps`; None if there are none."""
    if is_diagonal(scene.body.inertia_tensor):
        return None
    return f"the adapter {does} along the body's own axes only; these are not principal axes"


def refusal_of_unequal_damping(scene: Scenario) -> str | None:
    """Why a scene is declined by an adapter that sets one coefficient of angular damping; None for equal moments of inertia."""
    moments = np.linalg.eigvalsh(scene.body.inertia_tensor)
    if scene.damping is None or scene.damping.angular == 0.0 or np.ptp(moments) <= 1e-12 * moments[-1]:
        return None
    return "the adapter damps rotation about all axes with one coefficient; angular damping needs a body of equal moments of inertia"


def refusal_of_rest_speed(scene: Scenario, engine: str, instead: str = "") -> str | None:
    """Why an engine without a setting for it declines a rest speed; None for a floor that has none.

    Args:
        scene: The scene.
        engine: The engine's name.
        instead: What the engine always does.
    """
    if scene.floor is None or scene.floor.rest_speed == 0.0:
        return None
    return f"{engine} has no setting for the speed below which restitution is 0 (floor.rest_speed){instead and f'; {instead}'}"


def refusal_of_floor(scene: Scenario, kind: str) -> str | None:
    """Why a floor is too small for a scene; None for a plane, and if the body stays within `FLOOR_HALF_SIZE` of the origin.

    Args:
        scene: The scene.
        kind: What represents the floor, such as `plane` or `box`.
    """
    travel = np.linalg.norm(scene.start.position) + np.linalg.norm(scene.start.velocity) * scene.duration + scene.body.size
    if scene.floor is None or kind == "plane" or travel <= FLOOR_HALF_SIZE:
        return None
    return f"the floor is a {kind} of {2 * FLOOR_HALF_SIZE:g} m, and the body may leave it"


def engine_name(label: str) -> str:
    """The name of an engine without the options in its label."""
    return label.partition("[")[0]


def calibrated_label(label: str) -> str | None:
    """The label of the calibrated profile of an engine whose label has profile=default; None for any other label."""
    name, _, listed = label.removesuffix("]").partition("[")
    options = listed.split(",")
    if "profile=default" not in options:
        return None
    left = ",".join(option for option in options if option != "profile=default")
    return f"{name}[{left}]" if left else name


def _spelled(value: float | str) -> str:
    """An option's value as text: a number with six digits if these are exact, else with all."""
    if isinstance(value, str):
        return value
    return f"{value:g}" if float(f"{value:g}") == value else repr(float(value))


@dataclass(frozen=True)
class Engine(ABC):
    """An engine with its options.

    Attributes:
        options: The options that differ from the defaults.
    """

    name: ClassVar[str]
    order: ClassVar[float | None] = None
    """Claimed order of accuracy in free flight; inf for exact, None for no claim."""
    precision: ClassVar[type] = np.float64
    """The precision of the engine's state: numpy.float64 or numpy.float32."""
    shapes: ClassVar[tuple[str, ...]] = ("sphere", "box", "vertices")
    """The shapes of bodies that it builds on a floor; scenes with others are declined."""
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
    compiles: ClassVar[bool] = False
    """Whether the engine compiles when a scene is first simulated; that is then done and timed apart from the simulations.

    A batch may then differ from single simulations by rounding.
    """
    mixes_scenes: ClassVar[bool] = False
    """Whether the scenes of a batch may differ in all numbers (masses, sizes, gravity, floors), not only in their starts."""
    reasons: ClassVar[Mapping[str, str]] = {}
    """The reason for the value of each setting of a calibrated simulation, by the names in `Simulation.settings`."""

    options: Mapping[str, str] = field(default_factory=dict)

    @abstractmethod
    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        """Build a scene at a time step [s], start included."""

    def __post_init__(self) -> None:
        chosen = {}
        for option, value in sorted(self.options.items()):
            if option not in self.choices and option not in self.numbers:
                raise UnknownName(f"{self.name}'s option", option, [*self.choices, *self.numbers])
            if option in self.choices and value not in self.choices[option]:
                raise UnknownName(f"{self.name}'s {option}", value, self.choices[option])
            canonical = self._canonical_number(option, value) if option in self.numbers else value
            if canonical != self._default(option):
                chosen[option] = canonical
        object.__setattr__(self, "options", chosen)
        for option in self.representations:
            if option not in self.choices:
                raise UnknownName(f"{self.name}'s representation", option, self.choices)
        for option, values in self.accuracy.items():
            if option not in self.choices and option not in self.numbers:
                raise UnknownName(f"{self.name}'s accuracy option", option, [*self.choices, *self.numbers])
            if len(set(values)) < FEWEST_VALUES:
                raise DropspinError(
                    f"{self.name}.accuracy[{option!r}]: got {shown(values)}; give at least {FEWEST_VALUES} values, coarsest first."
                )

    def _default(self, option: str) -> str:
        return _spelled(self.numbers[option].default) if option in self.numbers else self.choices[option][0]

    def _canonical_number(self, option: str, value: str) -> str:
        """The canonical spelling of a number, so that equal options have equal labels."""
        allowed = self.numbers[option]
        try:
            number = float(value)
        except ValueError:
            number = float("nan")
        if not allowed.least <= number <= allowed.most:
            raise DropspinError(f"{self.name}'s {option}: got {value!r}; it is a number from {allowed.least:g} to {allowed.most:g}.")
        return _spelled(number)

    def option(self, name: str) -> str:
        """An option's value, given or default."""
        return self.options.get(name, self._default(name))

    def accuracy_levels(self) -> list[Self]:
        """The engine with each set of values of its accuracy options, coarsest first; empty if it has none."""
        count = min(map(len, self.accuracy.values()), default=0)
        levels = [
            {option: _spelled(values[len(values) - count + level]) for option, values in self.accuracy.items()} for level in range(count)
        ]
        return [replace(self, options={**self.options, **level}) for level in levels]

    def refined(self, dts: Sequence[float]) -> list[tuple[float, Self]]:
        """The finest of some time steps [s], coarsest first, and the engine at each, its accuracy options refined with the step."""
        levels = self.accuracy_levels()
        count = min(len(dts), len(levels))
        return list(zip(sorted(dts)[:count][::-1], levels[-count:], strict=True))

    def represented_otherwise(self) -> dict[str, Self]:
        """The engine with each other value of each option in `representations`, by text such as `with body=mesh`."""
        return {
            f"{REPRESENTED}{option}={value}": replace(self, options={**self.options, option: value})
            for option in self.representations
            for value in self.choices[option]
            if value != self.option(option)
        }

    @property
    def label(self) -> str:
        """The canonical name: `name[option=value,…]`, options sorted, defaults left out."""
        listed = ",".join(f"{key}={value}" for key, value in self.options.items())
        return f"{self.name}[{listed}]" if listed else self.name

    def order_in(self, scene: Scenario) -> float | None:
        """The order claimed for a scene's errors: `order` in free flight, None with a floor."""
        return self.order if scene.floor is None else None

    def discretisation(self, scene: Scenario) -> str | None:
        """The name of the discretisation of a scene's motion; None if it is not known.

        Two engines of the same one make the same errors: that they agree is no evidence that either is right.
        """
        return None

    def predicted_error(self, scene: Scenario, truth: Truth | None, metric: str, dt: float) -> float | None:
        """The error of a metric that follows from the engine's scheme; None if it is not known."""
        return None

    def declines(self, scene: Scenario) -> str | None:
        """Why a scene is not simulated: a limit of the engine, or of its adapter ("the adapter ..."); None if it is."""
        return None

    def refusal(self, scene: Scenario) -> str | None:
        """Why a scene is not simulated, by the shape of its body or as `declines` says; None if it is."""
        if scene.floor is not None and scene.body.shape not in self.shapes:
            return f"the adapter maps the shapes {', '.join(self.shapes)} onto a floor, not {scene.body.shape}"
        return self.declines(scene)

    def programs(self, scene: Scenario, dt: float) -> Mapping[str, str]:
        """Programs and models with the settings of a scene at a time step [s], ready to paste, by language; may be empty.

        The one in `python` runs by itself, and has `motion(height, steps, step)`: heights of the body's lowest point [m] and vertical
        speeds [m/s] after each step of a fall from that height.
        """
        return {}

    def prepare_batch(self, members: Sequence[Scenario], dt: float) -> BatchSimulation | None:
        """Build scenes that differ in their starts, or in other numbers if the engine `mixes_scenes`, and have as many steps.

        None if the engine cannot step them together; single simulations then take the place of the batch.
        """
        return None

    @property
    def steps_batches(self) -> bool:
        """Whether the engine has batches at all."""
        return type(self).prepare_batch is not Engine.prepare_batch
