"""A box that lies on a rough floor turns about the vertical: friction at its corners decelerates it uniformly until it stops.

    ω(t) = ω₀ - α t,   φ(t) = ω₀ t - α t²/2,   α = f M g ρ / I     until it stops at t = ω₀/α

ρ is the distance of the corners of the base from the axis. If the centre of mass is above the middle of the base, the corners carry equal
loads, and friction has this moment and no resultant force. If the vertical is a principal axis, the turn does not change the loads.

A tilt θ about the horizontal axes 1 and 2 changes the loads of the corners. The friction of these loads has a moment about the centre of
mass, at the height h, that is perpendicular to the moment of the loads and b = f h/ρ times as large. With I_1, I_2 the moments of inertia
and S_1, S_2 the sums of the corners' squared distances from the axes, contacts of stiffness k give

    I_1 θ_1'' = -k (S_1 θ_1 - b S_2 θ_2),   I_2 θ_2'' = -k (S_2 θ_2 + b S_1 θ_1)

These equations have growing oscillations (flutter), at a rate that increases with k, if (p - q)² < 4 b² p q, p = S_1/I_1, q = S_2/I_2. Only
contacts without restitution suppress the flutter.

Source: C. A. de Coulomb, Théorie des machines simples (1785); Euler's equation about a principal axis; V. V. Bolotin, Nonconservative
Problems of the Theory of Elastic Stability (1963), for the flutter by forces that are not symmetric.
Valid for: a box flat on the floor at the start, with its centre of mass above the middle of its base, turning about the vertical, a
principal axis, and not moving otherwise; a Coulomb coefficient above 0; gravity straight down, no damping. The corners touch the floor, not
the face between them. With restitution, valid only if there is no flutter; restitution then has no effect, because no contact separates.
"""

import math

import numpy as np

from dropspin.scenarios.bodies import Box
from dropspin.scenarios.bodies.inertia import is_diagonal
from dropspin.scenarios.model import TOUCHING, Scenario
from dropspin.scenarios.rotations import about, multiply, unrotate
from dropspin.scenarios.state import ORIENTATION, UP, VELOCITY, Array
from dropspin.scenarios.surfaces import Floor
from dropspin.scenarios.truths.truth import Truth

CENTRED = 1e-9
"""Share of the size, or of the moments of inertia, up to which a difference is one of rounding."""


def coulomb_turn(scene: Scenario, floor: Floor) -> Truth | None:
    """The exact solution of a flat turn."""
    start = scene.initial_state
    if isinstance(floor.friction, str) or not scene.falls_straight_down:
        return None
    if start[VELOCITY].any() or start[10] != 0.0 or start[12] != 0.0 or start[11] == 0.0:
        return None
    lever = _lever(scene)
    if lever is None or (floor.restitution > 0.0 and _flutters(scene, floor.friction / lever)):
        return None
    vertical = unrotate(start[ORIENTATION], UP)
    moment = float(vertical @ scene.body.inertia_tensor @ vertical)
    spin, slowing = float(start[11]), floor.friction * scene.body.mass * -float(scene.acceleration[1]) * lever / moment

    def states(t: Array) -> Array:
        rows = np.tile(start, (len(t), 1))
        turning = np.minimum(t, abs(spin) / slowing)
        left = abs(spin) - slowing * turning
        rows[:, ORIENTATION] = multiply(about(UP, math.copysign(1.0, spin) * 0.5 * (abs(spin) + left) * turning), start[ORIENTATION])
        rows[:, 11] = math.copysign(1.0, spin) * left
        return rows

    statement = "friction at the corners, at a distance ρ from the axis, decelerates the box by f M g ρ/I until it stops (Coulomb)"
    return Truth("coulomb-turn", statement, states, horizon=scene.duration)


def _lever(scene: Scenario) -> float | None:
    """Distance of the base's corners from the axis [m]; None if the box does not lie flat, or its corners carry unequal loads."""
    if not isinstance(scene.body, Box) or not scene.starts_on_floor:
        return None
    base = scene.body.lowest(np.array(scene.start.orientation), TOUCHING)
    vertical = unrotate(np.array(scene.start.orientation), UP)
    wobble = np.cross(vertical, scene.body.inertia_tensor @ vertical)
    is_even = len(base) == 4 and np.abs(base.mean(axis=0)[[0, 2]]).max() <= CENTRED * scene.body.size
    is_principal = np.abs(wobble).max() <= CENTRED * np.trace(scene.body.inertia_tensor)
    return float(np.hypot(base[:, 0], base[:, 2]).mean()) if is_even and is_principal else None


def _flutters(scene: Scenario, friction_over_lever: float) -> bool:
    """Whether the loads of the corners may oscillate with growing amplitude unless impacts damp the oscillation."""
    assert isinstance(scene.body, Box)
    if not is_diagonal(scene.body.inertia_tensor):
        return True  # the equations are about the principal axes, along which the corners are not
    upright = int(np.argmax(np.abs(unrotate(np.array(scene.start.orientation), UP))))
    first, second = (axis for axis in range(3) if axis != upright)
    squares, moments = np.square(scene.body.half_extents), np.diag(scene.body.inertia_tensor)
    p, q = squares[second] / moments[first], squares[first] / moments[second]
    b = friction_over_lever * scene.body.half_extents[upright]
    return bool((p - q) ** 2 < 4.0 * b**2 * p * q)
