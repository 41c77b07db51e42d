"""Ensembles: beyond its horizon no single trajectory of a chaotic scene can be compared, but means over many starts can.

Every engine runs the same starts. Means over them are compared, each with the 95 % confidence interval of Student's t. Differences between
two engines are taken start by start, so that what they have in common is not noise. The intervals of all differences of a scene at a time
step contain their values together with 95 % confidence, because one that excludes 0 is a finding (Bonferroni's correction).
"""

from collections.abc import Iterator

import numpy as np

from dropspin.comparisons.engines.base import Diverged, Engine
from dropspin.comparisons.judging.verdicts import Judgement
from dropspin.comparisons.measuring.batch_quantities import compute_states
from dropspin.comparisons.measuring.state_quantities import States
from dropspin.comparisons.measuring.tolerances import OF_TWO_DRAWS, tolerance
from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS, SAMPLES, EnsembleOutcome
from dropspin.comparisons.running.driving import record_batch
from dropspin.scenarios import Scenario, Trajectory, members
from dropspin.scenarios.mechanics import angular_momentum
from dropspin.scenarios.state import Array

BATCH_SIZE = 32
"""Members whose every step is held in memory at a time."""
CONFIDENCE = 0.95


def run_ensemble(engine: Engine, scene: Scenario, dt: float, most: int | None = None) -> EnsembleOutcome:
    """Run an ensemble, or at most a number of its first members, through an engine.

    Raises:
        Diverged: A motion is not finite.
    """
    steps = scene.steps(dt)
    rows = np.round(np.linspace(0.0, steps, SAMPLES)).astype(int)
    energies, momenta, rebounds, rest_times = [], [], [], []
    t, starts = dt * np.arange(steps + 1, dtype=float), members(scene)[:most]
    for first in range(0, len(starts), BATCH_SIZE):
        batch = starts[first : first + BATCH_SIZE]
        recorded = [recording.motion for recording in record_batch(engine, batch, dt)]
        for motion in recorded:
            if motion.first_bad_row is not None:
                raise Diverged(f"a start of the ensemble is not finite at t = {t[motion.first_bad_row]:g} s")
        for _, states, motions in compute_states(list(map(States, batch, recorded))):
            scale = np.where(motions.energy_scale == 0.0, 1.0, motions.energy_scale)  # where nothing moves and nothing pulls
            shown = states[:, rows].reshape(-1, 13)
            momentum = angular_momentum(scene, Trajectory.from_states(np.zeros(len(shown)), shown)).reshape(len(states), -1, 3)
            energies.append(motions.states.energy[:, rows] / scale[:, np.newaxis])
            momenta.append(np.linalg.norm(momentum, axis=-1) / (scene.body.size * np.sqrt(2.0 * scale * scene.body.mass))[:, np.newaxis])
            rebounds.append(motions.rebound)
            rest_times.append(t[motions.last_row_in_motion])
    return EnsembleOutcome(t[rows], *map(np.concatenate, (energies, rebounds, rest_times, momenta)))


def judge_means(scene: Scenario, dt: float, outcome: EnsembleOutcome) -> Iterator[tuple[str, Judgement]]:
    """Each ensemble metric and its mean over the starts, between the ends of its confidence interval."""
    for name, metric in ENSEMBLE_METRICS.items():
        mean, half = _mean(metric.of_each(outcome))
        sampling_noise = OF_TWO_DRAWS * (mean + half - mean)
        allowed = tolerance(scene, metric.unit, np.float64, scene.steps(dt), sampling_noise)
        yield name, Judgement(mean, "measured", mean - half, mean + half, "chaotic", tolerance=allowed)


def judge_differences(first: EnsembleOutcome, second: EnsembleOutcome, pairs: int = 1) -> Iterator[tuple[str, Judgement]]:
    """Each ensemble metric and the mean difference of two engines, start by start, and whether it is significant.

    Args:
        first: The outcome of an engine.
        second: The outcome of another engine.
        pairs: Number of pairs of engines that are compared.
    """
    together = pairs * len(ENSEMBLE_METRICS)
    for name, metric in ENSEMBLE_METRICS.items():
        differences = metric.of_each(first) - metric.of_each(second)
        mean, half = _mean(differences, together)
        significance = "not significant" if mean - half <= 0.0 <= mean + half else "significant"
        reason = f"the difference is {significance} at 95 % confidence for {together} differences together, over {len(differences)} starts"
        yield name, Judgement(mean, "measured", mean - half, mean + half, "chaotic", reason)


def _mean(values: Array, judged_together: int = 1) -> tuple[float, float]:
    """The mean, and half the width of its confidence interval, which is wider if several intervals are judged together."""
    from scipy.special import stdtrit  # the quantiles of Student's t; scipy.stats takes a second to import, in each engine's process

    error = float(np.std(values, ddof=1)) / len(values) ** 0.5
    outside = (1.0 - CONFIDENCE) / judged_together
    return float(np.mean(values)), float(stdtrit(len(values) - 1, 1.0 - 0.5 * outside)) * error
