"""The scene: a TOML file's content, checked. An absent table is not modelled, by any engine."""

import hashlib
import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, field_validator, model_validator

from scenarios.body import Array, Body, NotNegative, Number, Positive, Table, Vector
from scenarios.rotations import rotate

TOUCHING = 1e-9
"""Of the body's size: how near to the floor counts as on it."""


def unit(quaternion: tuple[float, ...]) -> tuple[float, ...]:
    """The quaternion with length 1; one that has it, to rounding, stays as it is."""
    length = math.hypot(*quaternion)
    if length == 0.0:
        raise ValueError("must not be the zero quaternion")
    if abs(length - 1.0) < 4e-16:  # unit already, to the last digit; a saved scene loads as it was
        return quaternion
    return tuple(component / length for component in quaternion)


Orientation = Annotated[tuple[Number, ...], Field(min_length=4, max_length=4), AfterValidator(unit)]


class Start(Table):
    """The state at t = 0, all in the world frame [m, -, m/s, rad/s]; quaternions are [x, y, z, w]."""

    position: Vector = (0.0, 0.0, 0.0)
    orientation: Orientation = (0.0, 0.0, 0.0, 1.0)
    velocity: Vector = (0.0, 0.0, 0.0)
    angular_velocity: Vector = (0.0, 0.0, 0.0)


class Gravity(Table):
    """Uniform gravity [m/s²]."""

    acceleration: Vector


class Floor(Table):
    """The plane y = 0, facing up."""

    restitution: Annotated[Number, Field(ge=0, le=1)]
    friction: Literal["none", "infinite"] | NotNegative
    rest_speed: NotNegative = 0.0

    @model_validator(mode="after")
    def _no_friction_is_none(self) -> Self:
        if self.friction == 0.0:
            object.__setattr__(self, "friction", "none")
        return self


class Damping(Table):
    """Exponential decay of velocity and angular velocity [1/s]."""

    linear: NotNegative = 0.0
    angular: NotNegative = 0.0


class Ensemble(Table):
    """Starts drawn from a spread around the scene's own.

    `turn` is the largest rotation from the scene's own attitude [rad]: all those by up to it are equally likely, all attitudes by default.
    `velocity` [m/s] and `angular_velocity` [rad/s] are spread evenly by up to so much to either side. The height above the floor is the
    scene's own.
    """

    size: Annotated[int, Field(strict=True, ge=2, le=10_000_000)]
    seed: Annotated[int, Field(strict=True, ge=0)]
    turn: Annotated[NotNegative, Field(le=math.pi)] = math.pi
    velocity: Annotated[tuple[NotNegative, ...], Field(min_length=3, max_length=3)] = (0.0, 0.0, 0.0)
    angular_velocity: Annotated[tuple[NotNegative, ...], Field(min_length=3, max_length=3)] = (0.0, 0.0, 0.0)


class Expectation(Table):
    """What a run is held to: one bound on one metric, for all engines and steps or for those named.

    `dt` names one step or several [s]. `below` bounds the size of the value, `above` and `within` the value with its sign.
    """

    metric: str
    engine: str | None = None
    dt: tuple[Positive, ...] | None = None
    below: Positive | None = None
    above: Number | None = None
    within: Annotated[tuple[Number, ...], Field(min_length=2, max_length=2)] | None = None
    reason: Annotated[str, Field(min_length=1)]

    @field_validator("dt", mode="before")
    @classmethod
    def _one_step_is_a_list_of_one(cls, dt: object) -> object:
        return [dt] if isinstance(dt, float | int) else dt

    @model_validator(mode="after")
    def _one_bound(self) -> Self:
        if sum(bound is not None for bound in (self.below, self.above, self.within)) != 1:
            raise ValueError("needs exactly one of below, above, within")
        if self.within is not None and self.within[0] > self.within[1]:
            raise ValueError(f"within is {list(self.within)}; the lower bound comes first")
        return self


class Scenario(Table):
    """One scene.

    `name` is the file's, without its ending, and `origin` what was asked for to load it, empty if it was given as a mapping; everything
    else is the file's content (units: SI).
    """

    name: str
    origin: Annotated[str, Field(exclude=True)] = ""
    summary: str = ""
    source: str = ""
    tags: tuple[str, ...] = ()
    duration: Positive
    body: Body
    start: Start = Start()
    gravity: Gravity | None = None
    floor: Floor | None = None
    damping: Damping | None = None
    ensemble: Ensemble | None = None
    expect: tuple[Expectation, ...] = ()

    @model_validator(mode="after")
    def _has_an_inertia(self) -> Self:
        tensor = self.body.inertia_tensor
        if not (np.isfinite(tensor).all() and np.linalg.eigvalsh(tensor)[0] > 0.0):
            raise ValueError(f"body: its inertia is {tensor.tolist()} kg m², beyond what numbers can hold; scale the scene's units")
        return self

    @model_validator(mode="after")
    def _starts_above_the_floor(self) -> Self:
        if self.floor is not None and self.clearance < -TOUCHING * self.body.size:
            start = list(self.start.position)
            raise ValueError(f"start.position: got {start}; there the body is {-self.clearance:.3g} m below the floor; raise it")
        return self

    @property
    def initial_state(self) -> Array:
        """The start, shape (13,): position, orientation, velocity, angular velocity."""
        start = self.start
        return np.array([*start.position, *start.orientation, *start.velocity, *start.angular_velocity])

    @property
    def clearance(self) -> float:
        """Height of the body's lowest point at the start [m]."""
        heights = rotate(np.array(self.start.orientation), self.body.vertices)[:, 1]
        return self.start.position[1] + float(heights.min()) - self.body.rounding

    @property
    def starts_above_floor(self) -> bool:
        """Whether the body has to fall to touch the floor; False without one."""
        return self.floor is not None and self.clearance > TOUCHING * self.body.size

    @property
    def acceleration(self) -> Array:
        """Gravity [m/s²], shape (3,); zero where the scene has none."""
        return np.zeros(3) if self.gravity is None else np.array(self.gravity.acceleration)

    @property
    def digest(self) -> str:
        """A short hash of everything that moves the body; text and expectations do not count."""
        physics = self.model_dump_json(exclude={"name", "summary", "source", "tags", "expect"})
        return hashlib.sha256(physics.encode()).hexdigest()[:12]

    def steps(self, dt: float) -> int:
        """Number of whole steps of dt [s] that fit into the duration."""
        return math.floor(self.duration / dt + 1e-9)

    def starting_at(self, state: Array) -> "Scenario":
        """The same scene from another state, shape (13,)."""
        values = [float(value) for value in state]
        start = Start(
            position=tuple(values[0:3]),
            orientation=tuple(values[3:7]),
            velocity=tuple(values[7:10]),
            angular_velocity=tuple(values[10:13]),
        )
        return self.model_copy(update={"start": start})
