"""Film strips: the bodies of all engines and of the exact solution at the moments that matter, as paths of an SVG picture."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dropspin.reports.replay.motions import Motion, Replay, Rows
from dropspin.scenarios.bodies.hull import convex_hull
from dropspin.scenarios.bodies.outline import Outline
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.state import Array

PANEL = np.array([110.0, 84.0])
LEFT, TOP = 104.0, 18.0
"""Sizes of the names of engines, left of the panels, and of the moments, above them."""
RADIUS = 36.0
"""Size of what is shown around the body, in the units of a panel."""
FARTHEST = 1.2
"""Largest distance from the reference at which a body is drawn, relative to its size; of others an arrow shows where they are."""
TURN = np.radians(25.0)
RIGHT, UP, TOWARDS = np.array([[np.cos(TURN), 0.0, -np.sin(TURN)], [0.0, 1.0, 0.0], [np.sin(TURN), 0.0, np.cos(TURN)]])
MOST_FACES = 14
"""Number of faces up to which each is drawn; of more, the outline of the body."""


@dataclass(frozen=True, eq=False)
class Strip:
    """A film strip: a column for each moment and a row for each engine.

    Attributes:
        moments: What each moment is, with its time.
        exact: The path of the bodies of the reference, the same in each row; empty without one.
        floor: The path of the floor.
        rows: The label, the colour and the path of each engine.
        reference: What the reference is.
        difference: The largest distance relative to the size of the body, or angle in half turns, of an engine; at most 1.
        shows_impact: Whether one of the moments is an impact of a body that is no ball.
    """

    moments: Sequence[str]
    exact: str
    floor: str
    rows: Sequence[tuple[str, str, str]]
    reference: str
    difference: float
    shows_impact: bool


def strip_of(replay: Replay) -> Strip:
    """The film strip of a replay, seen from the side."""
    *_, last = replay.motions
    has_reference = not last.colour
    engines = replay.motions[:-1] if has_reference else replay.motions
    middle = last if has_reference else engines[0]
    moments = _moments(middle, replay.dt, replay.interval)
    times, size, shape = np.array(list(moments.values())), replay.scene.body.size, replay.scene.body.outline
    centres = middle.frames.position[_rows(middle, times)]
    away = [_offsets(motion, times, centres, replay.interval) for motion in engines]
    farthest = np.nanmax(np.minimum(np.linalg.norm(away, axis=-1), FARTHEST * size), initial=0.0)
    pixels = RADIUS / (size + 0.5 * farthest)

    def path(motion: Motion, offsets: Array) -> str:
        drawn, orientations = "", motion.frames.orientation[_rows(motion, times)]
        for column, (orientation, offset) in enumerate(zip(orientations, offsets, strict=True)):
            origin = [LEFT, TOP] + PANEL * [column + 0.5, 0.5]
            if np.linalg.norm(offset) > FARTHEST * size:
                drawn += _arrow(origin, offset)
            elif np.isfinite(offset).all():
                drawn += _body(shape, orientation, origin, offset, pixels)
        return drawn

    return Strip(
        moments=[f"{name}, {time:.3g} s" for name, time in moments.items()],
        exact=path(last, np.zeros((len(times), 2))) if has_reference else "",
        floor="" if replay.scene.floor is None else _floor(centres[:, 1] * pixels),
        rows=[(motion.label, motion.colour, path(motion, offsets)) for motion, offsets in zip(engines, away, strict=True)],
        reference=last.label if has_reference else "",
        difference=max((_difference(motion, times, size) for motion in engines), default=0.0),
        shows_impact="impact" in moments and not shape.radius,
    )


def _moments(motion: Motion, dt: float, interval: float) -> dict[str, float]:
    """The moments by name [s]: the time step of the first impact and frames around it, or evenly spaced frames if there is none."""
    end, impacts = float(motion.frames.t[-1]), motion.impacts.times
    if len(impacts):
        following = float(impacts[1]) if len(impacts) > 1 else end
        found = {"start": 0.0, "impact": float(impacts[0]), "after": 0.5 * (float(impacts[0]) + following), "end": end}
    else:
        found = {"start": 0.0, "a third": end / 3.0, "two thirds": 2.0 * end / 3.0, "end": end}
    steps = {name: dt if name == "impact" else interval for name in found}
    return {name: steps[name] * round(time / steps[name]) for name, time in found.items()}


def _rows(motion: Motion, times: Array) -> Rows:
    """The frames that are nearest to times [s], shape (columns,)."""
    return np.abs(motion.frames.t - times[:, None]).argmin(axis=1)


def _offsets(motion: Motion, times: Array, centres: Array, interval: float) -> Array:
    """How far a body is from the middle of each panel, to the right and up [m], shape (columns, 2); NaN after its last state."""
    away = np.stack([np.interp(times, motion.frames.t, column) for column in motion.frames.position.T], axis=1) - centres
    is_over = motion.frames.t[-1] <= times - interval
    return np.where(is_over[:, None], np.nan, np.stack([away @ RIGHT, away @ UP], axis=1))


def _difference(motion: Motion, times: Array, size: float) -> float:
    if motion.errors is None:
        return 0.0
    errors = motion.errors[_rows(motion, times)] / [size, np.pi]
    return float(min(np.nanmax(errors, initial=0.0), 1.0))


def _body(shape: Outline, orientation: Array, origin: Array, offset: Array, pixels: float) -> str:
    """The faces of a body that are seen, or the outline of a body with many; a ball is a circle with fields."""
    centre = origin + offset * [pixels, -pixels]

    def polygon(points: Array) -> str:
        seen = np.rint(centre + pixels * np.stack([points @ RIGHT, -(points @ UP)], axis=-1)).astype(int)
        numbers = " ".join(map(str, np.diff(seen, axis=0).ravel().tolist())).replace(" -", "-")
        return f"M{seen[0, 0]} {seen[0, 1]}l{numbers}z"

    polygons = [rotate(orientation, points) for points in shape.polygons(8)]
    if shape.radius:
        x, y, r = *centre, shape.radius * pixels
        facing = [points for points in polygons if points.mean(axis=0) @ TOWARDS > 0.0]
        arcs = f"a{r:.0f} {r:.0f} 0 1 0 {2 * r:.0f} 0a{r:.0f} {r:.0f} 0 1 0 {-2 * r:.0f} 0"
        return f"M{x - r:.0f} {y:.0f}{arcs}{''.join(map(polygon, facing))}"
    if len(polygons) > MOST_FACES:
        corners = rotate(orientation, shape.vertices)
        hull = convex_hull(np.stack([corners @ RIGHT, corners @ UP], axis=-1))
        return polygon(corners if hull is None else corners[hull.vertices])
    return "".join(polygon(points) for points in polygons if shape.is_flat or _faces_viewer(points))


def _faces_viewer(points: Array) -> bool:
    return bool(np.cross(points[1] - points[0], points[2] - points[1]) @ TOWARDS > 0.0)


def _arrow(origin: Array, offset: Array) -> str:
    """An arrow that points to a body outside the panel."""
    along = offset / np.linalg.norm(offset) * [1.0, -1.0]
    tip, across = origin + 38.0 * along, np.array([-along[1], along[0]])
    points = [origin + 18.0 * along, tip, tip - 7.0 * along + 4.0 * across, tip - 7.0 * along - 4.0 * across]
    start, end, *barbs = [f"{x:.0f},{y:.0f}" for x, y in points]
    return f"M{start} {end}M{' '.join([barbs[0], end, barbs[1]])}"


def _floor(heights: Array) -> str:
    """The floor below bodies at some heights above it, in the units of a panel; left out where it is below the panel."""
    lines = [(LEFT + PANEL[0] * column, TOP + 0.5 * PANEL[1] + height) for column, height in enumerate(heights)]
    return "".join(f"M{x + 6:.0f},{y:.0f}h{PANEL[0] - 12:.0f}" for x, y in lines if y < TOP + PANEL[1] - 1.0)
