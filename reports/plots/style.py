"""How plots look: the colours of the page they stand in, sizes that keep lines apart which coincide, axis labels with units."""

from collections.abc import Callable, Iterator, Mapping
from textwrap import fill
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from comparisons.measuring.metrics import METRICS
from comparisons.results.results import Results
from reports.plots.colours import engine_colours, engine_markers
from scenarios import Scenario, Trajectory, Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

Array = NDArray[np.float64]
Kept = TypeVar("Kept")
ByStep = Mapping[tuple[str, str, float], Kept]
"""What a run keeps of each scene, engine and step."""

INK, FAINT = "#010203", "#040506"
"""Stand-ins for the page's text colour: the report replaces them, so that one plot serves light and dark."""
REPORT: Any = {
    "text.parse_math": False,  # names are text, whatever dollars are in them
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": FAINT,
    "xtick.color": INK,
    "ytick.color": INK,
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": FAINT,
    "grid.alpha": 0.15,
    "axes.facecolor": "none",
    "figure.facecolor": "none",
    "legend.frameon": False,
}
TIME = "time [s]"
"""Label of every axis of time, by which a replay knows where to show its own."""
MOST_POINTS = 400
ROUNDING = 1e-17
"""Where exact zeros are drawn on logarithmic axes."""

WIDEST_LABEL = 26
LEAST, MANY = 5.0, 50.0
"""How far a logarithmic axis reaches at least, and from where on powers of ten alone label it."""
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def ink() -> str:
    """The colour of what belongs to no engine: the text's, in a report as in a notebook of whatever style."""
    from matplotlib import rcParams

    return str(rcParams["text.color"])


def thinned(motion: Trajectory) -> Trajectory:
    """A motion at no more times than a plot can show."""
    return motion[:: stride(len(motion))]


def stride(length: int) -> int:
    """Which of so many points to draw: each so-manyeth."""
    return max(1, -(-length // MOST_POINTS))


def thinner(first: float, last: float, number: int, count: int) -> float:
    """Sizes from first to last: engines often coincide, and what is drawn later must leave the earlier visible."""
    return float(np.linspace(first, last, max(count, 2))[number])


def step_of(kept: ByStep[Kept], scene_name: str, which: Callable[..., float]) -> float:
    """The finest or coarsest step, by `min` or `max`, at which something of a scene is kept [s]; 0 if nothing is."""
    return which((dt for name, _, dt in kept if name == scene_name), default=0.0)


def at_one_step(
    results: Results, kept: ByStep[Kept], scene_name: str, which: Callable[..., float], least_marker: float | None = None
) -> Iterator[tuple[Kept, dict[str, Any]]]:
    """What is kept of each engine at the step of `step_of`, and how its line looks; with markers down to a size, if one is given."""
    dt, count = step_of(kept, scene_name, which), len(results.engines)
    colours, markers = engine_colours(results.engines), engine_markers(results.engines)
    for number, engine in enumerate(results.engines):
        found = kept.get((scene_name, engine, dt))
        if found is not None:
            look = {"color": colours[engine], "linewidth": thinner(3.8, 1.2, number, count), "label": engine}
            if least_marker is not None:
                size = thinner(9.0, least_marker, number, count)
                look |= {"marker": markers[engine], "markerfacecolor": "none", "markersize": size}
            yield found, look


def as_truth() -> dict[str, Any]:
    """How the truth's line looks: thin, dashed, in the text's colour."""
    return {"color": ink(), "linewidth": 1.0, "linestyle": (0, (3, 3)), "label": "truth"}


def exactly(scene: Scenario, truth: Truth) -> Trajectory:
    """The truth for as long as a scene lasts and it is known, at as many times as a plot can show."""
    return truth(np.linspace(0.0, min(scene.duration, truth.horizon), MOST_POINTS))


def metric_label(metric: str) -> str:
    """A metric's name and unit, in lines that are no longer than an axis."""
    unit = METRICS[metric].unit
    return fill(metric.replace("_", " ") + ("" if unit == "1" else f" [{unit}]"), WIDEST_LABEL)


def label_powers(axes: "Axes", name: str) -> None:
    """Label a logarithmic axis, `x` or `y`, that has its data: at powers of ten, and between them where there are hardly two.

    In plain text: a page sets it in its own font, and parsing formulas takes half of the time of a figure.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    if not axes.has_data():  # no engine got as far
        return
    axis: Axis = getattr(axes, f"{name}axis")
    low, high = axis.get_view_interval()
    if high < LEAST * low:  # else nothing round is in it
        middle = float(np.sqrt(low * high))
        low, high = middle / LEAST**0.5, middle * LEAST**0.5
        axes.set(**{f"{name}lim": (low, high)})
    axis.set_major_locator(LogLocator(subs=(1.0,) if high > MANY * low else (1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: power(value)))
    axis.set_minor_locator(NullLocator())


def power(value: float) -> str:
    """A number as 10⁻³ or 2.5×10⁻³."""
    digits, exponent = f"{value:.2e}".split("e")
    raised = "10" + str(int(exponent)).translate(RAISED)
    return raised if float(digits) == 1.0 else f"{float(digits):g}×{raised}"
