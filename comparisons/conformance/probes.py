"""Probes: scenes built to distinguish the faults of adapters, and short runs of them.

No two axes, frames, sizes or rates are equal in a probe.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.conformance.outcomes import Declined
from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.running.recording import record
from dropspin.scenarios import Scenario, Trajectory, Truth, truth_for
from dropspin.scenarios.loading import from_mapping
from dropspin.scenarios.rotations import angle_between_orientations
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY

Array = NDArray[np.float64]
Errors = tuple[float, float, float, float]
Table = dict[str, Any]

DT = 2.5e-4
"""The time step [s]; so short that the discretisation error of any engine is small beside the error of a fault."""
TILT = [0.1825741858350554, 0.3651483716701107, 0.5477225575051661, 0.7302967433402214]  # (1, 2, 3, 4)/√30
CUBE = {"shape": "box", "half_extents": [0.2, 0.2, 0.2], "mass": 2.7}
BALL = {"shape": "sphere", "radius": 0.1, "mass": 2.7}
BLOCK = {"shape": "box", "half_extents": [0.11, 0.2, 0.29], "mass": 2.7, "inertia": [0.05, 0.07, 0.1]}
ASKEW = {"shape": "vertices", "points": [[0.2, 0.0, 0.1], [-0.1, 0.3, 0.0], [0.0, -0.2, 0.25], [0.1, 0.1, -0.3]], "mass": 2.7}
PLATE = {"shape": "box", "half_extents": [0.2, 0.05, 0.3], "mass": 2.7}
FALL = {"acceleration": [0.0, -7.0, 0.0]}
MOVING = {"position": [1.0, 2.0, -3.0], "velocity": [0.5, -1.25, 2.0]}
TURNING = {"orientation": TILT, "angular_velocity": [1.0, -2.0, 3.0]}
TUMBLING = {"orientation": TILT, "angular_velocity": [2.0, -5.0, 4.0]}
ON_CORNER: Table = {"position": [0.0, 0.65, 0.0], "orientation": TILT}


@dataclass(frozen=True)
class Probe:
    """A scene, and the errors that an engine may have.

    Attributes:
        name: The name of its check.
        scene: The scene.
        allowed: The largest errors of position [m], attitude [rad], velocity [m/s], angular velocity [rad/s]; inf where not compared.
    """

    name: str
    scene: Scenario
    allowed: Errors

    @property
    def times(self) -> Array:
        """The times of comparison [s]: half of the duration and the end."""
        return DT * self.rows

    @property
    def rows(self) -> Array:
        """The steps after which states are compared."""
        steps = self.scene.steps(DT)
        return np.array([steps // 2, steps])

    @property
    def exact(self) -> Array:
        """The states of the exact solution at these times, shape (2, 13)."""
        return exact_solution(self.scene)(self.times).states

    def off(self, found: Array, expected: Array) -> Array:
        """The largest difference of states, shape (2, 13), from others, shape (..., 2, 13), over the allowed one; inf if not finite."""
        worst = np.max(differences(found, expected) / np.array(self.allowed), axis=-1)
        return np.where(np.isfinite(worst), worst, np.inf)


def differences(found: Array, expected: Array) -> Array:
    """The largest differences of position [m], attitude [rad], velocity [m/s], angular velocity [rad/s], shape (..., 4)."""
    position, velocity, spin = (np.linalg.norm(found[..., part] - expected[..., part], axis=-1) for part in (POSITION, VELOCITY, SPIN))
    turned = angle_between_orientations(found[..., ORIENTATION], expected[..., ORIENTATION])
    return np.stack([position, turned, velocity, spin], axis=-1).max(axis=-2)


def _probe(name: str, allowed: Errors, body: Table, duration: float = 0.5, **tables: Any) -> Probe:
    return Probe(name, from_mapping({"name": name.replace(" ", "-"), "duration": duration, "body": body, **tables}), allowed)


def _impact(
    name: str, allowed: Errors, body: Table, restitution: float, friction: str | float = "none", duration: float = 0.5, **start: Any
) -> Probe:
    """A body that falls 0.4 m onto a floor, unless it starts elsewhere."""
    floor, start = {"restitution": restitution, "friction": friction}, {"position": [0.0, 0.4, 0.0]} | start
    return _probe(name, allowed, body, duration, start=start, gravity=FALL, floor=floor)


PROBES = (
    _probe("coasting", (1e-3, 1e-4, 1e-3, 1e-4), BALL, start=MOVING | {"orientation": TILT}),
    _probe("turning", (1e-6, 0.01, 1e-6, 0.01), CUBE, start=TURNING),
    _probe("tumbling", (1e-3, 0.02, 1e-3, 0.06), BLOCK, start=MOVING | TUMBLING | {"velocity": [0.5, -1.25, 2.25]}),
    _probe("tumbling askew", (1e-6, 0.02, 1e-6, 0.06), ASKEW, start=TUMBLING),
    _probe("falling", (2e-3, 1e-4, 2e-3, 1e-4), BALL, start=MOVING, gravity={"acceleration": [1.5, -7.0, 3.0]}),
    _probe("falling straight", (2e-3, 1e-4, 2e-3, 1e-4), BALL, start=MOVING, gravity=FALL),
    _probe(
        "damped",
        (1e-3, 1e-2, 1e-3, 1e-2),
        CUBE,
        start=TURNING | {"velocity": [0.5, -1.25, 2.0]},
        damping={"linear": 0.8, "angular": 0.3},
    ),
    _probe(
        "creeping",
        (1e-5, 1e-5, 2e-5, 2e-5),
        CUBE,
        4.0,
        start={"velocity": [1e-3, 0.0, 2e-3], "angular_velocity": [0.0, 2e-3, 1e-3]},
    ),
    _probe("fast", (inf, inf, 0.3, 0.3), CUBE, 0.05, start={"velocity": [300.0, 0.0, 0.0], "angular_velocity": [0.0, 300.0, 0.0]}),
    _impact("bouncing ball", (8e-4, 1e-4, 7e-3, 1e-4), BALL, 0.6),
    _impact("dull ball", (8e-4, 1e-4, 7e-3, 1e-4), BALL, 0.3),
    _impact("lively ball", (2e-3, 1e-4, 7e-3, 1e-4), BALL, 1.0),
    _impact("slow ball", (1e-4, 1e-4, 6e-3, 1e-4), BALL, 0.6, duration=0.03, position=[0.0, 0.1007, 0.0]),
    _impact("bouncing box", (3e-3, 1e-2, 7e-3, 2e-2), {"shape": "box", "half_extents": [0.16, 0.1, 0.23], "mass": 2.7}, 0.6),
    _impact(
        "gripping floor",
        (4e-3, 0.05, 0.03, 0.4),
        BALL,
        0.6,
        "infinite",
        velocity=[0.5, 0.0, 0.3],
        angular_velocity=[80.0, 20.0, -100.0],
    ),
    _impact("slippery floor", (4e-3, 0.02, 0.01, 0.1), BALL, 0.6, 0.12, velocity=[6.0, 0.0, 3.6], angular_velocity=[4.0, 2.0, -6.0]),
    _impact("sliding box", (3e-3, 0.01, 0.01, 0.03), PLATE, 0.0, 0.3, position=[0.0, 0.05, 0.0], velocity=[2.0, 0.0, 0.0]),
    _impact("corner", (3e-3, 0.03, 0.02, 0.1), BLOCK, 0.6, duration=0.36, **ON_CORNER),
    _impact("gripping corner", (3e-3, 0.03, 0.02, 0.1), BLOCK, 0.6, "infinite", duration=0.36, **ON_CORNER),
)

A_FEW_STEPS = 24
FLIGHTS = ("tumbling", "turning", "falling straight", "coasting")
RICHEST = ("corner", "bouncing ball", *FLIGHTS)
"""Names of probes, those that involve most of an engine first."""


def accepted_scene(engine: Engine, *preferred: str) -> Scenario:
    """The first of some probes' scenes that an engine accepts, by default of `RICHEST`; one above a floor begins shortly before an impact.

    Raises:
        Declined: The engine accepts none of them.
    """
    probes = {probe.name: probe for probe in PROBES}
    refusal = None
    for name in preferred or RICHEST:
        scene = probes[name].scene
        refusal = engine.refusal(scene)
        if refusal is None:
            return _shortly_before_contact(scene) if scene.starts_above_floor else scene
    raise Declined(f"the engine declines {', '.join(preferred or RICHEST)}: {refusal}")


def _shortly_before_contact(scene: Scenario) -> Scenario:
    """The scene, started so late that a few steps reach the floor."""
    exact = exact_solution(scene)
    return scene.starting_at(exact(exact.events[0].time - 5.5 * DT).states[0])


def exact_solution(scene: Scenario) -> Truth:
    """The exact solution of a probe's scene; each probe has one."""
    truth = truth_for(scene)
    assert truth is not None
    return truth


def few_steps(engine: Engine, scene: Scenario, dt: float) -> Trajectory:
    """The motion of a few recorded steps."""
    few = scene.model_copy(update={"duration": (A_FEW_STEPS + 0.5) * dt})
    return record(engine, few, dt, verify=False).motion


def recorded(engine: Engine, scene: Scenario, dt: float = DT) -> Array:
    """The states of a few recorded steps, shape (1 + A_FEW_STEPS, 13)."""
    return few_steps(engine, scene, dt).states


def state_after(engine: Engine, scene: Scenario, calls: Iterable[int], before: Callable[[], None] = lambda: None) -> Array:
    """The state after calls of `advance` with some steps each, with something else before each of them, shape (13,)."""
    with engine.prepare(scene, DT) as simulation:
        for steps in calls:
            before()
            simulation.advance(steps)
        return simulation.state().copy()
