"""The engine `wang`: the reference implementation of the method of Wang's lecture note, and of alternatives to its parts."""

import math
from collections.abc import Sequence
from dataclasses import asdict, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from dropspin import reference_impl
from dropspin.comparisons.engines.base import Array, AsBuilt, BatchSimulation, Engine, KnownLimitation, OneWorld, Simulation
from dropspin.comparisons.engines.mapping import may_tumble
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.measuring.comparison import exactly
from dropspin.comparisons.measuring.metrics import values_of
from dropspin.comparisons.measuring.predictions import bounce_error, flight_error
from dropspin.reference_impl.methods import CONTACTS, LAWS, ROTATIONS
from dropspin.scenarios import DropspinError, Scenario, Truth, truth_for
from dropspin.scenarios.bodies import SHAPES, Body, Box, Sphere, Vertices
from dropspin.scenarios.damping import Damping
from dropspin.scenarios.model import differ_in_start_alone, initial_states
from dropspin.scenarios.surfaces import Floor, Surface


class Wang(Engine):
    """Algorithms 1 and 2 of Wang's lecture note."""

    name = "wang"
    shapes, takes_offsets, takes_walls = SHAPES, True, True
    mixes_scenes = True
    choices: ClassVar = {"rotation": tuple(ROTATIONS), "law": tuple(LAWS), "contact": tuple(CONTACTS)}

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            self.methods()  # checks the combination
        except ValueError as error:
            raise DropspinError(f"engine {self.label!r}: {error}.") from None

    def methods(self) -> reference_impl.Methods:
        """The chosen methods."""
        return reference_impl.Methods(**self.options_in_force)

    def order_in(self, scene: Scenario) -> float | None:
        """The lowest order among the methods that the scene needs; None if one claims none, as contacts do, and factors of a step."""
        if scene.damping is not None and scene.damping.factors:
            return None
        return self.methods().order(gravity=scene.gravity is not None, damping=scene.damping is not None, floor=scene.floor is not None)

    def discretisation(self, scene: Scenario) -> str | None:
        """The discretisation of the flight, and how contacts are treated if there is a floor."""
        flight = self.methods().discretisation(tumbles=may_tumble(scene))
        contacts = f"gravity before the impact, law {self.option('law')}, contact {self.option('contact')}"
        return flight if scene.floor is None else f"{flight}, {contacts}"

    def predicted_error(self, scene: Scenario, truth: Truth | None, metric: str, dt: float) -> float | None:
        """For a flight by eq 6 or by the exact rotation, and for a flat bounce, in which gravity acts before the impact."""
        rotation = self.option("rotation")
        if rotation in ("note", "exact") and scene.floor is None:
            return flight_error(scene, truth, metric, dt, exact_rotation=rotation == "exact")
        return bounce_error(scene, truth, metric, dt, gravity_first=True)

    def declines(self, scene: Scenario) -> str | None:
        """Most laws take no finite coefficient of friction."""
        law = self.option("law")
        for friction in [surface.friction for surface in scene.surfaces]:
            if not isinstance(friction, str) and not self.methods().takes_any_friction:
                return f"law={law} has no Coulomb coefficient ({friction:g}); friction is 'none' or 'infinite', or use law=coulomb"
            if law == "normal" and friction != "none":
                return f"law=normal has no friction; the scene's floor{' or a wall' if scene.wall else ''} has"
        return None

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return WangSimulation(scene, dt, self.methods())

    def prepare_batch(self, members: Sequence[Scenario], dt: float) -> BatchSimulation:
        return WangBatch(members, dt, self.methods())


class WangBatch(BatchSimulation):
    """Simulations of many scenes by the reference implementation, in threads.

    Attributes:
        body: The bodies.
        world: Their worlds.
        simulator: What simulates them.
        taken: The number of steps that were taken.
    """

    def __init__(self, members: Sequence[Scenario], dt: float, methods: reference_impl.Methods) -> None:
        self.velocity_lag = 0.5 * dt
        if differ_in_start_alone(members):
            self.body, self.world = reference_body(members[0].body), reference_world(members[0], dt)
        else:
            self.body = reference_bodies([member.body for member in members])
            self.world = _together([reference_world(member, dt) for member in members])
        self.simulator = reference_impl.Simulator(self.body, self.world, dt, methods)
        self.taken, self._dt = 0, dt
        self._states = initial_states(members)

    def advance(self, steps: int) -> None:
        self.record(steps, max(steps, 1))

    def states(self) -> Array:
        return self._states.copy()

    def record(self, steps: int, every: int = 1) -> Array:
        rows = self.simulator.run(self._states, steps, every)
        self._states = rows[:, -1].copy()
        self.taken += steps
        return rows

    def limitations_of(self, scene: Scenario, states: Array) -> Sequence[str | KnownLimitation]:
        return _limitations_met(scene, self._dt)


class WangSimulation(OneWorld):
    """A simulation of one scene by the reference implementation."""

    def __init__(self, scene: Scenario, dt: float, methods: reference_impl.Methods) -> None:
        self._batch = WangBatch([scene], dt, methods)
        super().__init__(scene, self._batch)
        self.settings = {"version": version("dropspin"), "numba": version("numba"), **asdict(methods)}

    def record(self, steps: int, every: int = 1) -> Array:
        [rows] = self._batch.record(steps, every)
        return rows

    @property
    def known_limitations(self) -> Sequence[str | KnownLimitation]:  # type: ignore[override]  # computed when they are asked for
        """Factors of damping in steps of another size, and contacts that were not solved."""
        unsolved = self._batch.simulator.unsolved_steps
        own = [f"the contact was not solved in {unsolved} of {self._batch.taken} steps"] if unsolved else []
        return [*self._batch.limitations_of(self._scene, self._batch.states()), *own]

    def as_built(self) -> AsBuilt:
        body, gravity = self._batch.body, self._batch.world.gravity
        return AsBuilt(float(body.mass), body.inertia, np.zeros(3) if gravity is None else gravity)


def reference_body(body: Body) -> reference_impl.Body:
    """A scene's body in the form that the reference implementation takes."""
    return reference_impl.Body(body.mass, _inertia(body), body.vertices, body.semi_axes)


def reference_bodies(bodies: Sequence[Body]) -> reference_impl.Body:
    """The bodies of an ensemble in the form that the reference implementation takes."""
    return _together([reference_body(body) for body in bodies])


def _inertia(body: Body) -> Array:
    """The inertia tensor by the formulas of the lecture note; `Body.inertia_tensor` computes the same independently."""
    if body.inertia == "note":
        return reference_impl.vertex_inertia(body.vertices, np.ones(len(body.vertices)))
    if isinstance(body, Sphere) and body.inertia == "solid":
        return reference_impl.solid_sphere_inertia(body.mass, body.radius)
    if isinstance(body, Box) and body.inertia == "solid":
        return reference_impl.solid_box_inertia(body.mass, np.array(body.half_extents))
    if body.inertia != "vertices":
        return body.inertia_tensor
    masses = body.masses if isinstance(body, Vertices) else None
    share = np.full(len(body.vertices), body.mass / len(body.vertices)) if masses is None else np.array(masses)
    return reference_impl.vertex_inertia(body.vertices, share)


def _limitations_met(scene: Scenario, dt: float) -> list[KnownLimitation]:
    """That factors of a step act in steps of another size, as Algorithm 1 has it.

    It explains the errors of the exact motion that is damped so, and a tenth more, because the scheme has errors beside them.
    """
    meant = scene.factor_dt or dt
    if scene.damping is None or math.isclose(meant, dt, rel_tol=1e-9):
        return []
    share = meant / dt
    own = scene.model_copy(update={"damping": Damping(**{motion: share * rate for motion, rate in scene.damping.rates.items()})})
    truth, damped, sizes = truth_for(scene), truth_for(own), {}
    if truth is not None and damped is not None:
        times = dt * np.arange(scene.steps(dt) + 1, dtype=np.float64)
        sizes = {name: 1.1 * abs(size) for name, size in values_of(scene, truth, exactly(damped, times)).items() if math.isfinite(size)}
    text = f"Algorithm 1 applies the factors of damping in each step: they are meant at {meant:g} s, and damp {share:.3g} times as much"
    return [KnownLimitation(text, sizes)]


def reference_world(scene: Scenario, dt: ArrayLike) -> reference_impl.World:
    """A scene's gravity, floor, walls and damping in the form that the reference implementation takes, for time steps [s]."""
    damping = scene.damping
    share = 1.0 if damping is None or damping.factor_dt is None else damping.factor_dt / np.asarray(dt)
    walls = (reference_impl.Wall(np.array(wall.point), np.array(wall.normal), _surface(wall)) for wall in scene.wall or ())
    return reference_impl.World(
        gravity=None if scene.gravity is None else scene.acceleration,
        floor=None if scene.floor is None else _floor(scene.floor),
        damping=None if damping is None else (share * damping.linear, share * damping.angular),
        walls=tuple(walls),
    )


def _surface(surface: Surface) -> reference_impl.Floor:
    return reference_impl.Floor(surface.restitution, surface.coefficient, surface.rest_speed)


def _floor(floor: Floor) -> reference_impl.Floor:
    if not floor.ends:
        return _surface(floor)
    extents, thickness = floor.half_extents or (math.inf, math.inf), floor.thickness or math.inf
    return _surface(floor)._replace(half_extents=np.array(extents), thickness=thickness)


def _together(members: Sequence[Any]) -> Any:
    """Bodies, or worlds of one structure, as one with a row for each."""
    return type(members[0])(*(_in_rows([getattr(member, part.name) for member in members]) for part in fields(members[0])))


def _in_rows(values: Sequence[Any]) -> Any:
    """Values of many bodies or worlds as one with a row for each: numbers, arrays, tuples of them, or None."""
    if not isinstance(values[0], tuple):
        return None if values[0] is None else np.array(values)
    parts = [_in_rows(column) for column in zip(*values, strict=True)]
    return type(values[0])(*parts) if hasattr(values[0], "_fields") else tuple(parts)
