"""Ensembles: past the horizon no single trajectory can be compared, but what becomes of many can.

Every engine runs the same starts. What is compared are means over them, each with the interval that holds the true mean in 95 of 100 draws
(Student's t). The differences between two engines are taken start by start, so that what they have in common is no noise.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from comparisons.building import assert_starts_as_meant, sound_record
from comparisons.comparison import Comparison, Unresolved
from comparisons.engines.base import Diverged, Engine
from comparisons.metrics import last_time_in_motion
from comparisons.tolerances import OF_TWO_DRAWS, tolerance
from scenarios import Scenario, Trajectory, members
from scenarios.mechanics import angular_momentum, energy

Array = NDArray[np.float64]
Row = dict[str, Any]

MARKS = 41
"""Times at which the energy is kept, the start and the end among them."""
AT_ONCE = 32
"""Members whose every step is held in memory at a time."""
CONFIDENCE = 0.95
ULPS_OF_MANY = 64
"""How far a member may start from where it was put: of many some are a little farther off than the 8 ulp that one is allowed."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of each member of an ensemble.

    Attributes:
        t: Times [s], shape (MARKS,).
        energy: What each has of the scene's energy at these times, shape (size, MARKS).
        rebound: How high each rises after it first touched the floor, over how high it started, shape (size,); 0 if it never did.
        rest_time: When each was last in motion [s], shape (size,).
        angular_momentum: |L| of each at these times, over r √(2 E M), E the scene's energy and r the body's size, shape (size, MARKS);
            None in runs from before it was kept.
    """

    t: Array
    energy: Array
    rebound: Array
    rest_time: Array
    angular_momentum: Array | None = None


@dataclass(frozen=True)
class EnsembleMetric:
    """A mean over an ensemble: its unit, its definition, and the figure of each member."""

    unit: str
    definition: str
    of_each: Callable[[Outcome], Array]


ENSEMBLE_METRICS = {
    "energy_halfway": EnsembleMetric(
        "1", "Energy halfway through, over the scene's energy (of the fall, or of the start's motion).", lambda o: o.energy[:, MARKS // 2]
    ),
    "energy_at_end": EnsembleMetric(
        "1", "Energy at the end, over the scene's energy (of the fall, or of the start's motion).", lambda o: o.energy[:, -1]
    ),
    "rebound_height": EnsembleMetric(
        "1", "Highest that the centre of mass is after the first contact, over its start; 0 without one.", lambda o: o.rebound
    ),
    "rest_time": EnsembleMetric("s", "When it was last in motion; the scene's end if it still is.", lambda o: o.rest_time),
}


def outcome_of(engine: Engine, scene: Scenario, dt: float) -> Outcome:
    """Run an ensemble through an engine.

    Raises:
        Diverged: A start ended in numbers that are not finite.
    """
    steps = scene.steps(dt)
    t = dt * np.arange(steps + 1, dtype=float)
    marks = np.round(np.linspace(0.0, steps, MARKS)).astype(int)
    with engine.prepare(scene, dt) as simulation:
        lag = 0.5 * dt if simulation.staggered else 0.0
    energies, momenta, rebounds, rest_times = [], [], [], []
    starts = members(scene)
    for first in range(0, len(starts), AT_ONCE):
        some = starts[first : first + AT_ONCE]
        for member, states in zip(some, engine.record_ensemble(some, dt, steps), strict=True):
            assert_starts_as_meant(engine, member, states[0], ULPS_OF_MANY)
            motion = Trajectory.from_states(t, sound_record(states, steps + 1), lag)
            if motion.first_bad_row is not None:
                raise Diverged(f"a start of the ensemble is not finite at t = {motion.t[motion.first_bad_row]:g} s")
            case = Comparison(member, motion)
            contact = case.first_contact
            scale = _energy_scale(case)
            energies.append(energy(member, motion[marks]) / scale)
            lengths = np.linalg.norm(angular_momentum(member, motion[marks]), axis=1)
            momenta.append(lengths / (scene.body.size * np.sqrt(2.0 * scale * scene.body.mass)))
            rebounds.append(0.0 if contact is None else motion.position[contact[1] :, 1].max() / motion.position[0, 1])
            rest_times.append(last_time_in_motion(member, motion))
    return Outcome(t[marks], np.array(energies), np.array(rebounds), np.array(rest_times), np.array(momenta))


def _energy_scale(case: Comparison) -> float:
    """The scene's energy [J]; where nothing moves and nothing pulls any will do, for there is none to measure."""
    try:
        return case.energy_scale
    except Unresolved:
        return 1.0


def ensemble_rows(scene: Scenario, label: str, dt: float, outcome: Outcome) -> list[Row]:
    """Each mean over an engine's ensemble, between the ends of its confidence interval."""
    shared: Row = {"scene": scene.name, "engine": label, "dt": dt, "steps": scene.steps(dt), "kind": "ensemble"}
    rows = []
    for name, metric in ENSEMBLE_METRICS.items():
        mean = _mean(metric.of_each(outcome))
        luck = OF_TWO_DRAWS * (mean["upper"] - mean["value"])
        draws = {"tolerance": tolerance(scene, metric.unit, np.float64, scene.steps(dt), luck)}
        rows.append(shared | {"metric": name, "unit": metric.unit, "verdict": "measured", "cause": "chaotic"} | mean | draws)
    return rows


def difference_rows(scene: Scenario, dt: float, labels: tuple[str, str], outcomes: tuple[Outcome, Outcome]) -> list[Row]:
    """By how much the means of two engines differ, start by start, and whether that can be told from chance."""
    shared: Row = {"scene": scene.name, "engine": labels[0], "truth": labels[1], "dt": dt, "steps": scene.steps(dt), "kind": "agreement"}
    rows = []
    for name, metric in ENSEMBLE_METRICS.items():
        first, second = (metric.of_each(outcome) for outcome in outcomes)
        mean = _mean(first - second)
        told = "cannot be told from chance" if mean["lower"] <= 0.0 <= mean["upper"] else "differ by more than chance"
        reason = f"{told}, over {len(first)} starts"
        rows.append(shared | {"metric": name, "unit": metric.unit, "verdict": "measured", "cause": "chaotic", "reason": reason} | mean)
    return rows


def _mean(values: Array) -> Row:
    mean, error = float(np.mean(values)), float(stats.sem(values))
    half = float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, len(values) - 1)) * error
    return {"value": mean, "lower": mean - half, "upper": mean + half}
