"""A box slides flat over a rough floor: friction decelerates it uniformly until it stops.

    v(t) = (v₀ - f g t) d,   x(t) = x₀ + (v₀ t - f g t²/2) d   until it stops at t = v₀/(f g), after v₀²/(2 f g)

The box stays flat if the normal force can act ahead of the centre of mass by f times its height, a point that must lie within the base.

Source: C. A. de Coulomb, Théorie des machines simples (1785).
Valid for: a box or other body on at least three vertices, lying on the floor at the start, without spin, moving horizontally; a Coulomb
coefficient above 0; gravity straight down, no damping. Restitution has no effect, because no contact separates.
"""

import numpy as np
from numpy.typing import NDArray

from scenarios.model import TOUCHING, Scenario
from scenarios.rotations import rotate
from scenarios.state import POSITION, SPIN, VELOCITY
from scenarios.truths.truth import Truth

Array = NDArray[np.float64]


def coulomb_slide(scene: Scenario) -> Truth | None:
    """The exact solution of a flat slide."""
    floor, start, g = scene.floor, scene.initial_state, scene.acceleration
    if floor is None or isinstance(floor.friction, str) or scene.damping is not None:
        return None
    straight_down = g[1] < 0.0 and g[0] == 0.0 and g[2] == 0.0
    if not straight_down or start[8] != 0.0 or start[SPIN].any() or not start[[7, 9]].any():
        return None
    speed = float(np.linalg.norm(start[VELOCITY]))
    direction = start[VELOCITY] / speed
    slowing = floor.friction * -float(g[1])
    if not _slides_flat(scene, direction, floor.friction):
        return None

    def states(t: Array) -> Array:
        rows = np.tile(start, (len(t), 1))
        moving = np.minimum(t, speed / slowing)[:, None]
        rows[:, POSITION] += (speed * moving - 0.5 * slowing * moving**2) * direction
        rows[:, VELOCITY] = (speed - slowing * moving) * direction
        return rows

    return Truth("coulomb-slide", "uniform deceleration by friction, v0 - f g t, until it stops (Coulomb)", states, horizon=scene.duration)


def _slides_flat(scene: Scenario, direction: Array, friction: float) -> bool:
    """Whether the normal force can act ahead of the centre of mass by friction coefficient times height, within the base."""
    from scipy.spatial import ConvexHull, QhullError

    offsets = rotate(np.array(scene.start.orientation), scene.body.vertices)
    base = offsets[offsets[:, 1] <= offsets[:, 1].min() + TOUCHING * scene.body.size]
    if abs(scene.clearance) > TOUCHING * scene.body.size or len(base) < 3:
        return False
    try:
        hull = ConvexHull(base[:, [0, 2]])
    except QhullError:  # collinear
        return False
    ahead = -friction * offsets[:, 1].min() * direction[[0, 2]]
    return bool((hull.equations[:, :2] @ ahead + hull.equations[:, 2]).max() < 0.0)
