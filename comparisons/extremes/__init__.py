"""Where engines break: extremes of steps, spins, heights, inertias, masses, restitutions, durations and sizes."""

from comparisons.extremes.axes import AXES, Axis
from comparisons.extremes.conditions import CONDITIONS
from comparisons.extremes.exploring import Edge, Explored, Point
from comparisons.extremes.study import SCENES, Extremes, Mapped, limits
from comparisons.extremes.surprises import Surprise, surprises

__all__ = ["AXES", "CONDITIONS", "SCENES", "Axis", "Edge", "Explored", "Extremes", "Mapped", "Point", "Surprise", "limits", "surprises"]
