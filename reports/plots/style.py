"""The style of plots: line widths at which coinciding lines stay visible; axis labels with units."""

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import chdir
from importlib import import_module
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS
from dropspin.comparisons.results.results import Results
from dropspin.reports.plots.colours import engine_styles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

Array = NDArray[np.float64]
Kept = TypeVar("Kept")
ByStep = Mapping[tuple[str, str, float], Kept]
"""Trajectories or ensemble outcomes of a run, by scene, engine and time step."""

REPORT: Any = {
    "text.parse_math": False,  # dollar signs in names are text
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "black",
    "grid.alpha": 0.15,
    "axes.facecolor": "none",
    "figure.facecolor": "none",
    "legend.frameon": False,
}
TIME = "time [s]"
"""Label of every time axis; the replay marks its current time in plots with this label."""
MOST_POINTS = 400
ROUNDING = 1e-17
"""Value at which exact zeros are drawn on logarithmic axes."""

WIDEST_LABEL = 26
LEAST_RATIO, MANY = 5.0, 50.0
"""Smallest ratio of the ends of a logarithmic axis, and the ratio above which only powers of ten are labelled."""
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def load_matplotlib() -> None:
    """Import matplotlib without the settings of the working directory and the user; a damaged settings file prevents the import."""
    if "matplotlib" not in sys.modules:
        with chdir(Path(__file__).parent):  # of the places where matplotlib finds settings, the working directory is the first
            import_module("matplotlib")


def ink() -> str:
    """The text colour of the current matplotlib style, for elements that belong to no engine."""
    from matplotlib import rcParams

    return str(rcParams["text.color"])


def stride(length: int) -> int:
    """The stride with which at most `MOST_POINTS` of `length` points are drawn."""
    return max(1, -(-length // MOST_POINTS))


def thinner(number: int, count: int) -> float:
    """The width of the line of an engine by its number [points], so that later lines do not hide coinciding earlier ones."""
    return float(np.linspace(3.8, 1.2, max(count, 2))[number])


def step_of(kept: ByStep[Kept], scene_name: str, which: Callable[..., float]) -> float:
    """The finest or coarsest time step, by `min` or `max`, for which there is an entry of the scene [s]; 0 if there is none."""
    return which((dt for name, _, dt in kept if name == scene_name), default=0.0)


def at_one_step(
    results: Results, kept: ByStep[Kept], scene_name: str, which: Callable[..., float]
) -> Iterator[tuple[Kept, dict[str, Any]]]:
    """For each engine, the entry at the time step of `step_of`, and the label, colour, marker and width of its line."""
    dt, count = step_of(kept, scene_name, which), len(results.engines)
    styles = engine_styles(results.engines)
    for number, engine in enumerate(results.engines):
        found = kept.get((scene_name, engine, dt))
        if found is not None:
            colour, marker = styles[engine]
            yield found, {"label": engine, "colour": colour, "marker": marker, "width": thinner(number, count)}


def metric_label(metric: str) -> str:
    """The name and unit of a metric, in lines that fit along an axis."""
    unit = (METRICS.get(metric) or ENSEMBLE_METRICS[metric]).unit
    return fill(metric.replace("_", " ") + ("" if unit == "1" else f" [{unit}]"), WIDEST_LABEL)


def label_powers(axes: "Axes", name: str) -> None:
    """Label a logarithmic axis, `x` or `y`, after its data are drawn: at powers of ten, and at 2 and 5 times them on a short axis.

    Labels are plain text, because a page shows them in its own font, and because parsing formulas takes half of the time of drawing a
    figure.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    if not axes.has_data():  # no engine has a value
        return
    axis: Axis = getattr(axes, f"{name}axis")
    low, high = axis.get_view_interval()
    if high < LEAST_RATIO * low:  # a shorter axis may have no round value to label
        middle = float(np.sqrt(low * high))
        low, high = middle / LEAST_RATIO**0.5, middle * LEAST_RATIO**0.5
        axes.set(**{f"{name}lim": (low, high)})
    axis.set_major_locator(LogLocator(subs=(1.0,) if high > MANY * low else (1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: power(value)))
    axis.set_minor_locator(NullLocator())


def power(value: float) -> str:
    """A number as 10⁻³ or 2.5×10⁻³."""
    digits, exponent = f"{value:.2e}".split("e")
    power_of_ten = "10" + str(int(exponent)).translate(SUPERSCRIPTS)
    return power_of_ten if float(digits) == 1.0 else f"{float(digits):g}×{power_of_ten}"
