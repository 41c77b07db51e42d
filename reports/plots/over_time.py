"""Quantities of a motion over time, for each engine and for the exact solution or the recording."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dropspin.comparisons.results.results import Results
from dropspin.reports.plots.chart import FLAT, Chart, Line, draw
from dropspin.reports.plots.style import MOST_POINTS, TIME, at_one_step, stride
from dropspin.scenarios import Scenario, Trajectory, Truth, reference_for
from dropspin.scenarios.mechanics import angular_momentum, energy
from dropspin.scenarios.rotations import angle_between_orientations, rotate
from dropspin.scenarios.state import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Quantity = Callable[[Scenario, Trajectory], Array]

RESOLVED, MOST_MISSED = 0.05, 0.1
"""Straight lines between the drawn points do not resolve a curve where they differ from it by more than this share of its range there. A
curve is drawn as an envelope if it is not resolved for a tenth of its time. An impact affects only one point.
"""
NEARBY, HARDLY_SEEN = 16, 0.2
"""Drawn points over which the range is taken, and its least value, relative to that of the whole curve: a late oscillation may be small."""
POINTS_A_TURN = 32
MOST_BETWEEN = 64
"""States of the exact solution from one drawn point to the next, by which it is seen whether these resolve it."""
MOST_SAMPLES = 200_000


def height(scene: Scenario, motion: Trajectory) -> Array:
    """Height of the centre of mass [m]."""
    return motion.position[:, 1]


def tilt(scene: Scenario, motion: Trajectory) -> Array:
    """Vertical component of the body's y axis: 1 if the body is upright, -1 if it is upside down."""
    return rotate(motion.orientation, np.array([0.0, 1.0, 0.0]))[:, 1]


def angular_momentum_length(scene: Scenario, motion: Trajectory) -> Array:
    """Magnitude of the angular momentum [kg m²/s]."""
    return np.linalg.norm(angular_momentum(scene, motion), axis=1)


LABELS: dict[Quantity, str] = {
    height: "height [m]",
    tilt: "upward component of body y axis",
    energy: "energy [J]",
    angular_momentum_length: "|L| [kg m²/s]",
}


def quantities(scene: Scenario) -> dict[str, Quantity]:
    """The quantities to show for a scene, by axis label."""
    moves = scene.gravity is not None or any(scene.start.velocity)
    shown: list[Quantity] = [height if moves else tilt, energy]
    if any(scene.start.angular_velocity):
        shown.append(angular_momentum_length)
    return {LABELS[quantity]: quantity for quantity in shown}


@np.errstate(all="ignore")  # an engine may return 1e300
def over_time(results: Results, scene_name: str, quantity: Quantity) -> Chart:
    """A quantity over time for each engine at the largest time step, where engines differ most, and for the exact solution or recording.

    A curve that oscillates too fast to be drawn is shown as an envelope of its smallest and largest values.

    Args:
        results: The run.
        scene_name: The name of a scene of the run.
        quantity: A function of a scene and a motion that returns the values to plot, shape (n,).
    """
    scene = results.scenes[scene_name]
    truth = reference_for(scene)
    lines: list[Line] = []
    times = steps = np.linspace(0.0, scene.duration, MOST_POINTS)
    for motion, style in at_one_step(results, results.trajectories, scene_name, max):
        steps = motion.t
        times = steps[:: stride(len(steps))]
        lines.append(_drawn(Line(x=motion.t, y=quantity(scene, motion), **style), times))
    if truth is not None:
        end = min(scene.duration, truth.horizon)
        finer = steps[:: max(1, stride(len(steps)) // MOST_BETWEEN)]
        exact = _sampled(truth, finer, end) if truth.frames is None else truth(truth.frames[truth.frames <= end])
        line = Line(truth.word, exact.t, quantity(scene, exact), width=1.0, dashes="dashed")
        lines.append(_drawn(line, times) if truth.is_exact else line)
    envelopes = any(line.is_fill for line in lines)
    remark = "The oscillation is too fast to be drawn: bands show the range from the smallest to the largest value." if envelopes else ""
    comparable = truth is not None and truth.is_exact and len(lines) > 1 and not envelopes
    return Chart(TIME, LABELS.get(quantity, ""), lines, reference=lines[-1].label if comparable else "", remark=remark)


def plot_over_time(results: Results, scene_name: str, quantity: Quantity, axes: "Axes") -> None:
    """Draw `over_time` into axes."""
    draw(over_time(results, scene_name, quantity), axes)


def _sampled(truth: Truth, times: Array, end: float) -> Trajectory:
    """The exact solution at these times up to its end, and at as many times between them as are needed to resolve every turn."""
    coarse = truth(times[times <= end])
    fastest = float(np.linalg.norm(coarse.angular_velocity, axis=1).max(initial=0.0))
    turned = angle_between_orientations(coarse.orientation[:-1], coarse.orientation[1:]).max(initial=0.0)
    if len(coarse) < 2 or (fastest * np.diff(coarse.t).max() < 1.0 and turned < 1.0):
        return coarse
    between = int(min(np.ceil(fastest / (2.0 * np.pi) * POINTS_A_TURN * end), MOST_SAMPLES)) // len(coarse) + 1
    return truth(np.interp(np.arange(between * (len(coarse) - 1) + 1) / between, np.arange(len(coarse)), coarse.t))


def _drawn(line: Line, times: Array) -> Line:
    """A line at these times up to the end of the motion, or an envelope if the times do not resolve the motion."""
    shown = np.searchsorted(line.x, times[times <= line.x[-1] * (1.0 + 1e-12)])
    shown = np.minimum(shown, len(line.x) - 1)
    x, y = line.x[shown], line.y[shown]
    finite = np.isfinite(line.y)
    reach = float(np.ptp(line.y[finite])) if finite.any() else 0.0
    parts = shown[::NEARBY]
    ranges = np.fmax.reduceat(line.y, parts) - np.fmin.reduceat(line.y, parts)
    nearby = np.repeat(np.clip(ranges, HARDLY_SEEN * reach, reach), np.diff(parts, append=len(line.y)))
    missed = (np.abs(np.interp(line.x, x, y) - line.y) > RESOLVED * nearby)[finite]
    constant = reach <= FLAT * float(np.abs(line.y[finite]).max(initial=1.0))  # in SI units 1e-9 is rounding, too
    if constant or not finite.any() or missed @ np.gradient(line.x)[finite] <= MOST_MISSED * (line.x[-1] - line.x[0]):
        return replace(line, x=x, y=y)
    low, high = (extreme.reduceat(line.y, shown) for extreme in (np.fmin, np.fmax))  # without NaN, as far as there is a number
    return replace(line, x=x, y=0.5 * (low + high), marker="", is_sparse=False, low=low, high=high, is_fill=True)
