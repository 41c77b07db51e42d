"""A box that slides flat over a rough floor: friction slows it evenly until it stops.

    v(t) = (v₀ - f g t) d,   x(t) = x₀ + (v₀ t - f g t²/2) d   up to the stop at v₀/(f g), after v₀²/(2 f g)

It stays flat as long as the floor's push can act f times the centre's height ahead of it: within the base.

Source: C. A. de Coulomb, Théorie des machines simples (1785).
Valid for: a box or other body on at least three vertices, lying on the floor at the start, without spin, moving horizontally; a Coulomb
coefficient above 0; gravity straight down, no damping. Restitution does not matter: nothing separates.
"""

import numpy as np
from numpy.typing import NDArray

from scenarios.model import TOUCHING, Scenario
from scenarios.rotations import rotate
from scenarios.truths.truth import Truth

Array = NDArray[np.float64]


def coulomb_slide(scene: Scenario) -> Truth | None:
    """The truth of a flat slide."""
    floor, start, g = scene.floor, scene.initial_state, scene.acceleration
    if floor is None or isinstance(floor.friction, str) or scene.damping is not None:
        return None
    straight_down = g[1] < 0.0 and g[0] == 0.0 and g[2] == 0.0
    if not straight_down or start[8] != 0.0 or start[10:13].any() or not start[[7, 9]].any():
        return None
    speed = float(np.linalg.norm(start[7:10]))
    direction = start[7:10] / speed
    slowing = floor.friction * -float(g[1])
    if not _slides_flat(scene, direction, floor.friction):
        return None

    def states(t: Array) -> Array:
        rows = np.tile(start, (len(t), 1))
        moving = np.minimum(t, speed / slowing)[:, None]
        rows[:, 0:3] += (speed * moving - 0.5 * slowing * moving**2) * direction
        rows[:, 7:10] = (speed - slowing * moving) * direction
        return rows

    return Truth("coulomb-slide", "even slowing by friction, v0 - f g t, until it stops (Coulomb)", states, horizon=scene.duration)


def _slides_flat(scene: Scenario, direction: Array, friction: float) -> bool:
    """Whether the floor can push where it must, ahead of the centre by friction times its height: within what the base spans."""
    from scipy.spatial import ConvexHull, QhullError

    offsets = rotate(np.array(scene.start.orientation), scene.body.vertices)
    base = offsets[offsets[:, 1] <= offsets[:, 1].min() + TOUCHING * scene.body.size]
    if abs(scene.clearance) > TOUCHING * scene.body.size or len(base) < 3:
        return False
    try:
        hull = ConvexHull(base[:, [0, 2]])
    except QhullError:  # all on one line
        return False
    ahead = -friction * offsets[:, 1].min() * direction[[0, 2]]
    return bool((hull.equations[:, :2] @ ahead + hull.equations[:, 2]).max() < 0.0)
