"""How plots look: the colours of the page they stand in, sizes that keep lines apart which coincide, axis labels with units."""

from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from comparisons import METRICS
from scenarios import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

Array = NDArray[np.float64]

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
MOST_POINTS = 800
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


def metric_label(metric: str) -> str:
    """A metric's name and unit, in lines that are no longer than an axis."""
    unit = METRICS[metric].unit
    return fill(metric.replace("_", " ") + ("" if unit == "1" else f" [{unit}]"), WIDEST_LABEL)


def label_powers(axes: "Axes", name: str) -> None:
    """Label a logarithmic axis, `x` or `y`, that has its data: at powers of ten, and between them where there are hardly two.

    In plain text: a page sets it in its own font, and parsing formulas takes half of the time of a figure.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

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
