"""The style of plots: sizes, looks, and axis labels with units."""

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import chdir, contextmanager
from importlib import import_module
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS
from dropspin.comparisons.results.results import Results
from dropspin.reports.plots.colours import engine_styles
from dropspin.scenarios.errors import UnknownName

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

Kept = TypeVar("Kept")
ByStep = Mapping[tuple[str, str, float], Kept]
"""Trajectories or ensemble outcomes of a run, by scene, engine and time step."""

COMMON = Path(__file__).with_name("common.mplstyle")


SIZES = {"column": (3.4, 2.3, 1, 8.0), "page": (3.5, 2.4, 2, 9.0), "report": (3.7, 2.9, 3, 9.0)}
"""Sizes of figures, by name: as wide as a column of a journal (86 mm), as a page (178 mm), and three panels in a row. A size has the width
and the height of a panel [inches], the number of panels in a row, and the size of the font [points].
"""
LOOKS: dict[str, list[Any]] = {
    "light": [{"grid.color": "black"}],
    "dark": ["dark_background"],
    "grey": ["grayscale", {"grid.color": "black", "figure.facecolor": "white"}],
}
"""Looks of figures, by name: settings, and names of styles of matplotlib."""
LINE = 1.5
"""Width of the line of an engine [points], the same for all: a wider one would look more important."""
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


@contextmanager
def style(size: str = "column", look: str = "light") -> Iterator[None]:
    """Within `with plots.style(...)`, figures have the font and the size of a figure in a talk or a paper, and embed TrueType fonts.

    Args:
        size: `column` (86 mm wide) or `page` (178 mm wide).
        look: `light`, `dark`, or `grey` for print without colours.

    Raises:
        UnknownName: The size or the look is unknown.
    """
    for what, name, names in (("size of a figure", size, SIZES), ("look of a figure", look, LOOKS)):
        if name not in names:
            raise UnknownName(what, name, list(names))
    load_matplotlib()
    from matplotlib import style as matplotlib_style

    width, height, across, font = SIZES[size]
    with matplotlib_style.context(["default", *LOOKS[look], COMMON, {"figure.figsize": (across * width, height), "font.size": font}]):
        yield


def is_grey() -> bool:
    """Whether the current matplotlib style has no colours, as its style `grayscale`."""
    from matplotlib import rcParams

    return str(rcParams["image.cmap"]) == "gray"


def ink() -> str:
    """The text colour of the current matplotlib style, for elements that belong to no engine."""
    from matplotlib import rcParams

    return str(rcParams["text.color"])


def stride(length: int) -> int:
    """The stride with which at most `MOST_POINTS` of `length` points are drawn."""
    return max(1, -(-length // MOST_POINTS))


def step_of(kept: ByStep[Kept], scene_name: str, which: Callable[..., float]) -> float:
    """The finest or coarsest time step, by `min` or `max`, for which there is an entry of the scene [s]; 0 if there is none."""
    return which((dt for name, _, dt in kept if name == scene_name), default=0.0)


def at_one_step(
    results: Results, kept: ByStep[Kept], scene_name: str, which: Callable[..., float]
) -> Iterator[tuple[Kept, dict[str, Any]]]:
    """For each engine, the entry at the time step of `step_of`, and the label, colour, marker and dash pattern of its line."""
    dt = step_of(kept, scene_name, which)
    for engine, engine_style in engine_styles(results.engines).items():
        entry = kept.get((scene_name, engine, dt))
        if entry is not None:
            yield entry, {"label": engine, **engine_style._asdict(), "is_sparse": True}


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


def plain(value: float) -> str:
    """A number of up to four digits, with a minus sign: 0.25, −1; as 6.358×10⁻⁴ below 0.001 and from 10,000 on."""
    is_short = value == 0.0 or 1e-3 <= abs(value) < 1e4
    return (f"{value:.4g}" if is_short else power(value)).replace("-", "−")


def power(value: float) -> str:
    """A number as 10⁻³ or 2.5×10⁻³."""
    digits, exponent = f"{value:.3e}".split("e")
    power_of_ten = "10" + str(int(exponent)).translate(SUPERSCRIPTS)
    return power_of_ten if float(digits) == 1.0 else f"{float(digits):g}×{power_of_ten}"
