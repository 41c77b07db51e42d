"""One engine on one scene at one time step: the motions from all its starts, and what the engine states of itself."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dropspin.comparisons.engines.base import KnownLimitation
from dropspin.comparisons.judging.convergence import Claim
from dropspin.comparisons.measuring.differences import differences
from dropspin.comparisons.measuring.metric import PHASES_OF_TOSS
from dropspin.comparisons.measuring.metrics import metrics_for
from dropspin.comparisons.measuring.tolerances import MATTERS
from dropspin.comparisons.results.ensembles import QUICK_MEMBERS, EnsembleOutcome
from dropspin.comparisons.running.adapter_output import verified_claims, verified_predictions
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import Breakdown, classify, record, record_batch, verify_accepted
from dropspin.comparisons.running.engine_process import share_progress
from dropspin.comparisons.running.ensembles import run_ensemble
from dropspin.comparisons.running.progress import OnSimulations
from dropspin.comparisons.running.uncertainty import simulations_of, uncertainties
from dropspin.scenarios import Scenario, Trajectory, truth_for
from dropspin.scenarios.state import Array

NOT_REPEATED = KnownLimitation("the engine does not repeat its own motion; dropspin symmetries shows where it differs")
"""It widens no tolerance, and excuses no error."""


@dataclass
class EngineRun:
    """What one engine did with one scene at one time step.

    Attributes:
        claim: What the engine declares, and the limitations that it met.
        breakdown: Why there is no motion; None if there is one.
        motion: From the scene's own start, every step.
        phases: From each start phase.
        settings: The settings that it reported.
        outcome: What became of the scene's ensemble.
        discretisation: The discretisation that the engine states for this scene.
        predicted: Errors by metric that its scheme must have.
        uncertainties: By metric, the largest value that the recording of the scene leaves an engine without an error.
    """

    claim: Claim
    breakdown: Breakdown | None = None
    motion: Trajectory | None = None
    phases: list[Trajectory] = field(default_factory=list)
    settings: dict[str, Any] = field(default_factory=dict)
    outcome: EnsembleOutcome | None = None
    discretisation: str | None = None
    predicted: dict[str, float] = field(default_factory=dict)
    uncertainties: dict[str, float] = field(default_factory=dict)

    def meet(self, limitation: KnownLimitation) -> None:
        """Add a limitation that was met to what the engine declares."""
        self.claim = self.claim._replace(limitations=(*self.claim.limitations, limitation))


def run_engine(
    entry: EngineEntry, scene: Scenario, dt: float, starts: Sequence[Scenario], quick: bool, on_simulations: OnSimulations = share_progress
) -> EngineRun:
    """Run a scene from its own start, then from each of its start phases if there are several; failures are part of the result.

    Args:
        entry: The engine.
        scene: The scene.
        dt: Time step [s].
        starts: The scene from each of its start phases.
        quick: Whether few members of an ensemble are run.
        on_simulations: Called after each simulation.
    """
    engine, found = entry.adapter, EngineRun(Claim(entry.label))
    try:
        verify_accepted(engine, scene)
        found.discretisation, order, precision = verified_claims(engine, scene)
        others = starts if len(starts) > 1 else []
        size = 0 if scene.recording is None else len(starts) // PHASES_OF_TOSS
        drawn = size and size * simulations_of(size)
        total = 1 + len(others) + drawn
        own = record(engine, scene, dt)
        on_simulations(1, total)
        found.motion, found.settings = own.motion, own.settings
        found.claim = Claim(entry.label, order, precision, own.limitations)
        recorded = record_batch(engine, others, dt, lambda done, _: on_simulations(1 + done, total)) if others else [own]
        found.phases = [recording.motion for recording in recorded]
        found.outcome = None if scene.ensemble is None else run_ensemble(engine, scene, dt, QUICK_MEMBERS if quick else None)
        if drawn:
            found.uncertainties = uncertainties(engine, scene, dt, size, lambda done: on_simulations(total - drawn + done, total))
        # The predicted error of a bounce is a mean over start phases.
        elif scene.floor is None or len(starts) > 1:
            truth = truth_for(scene)
            predicted = {metric.name: engine.predicted_error(scene, truth, metric.name, dt) for metric in metrics_for(scene, truth)}
            found.predicted = verified_predictions(predicted)
    except Exception as error:  # whatever an engine raises costs its own row only
        found.breakdown = classify(error)
    return found


def is_repeated(entry: EngineEntry, scene: Scenario, dt: float, states: Array) -> bool:
    """Whether an engine that runs a scene again, twice, moves as before, up to differences that do not matter, such as those of threads.

    Args:
        entry: The engine.
        scene: The scene.
        dt: Time step [s].
        states: Those of its motion, shape (n, 13).
    """
    again = (record(entry.adapter, scene, dt).motion.states for _ in range(2))
    return all(np.array_equal(states, one, equal_nan=True) or (differences(scene, states, one) <= MATTERS).all() for one in again)


def motions_from(
    entry: EngineEntry, starts: Sequence[Scenario], dt: float, alone: Scenario | None, on_simulations: OnSimulations = share_progress
) -> list[Trajectory]:
    """The motions of an engine from other starts of a scene at a time step [s].

    If the engine steps batches, that from a start that was simulated alone is the first one: a batch may move otherwise.
    """
    first = [alone] if alone is not None and entry.adapter.steps_batches else []
    return [recording.motion for recording in record_batch(entry.adapter, [*first, *starts], dt, on_simulations)]
