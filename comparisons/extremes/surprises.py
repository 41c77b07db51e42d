"""What nobody would expect, first: where an engine breaks that others do not, all of a sudden, near the scene's own values."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from comparisons.extremes.conditions import CONDITIONS
from comparisons.extremes.exploring import Explored, Point

SAME_PLACE = 0.05
"""Along an axis: edges that are nearer to each other are the same."""
WELL = ("sound", "declined")
SUDDEN = 20.0
"""The power of the value by which an error grows at an edge; that of a method is its order, 4 at most, and of rounding less."""


@dataclass(frozen=True)
class Surprise:
    """An edge beyond which one engine, or several alike, come to a worse condition.

    Attributes:
        explored: The first of these engines along the axis.
        engines: All of them.
        inside: The last point before the edge, on the side of the scene's own value; None if the condition is the scene's own.
        outside: The first one beyond.
        sound: Engines that are sound there.
        sudden: Whether the error rises at the edge as no method's does.
    """

    explored: Explored
    engines: tuple[str, ...]
    inside: Point | None
    outside: Point
    sound: tuple[str, ...]
    sudden: bool


def surprises(explored: Sequence[Explored]) -> list[Surprise]:
    """The worsenings of all engines along all axes, the most surprising first; engines that worsen alike together.

    What an engine does at the scene's own values is told once, whatever the axis.
    """
    found: list[Surprise] = []
    for one in explored:
        beside = [other for other in explored if other.scene is one.scene and other.axis is one.axis and other is not one]
        for inside, outside in _worsenings(one):
            sudden = _is_sudden(one, inside, outside)
            twin = next((known for known in found if known.sudden == sudden and _are_alike(known, one, inside, outside)), None)
            if twin is None:
                sound = tuple(other.engine for other in beside if other.at(outside.value).condition == "sound")
                found.append(Surprise(one, (one.engine,), inside, outside, sound, sudden))
            elif one.engine not in twin.engines:
                found[found.index(twin)] = replace(twin, engines=(*twin.engines, one.engine))
    ranked = sorted(found, key=_rank)
    # The first of each kind first: the same fault shows along several axes of a scene.
    kinds = [(one.outside.finding.criterion, one.sudden, one.engines[0], one.explored.scene.name) for one in ranked]
    return [ranked[number] for number in sorted(range(len(ranked)), key=lambda number: kinds.index(kinds[number]) < number)]


def _worsenings(one: Explored) -> Iterator[tuple[Point | None, Point]]:
    """The scene's own point if it is not sound; then outwards, both ways, each point that is worse than all before it."""
    own = one.at(one.base)
    number = one.points.index(own)
    if own.condition not in WELL:
        yield None, own
    for way in (one.points[number + 1 :], one.points[number - 1 :: -1] if number else ()):
        worst, before = own, own
        for point in way:
            if point.condition not in WELL and CONDITIONS.index(point.condition) > CONDITIONS.index(worst.condition):
                yield before, point
                worst = point
            before = point


def _is_sudden(one: Explored, inside: Point | None, outside: Point) -> bool:
    if inside is None or inside.finding.criterion != outside.finding.criterion or not inside.finding.figure > 0.0:
        return False
    apart = abs(one.axis.coordinate(outside.value) - one.axis.coordinate(inside.value))
    return math.isfinite(outside.finding.figure) and math.log(outside.finding.figure / inside.finding.figure) > SUDDEN * apart


def _are_alike(known: Surprise, one: Explored, inside: Point | None, outside: Point) -> bool:
    if known.explored.scene is not one.scene or known.outside.condition != outside.condition:
        return False
    if known.inside is None or inside is None:
        return known.inside is inside and known.outside.finding.criterion == outside.finding.criterion
    coordinate = one.axis.coordinate
    return known.explored.axis is one.axis and abs(coordinate(known.outside.value) - coordinate(outside.value)) < SAME_PLACE


def _rank(surprise: Surprise) -> tuple[bool, bool, float]:
    """What others do well is a surprise; a sudden end, or a bad one, is; near the scene's own values it is more of one than far away."""
    explored = surprise.explored
    coordinate = explored.axis.coordinate
    is_bad = surprise.sudden or CONDITIONS.index(surprise.outside.condition) > CONDITIONS.index("inaccurate")
    far = 0.0 if surprise.inside is None else abs(coordinate(surprise.outside.value) - coordinate(explored.base))
    return not surprise.sound, not is_bad, far
