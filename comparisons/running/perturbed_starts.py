"""Runs from perturbed starts: how far the metrics move if the initial states are perturbed by a few eps estimates what rounding may do."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain

import numpy as np

from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.metrics import metrics_for
from dropspin.comparisons.measuring.tolerances import SETS_OF_STARTS, SIGNS, perturbed
from dropspin.comparisons.running.engine_run import motions_from
from dropspin.comparisons.running.inputs import MOST_ROWS, EngineEntry
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.recording import Breakdown
from dropspin.comparisons.running.start_phases import StartPhase, compare

PERTURBED_PHASES = 8
"""Start phases from which perturbed motions are simulated. The mean over a part of the phases changes at least as much as that over all."""


def are_left_out(own: StartPhase, precision: type) -> bool:
    """Whether a scene is not run from perturbed starts: a quick run has them only in single precision, where verdicts need them."""
    return own.quick and precision is np.float64


def number_of_simulations(own: StartPhase, precision: type, phases: int) -> int:
    """The number of simulations from perturbed starts of a scene with a number of start phases."""
    if are_left_out(own, precision):
        return 0
    if phases == 1:
        return len(SIGNS)
    size = len(range(0, phases, _stride(phases)))
    return SETS_OF_STARTS * size if own.scene.floor is not None and not own.scene.starts_above_floor else 0


def _stride(phases: int) -> int:
    return max(1, phases // PERTURBED_PHASES)


def changes_of_metrics(
    own: StartPhase,
    entry: EngineEntry,
    phases: Sequence[StartPhase],
    cases: Sequence[Comparison],
    dt: float,
    precision: type,
    processes: EngineProcesses,
    on_simulations: Callable[[int], None],
) -> list[Mapping[str, float]]:
    """How much every metric changes, by name, with each set of perturbed starts.

    The motions of at most `MOST_ROWS` steps, or of one set, are kept at a time.

    Args:
        own: The scene, and its exact solution.
        entry: The engine.
        phases: The start phases at the time step.
        cases: The motions from them, compared with the exact ones.
        dt: Time step [s].
        precision: That of the engine.
        processes: The engines' processes.
        on_simulations: Called with the number of simulations that are done.

    Raises:
        Breakdown: There are no motions from these starts.
    """
    if are_left_out(own, precision):
        return []
    few, metrics = phases[:: _stride(len(phases))], metrics_for(own.scene, own.truth)
    size, sets = len(few), perturbed(own.scene, [phase.scene for phase in few], precision)
    before = {metric.name: metric.value_or_nan(cases[:: _stride(len(phases))]) for metric in metrics} if sets else {}
    at_once = max(1, MOST_ROWS // (size * own.scene.steps(dt)))

    def changes(first: int) -> Iterator[Mapping[str, float]]:
        """From some of the sets; their motions are dropped when it ends."""
        starts = list(chain(*sets[first : first + at_once]))
        motions = processes.call(entry, motions_from, starts, dt, on_simulations=lambda done, _: on_simulations(first * size + done))
        if isinstance(motions, Breakdown):
            raise motions
        for number in range(0, len(motions), size):
            moved = compare(motions[number : number + size], few)
            yield {metric.name: abs(metric.value_or_nan(moved) - before[metric.name]) for metric in metrics}

    return list(chain(*map(changes, range(0, len(sets), at_once))))
