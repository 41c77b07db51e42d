"""The forecast of the time that a run takes, from the times of the engines' steps."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from dropspin.comparisons.measuring.metric import PHASES_OF_TOSS
from dropspin.comparisons.results.ensembles import QUICK_MEMBERS
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.perturbed_starts import number_of_simulations
from dropspin.comparisons.running.start_phases import StartPhase, number_of_phases
from dropspin.comparisons.running.timing import Timings
from dropspin.comparisons.running.uncertainty import simulations_of

MEASURING = 1e-5
"""Time to record and measure a step [s], beyond that of the step; 2 to 24 µs with wang, mujoco and pybullet."""


class Forecast(NamedTuple):
    """The time that a run will take.

    Attributes:
        seconds: Wall time [s].
        jobs: Number of scenes that run at a time.
        by_engine: The part of each engine in this wall time [s].
        by_scene: Wall time of each scene alone [s].
        quick: Wall time of the same run with `quick` [s].
    """

    seconds: float
    jobs: int
    by_engine: Mapping[str, float]
    by_scene: Mapping[str, float]
    quick: float


def forecast(scenes: Sequence[StartPhase], entries: Sequence[EngineEntry], dts: Sequence[float], timings: Timings, jobs: int) -> Forecast:
    """The forecast of a run.

    Time steps that are added to extrapolate an error, tests of symmetries and the report are not included. A batch counts as one
    simulation: how much longer it takes is not known.

    Args:
        scenes: The scenes.
        entries: The engines.
        dts: Time steps [s].
        timings: By scene, engine and time step, the time of a step.
        jobs: Number of scenes that run at a time.
    """
    times = np.zeros((2, len(scenes), len(entries)))  # of the run and of a quick one
    for (row, own), (column, entry), dt in product(enumerate(scenes), enumerate(entries), dts):
        timing = timings[own.scene.name, entry.label, dt]
        if not np.isfinite(timing.per_step):
            continue
        for which, quick in enumerate((own.quick, True)):
            number = simulations(own._replace(quick=quick), entry, dt)
            stepped = min(number, 2) if timing.in_batches else number
            times[which, row, column] += own.scene.steps(dt) * (stepped * timing.per_step + number * MEASURING)
    seconds, of_quick = (max(one.sum() / jobs, one.sum(axis=1).max(initial=0.0)) for one in times)
    shares = times[0].sum(axis=0) / max(times[0].sum(), np.finfo(float).tiny)
    by_engine = {entry.label: float(share * seconds) for entry, share in zip(entries, shares, strict=True)}
    by_scene = {own.scene.name: float(alone) for own, alone in zip(scenes, times[0].sum(axis=1), strict=True)}
    return Forecast(float(seconds), jobs, by_engine, by_scene, float(of_quick))


def simulations(own: StartPhase, entry: EngineEntry, dt: float) -> int:
    """The number of simulations of a scene with an engine at a time step [s]: own start, start phases, perturbed starts, ensemble."""
    scene, phases = own.scene, number_of_phases(own, dt)
    if scene.recording is not None:
        tosses = phases // PHASES_OF_TOSS
        return 1 + phases + tosses * simulations_of(tosses)
    members = 0 if scene.ensemble is None else min(scene.ensemble.size, QUICK_MEMBERS) if own.quick else scene.ensemble.size
    return 1 + (phases if phases > 1 else 0) + number_of_simulations(own, entry.adapter.precision, phases) + members
