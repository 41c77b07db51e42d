"""Runs from perturbed starts: how far the metrics move if the initial states are perturbed by a few eps estimates what rounding may do."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from dropspin.comparisons.engines.base import KnownLimitation
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.metrics import metrics_for
from dropspin.comparisons.measuring.requirements import starts_in_flight
from dropspin.comparisons.running.arguments import MOST_ROWS, EngineEntry
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.engine_run import motions_from
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.start_phases import StartPhase, compare
from dropspin.scenarios import Scenario
from dropspin.scenarios.state import Array

PERTURBATION = 16.0
"""Perturbation of each number of an initial state, in eps of the engine's precision, by which the effect of rounding is measured."""
_FIRST, _SECOND = np.random.default_rng(0).choice([-1.0, 1.0], (2, 13))
SIGNS = (_FIRST, -_FIRST, _SECOND, -_SECOND)
"""The signs of the perturbations: two random sets and their opposites."""
SETS_OF_STARTS = 2
"""Number of perturbations of many initial states at a time."""
PERTURBED_PHASES = 8
"""Start phases from which perturbed motions are simulated. The mean over these changes as that over all phases if they change alike, and
more if they change at random.
"""
IN_BATCHES = KnownLimitation(
    "the motion in a batch is not that of a single simulation; dropspin conform --check batches says where they differ"
)
"""It widens no tolerance: perturbed starts are compared with the same start in their batch."""


class Changes(NamedTuple):
    """How much every metric changes, by name: with each set of perturbed starts, and in a batch instead of a single simulation."""

    of_starts: list[Mapping[str, float]]
    in_batch: Mapping[str, float]


def perturbed(scene: Scenario, signs: Array, precision: type) -> Scenario:
    """A scene with its initial state perturbed by a few eps of a precision.

    The height and the orientation of a body that touches the floor are perturbed by eps of double precision, because those of single
    precision would lift it or sink it.
    """
    start, sizes = scene.initial_state, np.full(13, PERTURBATION * float(np.finfo(precision).eps))
    if not starts_in_flight(scene):
        sizes[: 7 if scene.wall else 0] = sizes[[1, 3, 4, 5, 6]] = PERTURBATION * float(np.finfo(float).eps)
    return scene.starting_at(start * (1.0 + sizes * signs))


def _signs(own: StartPhase, precision: type, starts: int) -> Sequence[Array]:
    """The perturbations of a number of initial states of a scene; none if there are many and none touches the floor.

    The sign of a perturbation decides whether all of many initial states touch the floor or none, so each is followed by its opposite.
    A quick run has perturbed starts only in single precision, where verdicts need them.
    """
    if own.quick and precision is np.float64:
        return ()
    if starts == 1:
        return SIGNS
    return () if starts_in_flight(own.scene) else SIGNS[:SETS_OF_STARTS]


def number_of_simulations(own: StartPhase, precision: type, phases: int) -> int:
    """The number of simulations from perturbed starts of a scene with a number of start phases."""
    size = len(range(0, phases, _stride(phases)))
    return size * len(_signs(own, precision, size))


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
) -> Changes:
    """How much every metric changes with each set of perturbed starts, and in a batch.

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
    stride, metrics = _stride(len(phases)), metrics_for(own.scene, own.truth)
    phases, cases = phases[::stride], cases[::stride]
    size, signs = len(phases), _signs(own, precision, len(phases))
    before = {metric.name: metric.value_or_nan(cases) for metric in metrics} if signs else {}
    in_batch = dict.fromkeys(before, 0.0)
    at_once = max(1, MOST_ROWS // (size * own.scene.steps(dt)))
    if size > 1:  # they roll about their corners: perturbed by eps of single precision they would slip, which is another motion
        precision = np.float64

    def changes(first: int) -> Iterator[Mapping[str, float]]:
        """From some of the perturbations; their motions are dropped when it ends."""
        starts = [perturbed(phase.scene, one, precision) for one in signs[first : first + at_once] for phase in phases]
        alone = own.scene if size == 1 else None  # the motions from several phases are of a batch themselves
        motions = processes.call(
            entry,
            motions_from,
            starts,
            dt,
            alone,
            on_simulations=lambda done, total: on_simulations(first * size + done - max(total - len(starts), 0)),
        )
        if isinstance(motions, Breakdown):
            raise motions
        compared = before
        if len(motions) > len(starts) and not np.array_equal((beside := motions.pop(0)).states, cases[0].motion.states):
            moved = compare([beside], phases)
            compared = {metric.name: metric.value_or_nan(moved) for metric in metrics}
            in_batch.update({name: max(in_batch[name], abs(value - before[name])) for name, value in compared.items()})
        for number in range(0, len(motions), size):
            moved = compare(motions[number : number + size], phases)
            yield {metric.name: abs(metric.value_or_nan(moved) - compared[metric.name]) for metric in metrics}

    return Changes(list(chain(*map(changes, range(0, len(signs), at_once)))), in_batch)
