"""Labels and styles that all plots and tables share: a colour and a marker per engine, and the label of the exact solution."""

from collections.abc import Sequence

# Okabe & Ito (2008), Color Universal Design: distinguishable with any colour vision, on white and on near black.
KNOWN = {"document": "#0072B2", "mujoco": "#D55E00", "pybullet": "#009E73"}
OTHERS = ("#CC79A7", "#E69F00", "#56B4E9", "#8C8C8C", "#F0E442")
MARKERS = ("o", "s", "D", "^", "v", "P", "X", "*")
EXACT = "exact solution"
"""Label of the exact solution in plots and replays."""


def engine_colours(engines: Sequence[str]) -> dict[str, str]:
    """A colour for each engine; the engines of the default run always have the same."""
    free = iter(OTHERS * len(engines))
    return {engine: KNOWN.get(engine) or next(free) for engine in engines}


def engine_markers(engines: Sequence[str]) -> dict[str, str]:
    """A marker for each engine, so that a plot does not rely on colour."""
    return {engine: MARKERS[number % len(MARKERS)] for number, engine in enumerate(engines)}
