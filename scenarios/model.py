"""The scene model: the validated content of a TOML file. Engines model only what the tables of the file describe."""

import hashlib
import math
from collections.abc import Sequence
from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, Field, field_validator, model_validator

from dropspin.scenarios.bodies import Body
from dropspin.scenarios.bodies.surface import clearances
from dropspin.scenarios.damping import Damping
from dropspin.scenarios.field_types import NotNegative, Number, Positive, Table, Vector, unit
from dropspin.scenarios.recording import Recording, start_of
from dropspin.scenarios.state import PARTS, Array
from dropspin.scenarios.surfaces import Floor, Surface, Wall
from dropspin.scenarios.text import Prose, Text, joined, verify_line

TOUCHING = 1e-9
"""Height above the floor, relative to the size of the body, up to which the body counts as touching the floor."""


Orientation = Annotated[tuple[Number, ...], Field(min_length=4, max_length=4), AfterValidator(unit)]


class Start(Table):
    """The state at t = 0, in the world frame [m, -, m/s, rad/s]; quaternions are [x, y, z, w]."""

    position: Vector = (0.0, 0.0, 0.0)
    orientation: Orientation = (0.0, 0.0, 0.0, 1.0)
    velocity: Vector = (0.0, 0.0, 0.0)
    angular_velocity: Vector = (0.0, 0.0, 0.0)


class Gravity(Table):
    """Uniform gravity [m/s²]."""

    acceleration: Vector


class Ensemble(Table):
    """Random initial states around that of the scene.

    `turn` is the largest angle of rotation from the scene's orientation [rad]; rotations are uniform up to this angle, by default over
    all orientations. `velocity` [m/s] and `angular_velocity` [rad/s] are the half widths of uniform distributions around the scene's
    values. The body is always at the scene's height above the floor.
    """

    size: Annotated[int, Field(strict=True, ge=2, le=10_000_000)]
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**64)]
    turn: Annotated[NotNegative, Field(le=math.pi)] = math.pi
    velocity: Annotated[tuple[NotNegative, ...], Field(min_length=3, max_length=3)] = (0.0, 0.0, 0.0)
    angular_velocity: Annotated[tuple[NotNegative, ...], Field(min_length=3, max_length=3)] = (0.0, 0.0, 0.0)


EARLIER_NAMES = {"document": "wang"}
"""Engines by the names that they had in earlier versions."""


def current_label(label: str) -> str:
    """The label of an engine that may have the name of an earlier version."""
    name, bracket, options = label.partition("[")
    return EARLIER_NAMES.get(name, name) + bracket + options


class Expectation(Table):
    """A bound on a metric, for all engines and time steps or for those given.

    `dt` is one time step or several [s]. `below` bounds the absolute value; `above` and `within` bound the value with its sign.
    """

    metric: Text
    engine: Annotated[Text, AfterValidator(current_label)] | None = None
    dt: tuple[Positive, ...] | None = None
    below: Positive | None = None
    above: Number | None = None
    within: Annotated[tuple[Number, ...], Field(min_length=2, max_length=2)] | None = None
    reason: Annotated[Prose, Field(min_length=1)]

    @field_validator("dt", mode="before")
    @classmethod
    def _one_dt_is_a_list_of_one(cls, dt: object) -> object:
        return [dt] if isinstance(dt, float | int) else dt

    @model_validator(mode="after")
    def _one_bound(self) -> Self:
        if sum(bound is not None for bound in (self.below, self.above, self.within)) != 1:
            raise ValueError("needs exactly one of below, above, within")
        if self.within is not None and self.within[0] > self.within[1]:
            raise ValueError(f"within is {list(self.within)}; the lower bound comes first")
        return self


class Scenario(Table):
    """A scene, in SI units, with y up.

    Attributes:
        name: The name of the scene's file without the extension, or the name given in a mapping.
        origin: The argument of `load` that gave the scene; empty for a mapping.
        summary: A description in one line.
        source: The source of the problem or of its solution.
        tags: Keywords.
        duration: Duration [s].
        body: Shape (such as `sphere`, `box` or `mesh`), size [m], mass [kg] and inertia [kg m²].
        start: Position [m], orientation, velocity [m/s] and angular velocity [rad/s] at t = 0, in the world frame.
        gravity: The acceleration of gravity [m/s²], or None.
        floor: The plane y = 0: restitution, friction, rest speed [m/s] and where it ends; None without a floor.
        wall: Further planes, each with a point, a normal, restitution, friction and rest speed, or None; a scene with walls needs a floor.
        damping: Decay rates [1/s] or factors per time step, or None.
        ensemble: The distribution of the initial states of an ensemble, or None.
        recording: The measured tosses with which motions are compared, or None.
        expect: Bounds on metrics, each with a reason.
    """

    name: Annotated[str, Field(json_schema_extra={"hidden": "in files"})]
    origin: Annotated[str, Field(exclude=True, json_schema_extra={"hidden": "always"})] = ""
    summary: str = ""
    source: str = ""
    tags: tuple[str, ...] = ()
    duration: Positive
    body: Body
    start: Start = Start()
    gravity: Gravity | None = None
    floor: Floor | None = None
    wall: tuple[Wall, ...] | None = None
    damping: Damping | None = None
    ensemble: Ensemble | None = None
    recording: Recording | None = None
    expect: tuple[Expectation, ...] = ()

    # Validators rather than the types `Text` and `Prose`, whose functions the signature would show.
    @field_validator("summary", "source", mode="before")
    @classmethod
    def _is_joined(cls, value: object) -> object:
        return joined(value)

    @field_validator("wall")
    @classmethod
    def _no_wall_is_none(cls, walls: tuple[Wall, ...] | None) -> tuple[Wall, ...] | None:
        return walls or None

    @field_validator("name", "summary", "source", "tags")
    @classmethod
    def _is_printable(cls, value: str | tuple[str, ...]) -> str | tuple[str, ...]:
        for text in [value] if isinstance(value, str) else value:
            verify_line(text)
        return value

    @model_validator(mode="after")
    def _has_an_inertia(self) -> Self:
        tensor = self.body.inertia_tensor
        if not (np.isfinite(tensor).all() and np.linalg.eigvalsh(tensor)[0] > 0.0):
            raise ValueError(f"body: its inertia is {tensor.tolist()} kg m², outside the range of floating-point numbers; scale the units")
        return self

    @model_validator(mode="after")
    def _starts_above_the_floor(self) -> Self:
        start, size = list(self.start.position), self.body.size
        if self.wall is not None and self.floor is None:
            raise ValueError("wall: needs a [floor], which may be far below the body")
        if self.floor is not None and self.clearance < -TOUCHING * size and not self._starts_beside_the_floor:
            raise ValueError(f"start.position: got {start}; there the body is {-self.clearance:.3g} m below the floor; increase its height")
        room = size if self.ensemble else 0.0  # a member may have any orientation
        for number, wall in enumerate(self.wall or ()):
            distance = self.height_above(wall) - 2.0 * room
            if distance < -TOUCHING * size:
                text = f"{-distance:.3g} m behind wall[{number}]" if not room else f"too near to wall[{number}] for an ensemble"
                raise ValueError(
                    f"start.position: got {start}; there the body is {text}; move it along the wall's normal {list(wall.normal)}"
                )
        return self

    @model_validator(mode="after")
    def _starts_as_recorded(self) -> Self:
        if self.recording is None:
            return self
        if self.ensemble is not None:
            raise ValueError("ensemble: a recording has starts of its own; leave out [ensemble], or [recording]")
        if self.start != Start(**start_of(self.recording)):
            raise ValueError("start: must be that of the recording's first toss")
        return self

    @property
    def initial_state(self) -> Array:
        """The state at t = 0, shape (13,): position, orientation [x, y, z, w], velocity, angular velocity."""
        start = self.start
        return np.array([*start.position, *start.orientation, *start.velocity, *start.angular_velocity])

    @property
    def clearance(self) -> float:
        """Height of the body's lowest point at the start [m]."""
        return self._lowest(self.initial_state)

    def height_above(self, wall: Wall) -> float:
        """Distance of the body from a wall at the start [m]."""
        return self._lowest(wall.as_floor(self.initial_state))

    def _lowest(self, state: Array) -> float:
        return float(clearances(state[np.newaxis], self.body.vertices, self.body.semi_axes)[0])

    @property
    def _starts_beside_the_floor(self) -> bool:
        """Whether the body is beyond the edges of the floor, or below it, at the start."""
        assert self.floor is not None
        (x, y, z), size = self.start.position, self.body.size
        beyond = any(abs(at) >= end + size for at, end in zip((x, z), self.floor.half_extents or (), strict=False))
        return beyond or (self.floor.thickness is not None and y + size <= -self.floor.thickness)

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """The floor and the walls, in the order in which Wang's method treats them."""
        return () if self.floor is None else (self.floor, *(self.wall or ()))

    @property
    def has_edges_or_walls(self) -> bool:
        """Whether there are walls, or a floor that ends."""
        return self.wall is not None or (self.floor is not None and self.floor.ends)

    @property
    def starts_above_floor(self) -> bool:
        """Whether the body starts above the floor; False without a floor."""
        return self.floor is not None and self.clearance > TOUCHING * self.body.size

    @property
    def starts_on_floor(self) -> bool:
        """Whether the body touches the plane y = 0 at the start."""
        return abs(self.clearance) <= TOUCHING * self.body.size

    @property
    def acceleration(self) -> Array:
        """The acceleration of gravity [m/s²], shape (3,); zero if the scene has no gravity."""
        return np.zeros(3) if self.gravity is None else np.array(self.gravity.acceleration)

    @property
    def factor_dt(self) -> float:
        """Time step [s] for which the damping factors are given; 0 if the scene gives decay rates, or has no damping."""
        return 0.0 if self.damping is None else self.damping.factor_dt or 0.0

    @property
    def falls_straight_down(self) -> bool:
        """Whether gravity acts along -y."""
        x, y, z = self.acceleration.tolist()
        return y < 0.0 and x == z == 0.0

    @property
    def digest(self) -> str:
        """A short hash of everything that affects the motion; texts, expectations and default values do not change it."""
        texts: dict[str, Any] = dict.fromkeys(("name", "summary", "source", "tags", "expect"), True)
        physics = self.model_dump_json(exclude=texts | {"body": set(self.body.arrays), "recording": True}, exclude_defaults=True)
        sha = hashlib.sha256(physics.encode())
        for name in self.body.arrays:
            sha.update(getattr(self.body, name).tobytes())
        if self.recording is not None:
            sha.update(self.recording.digest.encode())
        return sha.hexdigest()[:12]

    @property
    def structure(self) -> tuple[str | int | bool, ...]:
        """The non-numeric properties: the shape, the number of vertices, the tables of the scene, and the kind of friction."""
        frictions = [surface.friction if isinstance(surface.friction, str) else "coefficient" for surface in self.surfaces]
        ends = self.floor is not None and self.floor.ends
        return self.body.shape, len(self.body.vertices), self.gravity is None, self.damping is None, ends, *frictions

    def steps(self, dt: float) -> int:
        """The number of whole time steps of dt [s] in the duration."""
        return math.floor(self.duration / dt + 1e-9)

    def starting_at(self, state: Array) -> "Scenario":
        """The same scene with another initial state, shape (13,), and without a recording."""
        values = [float(value) for value in state]
        start = Start(**{name: tuple(values[part]) for name, part in PARTS.items()})
        return self.model_copy(update={"start": start, "recording": None})


def differ_in_start_alone(scenes: Sequence[Scenario]) -> bool:
    """Whether the bodies, gravity, floors and dampings of scenes are the same, so that one model serves all of them."""
    tables = [scene.__dict__ for scene in scenes]  # reading four attributes of each takes twice as long
    first = tables[0]
    # `count` compares values only of what is not the same object; starts of one scene share its tables.
    return all(
        [table[name] for table in tables].count(first[name]) == len(tables) for name in ("body", "gravity", "floor", "wall", "damping")
    )


def initial_states(scenes: Sequence[Scenario]) -> Array:
    """The states of many scenes at t = 0, shape (size, 13): in half of the time of `initial_state` for each."""
    starts = (scene.start for scene in scenes)
    states = [(*start.position, *start.orientation, *start.velocity, *start.angular_velocity) for start in starts]
    return np.array(states, dtype=float).reshape(-1, 13)
