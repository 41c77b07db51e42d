"""The engine protocol: subclass `Engine` and `Simulation` to bring your own engine."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
    """Raised if the package of an engine is not installed; the message says how to install it."""


class EngineBroken(DropspinError):
    """Raised if an installed engine cannot be imported or constructed; the message says why and, if known, how to repair it."""


class Diverged(Exception):
    """Raised if a simulation diverged; the message says at which time step and why."""


@dataclass(frozen=True)
class AsBuilt:
    """The body and gravity that an engine built, read back from it.

    Attributes:
        mass: Mass [kg].
        inertia: Inertia tensor about the centre of mass, in the body frame [kg m²], shape (3, 3).
        gravity: Acceleration of gravity [m/s²], shape (3,).
    """

    mass: float
    inertia: Array
    gravity: Array


class KnownLimitation(NamedTuple):
    """A known limitation of an engine that a simulation met.

    Attributes:
        message: A sentence that describes the limitation, with the value that exceeded it.
        explained_errors: For each metric, the largest error that the limitation explains. A check that fails with an error up to this size
            has the verdict `limited` instead of `failed`.
    """

    message: str
    explained_errors: Mapping[str, float] = {}

    @property
    def is_minor(self) -> bool:
        """Whether the explained errors are below 1 % of their scales; the limitation is then reported only if a check is `limited`."""
        return bool(self.explained_errors) and max(self.explained_errors.values()) < MINOR


@dataclass(frozen=True)
class Engine(Configured, ABC):
    """An engine with its options. A subclass must define `name` and `prepare`.

    Attributes:
        options: The options that differ from the defaults.
    """

    @abstractmethod
    def prepare(self, scene: Scenario, dt: float) -> "Simulation":
        """Build the simulation of a scene with a time step [s], in the initial state of the scene."""

    def declines(self, scene: Scenario) -> str | None:
        """The reason why the engine does not simulate a scene, or None; it begins with "the adapter" if only the adapter prevents it."""
        return None

    shapes: ClassVar[tuple[str, ...]] = ("sphere", "box", "vertices")
    """The shapes of bodies that the engine simulates with a floor; it declines a floor with any other shape."""
    takes_offsets: ClassVar[bool] = False
    """Whether the engine, with a floor, simulates bodies whose centre of mass is not at the centre of their shape."""
    takes_walls: ClassVar[bool] = False
    """Whether the engine simulates walls, and floors that end."""
    order: ClassVar[float | None] = None
    """Claimed order of accuracy in free flight; inf if the engine claims exact results, None if it makes no claim."""
    precision: ClassVar[type] = np.float64
    """The precision of the engine's state: numpy.float64 or numpy.float32."""
    compiles: ClassVar[bool] = False
    """Whether the engine compiles when it first simulates a scene; the time of compiling is then measured separately.

    Results of a batch may then differ from those of single simulations by rounding errors.
    """
    mixes_scenes: ClassVar[bool] = False
    """Whether the scenes of a batch may differ in all numbers (masses, sizes, gravity, floors), not only in their initial states."""

    code_files: ClassVar[Sequence[str] | None] = None
    """The files that the engine loads beside Python modules, as paths or patterns (`**` is any folder) relative to the adapter's folder.

    If one of them changes, it is another engine. None for the shared libraries in and below that folder, and scripts of a `ProgramEngine`.
    """

    @property
    def reasons(self) -> Mapping[str, str]:
        """For each setting in `Simulation.settings` with a calibrated value, the reason for this value."""
        return {name: setting.why for name, setting in self.settings.items() if setting.why}

    def prepare_batch(self, members: Sequence[Scenario], dt: float) -> "BatchSimulation | None":
        """Build a batch of scenes with the same number of time steps, or return None if the engine cannot step them together.

        The scenes differ in their initial states and, if `mixes_scenes` is true, in other numbers. If the result is None, dropspin
        simulates the scenes one by one.
        """
        return None

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        single, batch = (next(base for base in cls.__mro__ if name in vars(base)) for name in ("prepare", "prepare_batch"))
        if cls.__mro__.index(single) < cls.__mro__.index(batch):
            cls.prepare_batch = Engine.prepare_batch  # type: ignore[method-assign]  # that of another adapter would not do what `prepare` does

    @property
    def steps_batches(self) -> bool:
        """Whether the engine can simulate batches."""
        return type(self).prepare_batch is not Engine.prepare_batch

    def order_in(self, scene: Scenario) -> float | None:
        """The order of accuracy that the engine claims in a scene: by default `order` in free flight, and None with a floor."""
        return self.order if scene.floor is None else None

    def discretisation(self, scene: Scenario) -> str | None:
        """The name of the discretisation by which the engine simulates a scene; None if it is not known.

        Two engines with the same discretisation make the same errors, so their agreement is not evidence that either is correct.
        """
        return None

    def predicted_error(self, scene: Scenario, truth: Truth | None, metric: str, dt: float) -> float | None:
        """The error of a metric that theory predicts for the engine's integration scheme; None if there is no prediction."""
        return None

    def programs(self, scene: Scenario, dt: float) -> Mapping[str, str]:
        """Programs and models that use the settings of a scene at a time step [s], as text by language; empty if there are none.

        The text in `python` is a complete program. Its function `motion(height, steps, step)` simulates a fall from a height, and returns
        the height of the body's lowest point [m] and the vertical speed [m/s] after each time step.
        """
        return {}

    def refusal(self, scene: Scenario) -> str | None:
        """The reason why a scene is not simulated, because of its shape, its walls or `declines`; None if it is simulated."""
        if scene.floor is not None and scene.body.shape not in self.shapes:
            return f"the adapter maps the shapes {', '.join(self.shapes)} onto a floor, not {scene.body.shape}"
        if scene.floor is not None and not self.takes_offsets and scene.body.shape not in ("vertices", "mesh") and scene.body.centre.any():
            return "the adapter builds bodies with the centre of mass at the centre of their shape"
        if scene.has_edges_or_walls and not self.takes_walls:
            return "the adapter builds no walls" if scene.wall is not None else "the adapter builds a floor that does not end"
        return self.declines(scene)


class _Stepped(ABC):
    """The common base of `Simulation` and `BatchSimulation`; a context manager.

    Attributes:
        velocity_lag: Time by which the velocity lags the position [s]: half a time step under semi-implicit Euler, 0 if both are at the
            same time.
        settings: The settings of the simulation, including versions. dropspin stores them with the results, so values must be of JSON
            types.
    """

    velocity_lag: float = 0.0
    settings: Mapping[str, Any] = {}

    @abstractmethod
    def advance(self, steps: int) -> None:
        """Take some time steps of the engine and do nothing else, because dropspin times this method."""

    def as_built(self) -> AsBuilt | None:
        """The body and gravity, read back from the engine; None if the engine does not provide them."""
        return None

    def close(self) -> None:  # noqa: B027 - optional
        """Release the resources of the simulation."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


class Simulation(_Stepped):
    """The simulation of one scene with one time step. A subclass must define `advance` and `state`.

    Attributes:
        known_limitations: The known limitations of the engine that the simulation met. Each is a sentence, which is reported, or a
            `KnownLimitation`, which also states the errors that it explains.
    """

    known_limitations: Sequence[str | KnownLimitation] = ()

    @abstractmethod
    def state(self) -> Array:
        """Position, orientation [x, y, z, w], velocity and angular velocity, all in the world frame with y up, shape (13,)."""

    def record(self, steps: int, every: int = 1) -> Array:
        """Take `steps` time steps; return the current state and that after each `every` steps, shape (1 + steps // every, 13)."""
        rows = np.empty((1 + steps // every, 13))
        rows[0] = self.state()
        for row in rows[1:]:
            self.advance(every)
            row[:] = self.state()
        return rows


class BatchSimulation(_Stepped):
    """The simulation of many scenes that the engine steps together. A subclass must define `advance` and `states`."""

    @abstractmethod
    def states(self) -> Array:
        """The state of each scene as in `Simulation.state`, shape (size, 13): a NumPy array, or one that NumPy or DLPack can read."""

    def record(self, steps: int, every: int = 1) -> Array:
        """Take `steps` time steps; return the current states and those after each `every` steps, shape (size, 1 + steps // every, 13)."""
        rows = [numpy_array(self.states()).astype(float)]
        for _ in range(steps // every):
            self.advance(every)
            rows.append(numpy_array(self.states()).astype(float))
        return np.stack(rows, axis=1)

    def limitations_of(self, scene: Scenario, states: Array) -> Sequence[str | KnownLimitation]:
        """The known limitations that a scene of the batch met, found from its states after each step, shape (n, 13)."""
        return ()


class OneWorld(Simulation):
    """A simulation of one scene by an engine that steps many scenes together, as a batch of one scene."""

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
