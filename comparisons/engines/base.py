"""The engine protocol: subclass `Engine` and `Simulation` to bring your own engine."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.engines.options import Configured
from dropspin.scenarios import Scenario, Truth
from dropspin.scenarios.errors import DropspinError

Array = NDArray[np.float64]

MINOR = 0.01
"""Share of a metric's scale."""


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
        """Whether it explains only errors below 1 %; it is then reported only where it explains an error."""
        return bool(self.explained_errors) and max(self.explained_errors.values()) < MINOR


@dataclass(frozen=True)
class Engine(Configured, ABC):
    """An engine with its options; `name` and `prepare` are required.

    Attributes:
        options: The options that differ from the defaults.
    """

    @abstractmethod
    def prepare(self, scene: Scenario, dt: float) -> "Simulation":
        """Build a scene at a time step [s], start included."""

    def declines(self, scene: Scenario) -> str | None:
        """Why a scene is not simulated: a limit of the engine, or of its adapter ("the adapter ..."); None if it is."""
        return None

    shapes: ClassVar[tuple[str, ...]] = ("sphere", "box", "vertices")
    """The shapes of bodies that it builds on a floor; scenes with others are declined."""
    takes_offsets: ClassVar[bool] = False
    """Whether it builds a body on a floor whose centre of mass is not at the centre of its shape."""
    takes_walls: ClassVar[bool] = False
    """Whether it builds walls, and floors that end."""
    order: ClassVar[float | None] = None
    """Claimed order of accuracy in free flight; inf for exact, None for no claim."""
    precision: ClassVar[type] = np.float64
    """The precision of the engine's state: numpy.float64 or numpy.float32."""
    compiles: ClassVar[bool] = False
    """Whether the engine compiles when a scene is first simulated; compilation is then done and timed separately.

    A batch may then differ from single simulations by rounding.
    """
    mixes_scenes: ClassVar[bool] = False
    """Whether the scenes of a batch may differ in all numbers (masses, sizes, gravity, floors), not only in their starts."""

    @property
    def reasons(self) -> Mapping[str, str]:
        """The reason for the value of each setting of a calibrated simulation, by the names in `Simulation.settings`."""
        return {name: setting.why for name, setting in self.settings.items() if setting.why}

    def prepare_batch(self, members: Sequence[Scenario], dt: float) -> "BatchSimulation | None":
        """Build scenes that differ in their starts, or in other numbers if the engine `mixes_scenes`, and have as many steps.

        None if the engine cannot step them together; single simulations then take the place of the batch.
        """
        return None

    @property
    def steps_batches(self) -> bool:
        """Whether the engine has batches at all."""
        return type(self).prepare_batch is not Engine.prepare_batch

    def order_in(self, scene: Scenario) -> float | None:
        """The order claimed for a scene's errors: `order` in free flight, None with a floor."""
        return self.order if scene.floor is None else None

    def discretisation(self, scene: Scenario) -> str | None:
        """The name of the discretisation of a scene's motion; None if it is not known.

        Two engines with the same discretisation make the same errors, so their agreement is no evidence that either is right.
        """
        return None

    def predicted_error(self, scene: Scenario, truth: Truth | None, metric: str, dt: float) -> float | None:
        """The error of a metric that follows from the engine's scheme; None if it is not known."""
        return None

    def programs(self, scene: Scenario, dt: float) -> Mapping[str, str]:
        """Programs and models with the settings of a scene at a time step [s], ready to paste, by language; may be empty.

        The one in `python` runs by itself, and has `motion(height, steps, step)`: heights of the body's lowest point [m] and vertical
        speeds [m/s] after each step of a fall from that height.
        """
        return {}

    def refusal(self, scene: Scenario) -> str | None:
        """Why a scene is not simulated, by the shape of its body or as `declines` says; None if it is."""
        if scene.floor is not None and scene.body.shape not in self.shapes:
            return f"the adapter maps the shapes {', '.join(self.shapes)} onto a floor, not {scene.body.shape}"
        if scene.floor is not None and not self.takes_offsets and scene.body.shape not in ("vertices", "mesh") and scene.body.centre.any():
            return "the adapter builds bodies with the centre of mass at the centre of their shape"
        if scene.has_edges_or_walls and not self.takes_walls:
            return "the adapter builds no walls" if scene.wall is not None else "the adapter builds a floor that does not end"
        return self.declines(scene)


class _Stepped(ABC):
    """What simulations of one scene and of many have in common; a context manager.

    Attributes:
        velocity_lag: Time by which velocity lags position [s]: half a step under semi-implicit Euler, 0 where both have the same time.
        settings: The settings in force, versions included, stored with the results; values that JSON can hold.
    """

    velocity_lag: float = 0.0
    settings: Mapping[str, Any] = {}

    @abstractmethod
    def advance(self, steps: int) -> None:
        """Take some native steps and nothing else: this is what is timed."""

    def as_built(self) -> AsBuilt | None:
        """What the engine built, read back from the engine itself; None if it cannot say."""
        return None

    def close(self) -> None:  # noqa: B027 - optional
        """Release what the simulation holds."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


class Simulation(_Stepped):
    """One scene at one time step, built and ready to step; `advance` and `state` are required.

    Attributes:
        known_limitations: Known limitations of the engine that the simulation met: a sentence, which is reported, or a `KnownLimitation`,
            which also explains errors.
    """

    known_limitations: Sequence[str | KnownLimitation] = ()

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


class BatchSimulation(_Stepped):
    """Many scenes at one time step, stepped together by the engine; `advance` and `states` are required."""

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


class OneWorld(Simulation):
    """A simulation of one scene by an engine that steps worlds together: a batch of one."""

    def __init__(self, scene: Scenario, worlds: BatchSimulation) -> None:
        self.velocity_lag, self.settings = worlds.velocity_lag, worlds.settings
        self._scene, self._worlds = scene, worlds

    def advance(self, steps: int) -> None:
        self._worlds.advance(steps)

    def state(self) -> Array:
        [state] = numpy_array(self._worlds.states())
        return state.astype(float)

    def record(self, steps: int, every: int = 1) -> Array:
        [states] = self._worlds.record(steps, every)
        self.known_limitations = self._worlds.limitations_of(self._scene, states) if every == 1 else []
        return states

    def as_built(self) -> AsBuilt | None:
        return self._worlds.as_built()

    def close(self) -> None:
        self._worlds.close()


def numpy_array(given: Any) -> NDArray[Any]:
    """What an engine returned, as NumPy reads it, or by DLPack if it cannot."""
    only_dlpack = hasattr(given, "__dlpack__") and not hasattr(given, "__array__")
    return np.from_dlpack(given) if only_dlpack else np.asarray(given)
