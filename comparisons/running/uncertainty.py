"""The uncertainty of a recording in the metrics of a scene, as an engine shows it: what the starts and the noise of a frame leave open.

An engine that moves exactly as the body did differs from the recording nevertheless, by the errors of the estimated starts, which the
motion amplifies, and by the noise of the frames. So do its motions from starts that are drawn from the distribution of the estimate differ
from those from the estimate itself, with the noise of a frame added. With n tosses, m drawn starts of each, and the differences f_ij, the
mean over the tosses of as many other differences is with 95 % probability at most

    f + t s √(1 + 1/m),    s² = Σ_i var_j(f_ij) / n²,    t of Student with n (m - 1) degrees of freedom

f is the mean of all. Of one toss, the largest of its 19 differences is exceeded in 1 of 20 cases, whatever their distribution: the reach is
the larger of the two.

Source: G. J. Hahn & W. Q. Meeker, Statistical Intervals (1991), chapters 4 (prediction of a mean) and 5 (by order statistics).
"""

import math
from collections.abc import Callable

import numpy as np

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.measuring.comparison import Comparison, at_times
from dropspin.comparisons.measuring.metrics import metrics_for
from dropspin.comparisons.running.driving import finite, record_batch
from dropspin.scenarios import Scenario, Trajectory, reference_for
from dropspin.scenarios.recording import STARTS, Noise
from dropspin.scenarios.rotations import about, length, multiply
from dropspin.scenarios.state import ORIENTATION, POSITION, Array

SEED = 48
FEWEST_DRAWN = 8
"""Drawn starts of each of many tosses: with four, a heavy tail is seen too seldom, and means are within the reach in 9 of 10 cases."""
PROBABILITY = 0.95


def simulations_of(tosses: int) -> int:
    """The number of simulations of each toss: from its estimated start, and from drawn ones."""
    return 1 + max(FEWEST_DRAWN, math.ceil((STARTS - 1) / tosses))


def uncertainties(engine: Engine, scene: Scenario, dt: float, size: int, on_done: Callable[[int], None]) -> dict[str, float]:
    """The largest value of each metric that an engine without error may have, by name; runs in the engine's process.

    Args:
        engine: The engine.
        scene: The scene, which has a recording.
        dt: Time step [s].
        size: The number of tosses, the first ones.
        on_done: Called with the number of simulations that are done, after each set.

    Raises:
        Breakdown: A motion is not finite.
    """
    assert scene.recording is not None
    recording, random, sets = scene.recording, np.random.default_rng(SEED), simulations_of(size)
    metrics = [metric for metric in metrics_for(scene, reference_for(scene)) if metric.kind == "truth"]
    motions = []
    for number in range(sets):
        members = [scene.starting_at(toss.starts[number]) for toss in recording.tosses[:size]]
        motions.append([finite(one) for one in record_batch(engine, members, dt)])
        on_done((1 + number) * size)
    values = np.empty((len(metrics), size, sets - 1))
    for row, (toss, estimated, *drawn) in enumerate(zip(recording.tosses, *motions, strict=False)):
        times = toss.t[toss.t <= estimated.t[-1]]
        for column, motion in enumerate(drawn):
            case = Comparison(scene, motion, measured=_noisy(estimated, times, recording.noise, random))
            values[:, row, column] = [metric.value_or_nan([case]) for metric in metrics]
    return {metric.name: _reach(of_metric) for metric, of_metric in zip(metrics, values, strict=True)}


def _reach(differences: Array) -> float:
    """The largest mean over tosses of as many other differences, from shape (tosses, drawn starts)."""
    from scipy.special import stdtrit  # scipy.stats takes a second to import, in each engine's process

    size, drawn = differences.shape
    quantile = float(stdtrit(size * (drawn - 1), PROBABILITY))
    spread = math.sqrt(float(differences.var(axis=1, ddof=1).sum())) / size
    predicted = differences.mean() + quantile * spread * math.sqrt(1.0 + 1.0 / drawn)
    return max(float(predicted), float(differences.mean(axis=0).max()))


def _noisy(motion: Trajectory, times: Array, noise: Noise, random: np.random.Generator) -> Trajectory:
    """A motion as it would be recorded at times [s]."""
    states, turned = at_times(motion, times).states.copy(), noise.orientation * random.normal(size=(len(times), 3))
    angles = length(turned)
    states[:, POSITION] += noise.position * random.normal(size=(len(times), 3))
    states[:, ORIENTATION] = multiply(about(turned / angles[:, np.newaxis], angles), states[:, ORIENTATION])
    return Trajectory.from_states(times, states)
