"""`dropspin symmetries twins`: from which time step on engines that should give the same motion differ, and by how much.

Twins are engines that state the same algorithm, such as one engine on a processor and its port to a GPU. No exact solution is needed. As
for symmetries, a difference is attributed to rounding as long as perturbations of the initial state by a few eps have as large an effect
in one of the two engines.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, combinations

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.measuring.differences import differences
from dropspin.comparisons.measuring.motion_quantities import Motions
from dropspin.comparisons.running.arguments import EngineEntry, SceneLike, as_scenes, ignore, verify_time_step
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.engine_entries import engine_entries
from dropspin.comparisons.running.parallel import results_in_parallel, started_crews
from dropspin.comparisons.running.process_limits import ONE_MINUTE, ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.symmetries.findings import Finding, Status, judged
from dropspin.comparisons.symmetries.study import DT, effects_of_rounding, states_of
from dropspin.scenarios import DropspinError, Scenario, Trajectory
from dropspin.scenarios.state import Array

LEVELS = (1e-12, 1e-9, 1e-6, 1e-3)
"""Differences whose first time steps are reported, of angles [rad] and relative to sizes and speeds."""


@dataclass(frozen=True)
class TwinFinding:
    """How far two engines agree in one scene.

    Attributes:
        scene: Name of the scene.
        engine: Label of one engine.
        twin: Label of the other.
        status: If rounding explains the difference, `kept` (up to 1e-5) or `rounding` (above 1e-5); if not, `nearly kept` (up to 1e-5)
            or `lost` (above 1e-5); `not run` if one of the engines has no motion.
        first: The first time step after which any number of the states differs; 0 is the start, None if all have the same bits.
        before_contact: The largest difference up to the last step before either motion has a contact, of angles [rad] and relative to
            sizes and speeds.
        after_contact: The largest difference after this step; NaN if there is no contact.
        beyond: For each of `LEVELS`, the first time step after which the difference exceeds it; None if it never does.
        unexplained: The first time step after which rounding does not explain the difference; None if it always does.
        reason: Why there is no motion to compare; otherwise empty.
    """

    scene: str
    engine: str
    twin: str
    status: Status
    first: int | None = None
    before_contact: float = math.nan
    after_contact: float = math.nan
    beyond: dict[float, int | None] = field(default_factory=dict)
    unexplained: int | None = None
    reason: str = ""


def twins(
    scenes: SceneLike | Iterable[SceneLike],
    engines: Iterable[Engine | str],
    *,
    dt: float = DT,
    on_progress: Callable[[str, float], None] | None = None,
    resources: ResourceLimits = ONE_MINUTE,
    jobs: int | None = None,
) -> list[TwinFinding]:
    """Run scenes with engines that should give the same motions, and compare these pair by pair.

    Args:
        scenes: One scene or several: scenes, catalogue names, paths of files, or mappings.
        engines: Two engines or more: engines, or names with options.
        dt: Time step [s].
        on_progress: Called with a description of the current work and the fraction of the whole study that is done, from 0 to 1, in any
            thread, but in one at a time.
        resources: The processor time [s] and memory [bytes] that an engine may use for one scene.
        jobs: Number of scenes to run at a time; by default, the number of processors that this process may use. It changes no result.

    Returns:
        One result for each scene and pair of engines.

    Raises:
        DropspinError: A scene or an engine does not exist, there are fewer than two engines, or a time step does not fit a scene.
    """
    chosen = as_scenes(scenes)
    entries = engine_entries(engines)
    if len(entries) < 2:
        raise DropspinError(f"twins: got {len(entries)} engine{'s' * (len(entries) != 1)}; name at least two, such as mujoco and mjx.")
    for scene in chosen:
        verify_time_step(scene, dt)

    def of_scene(scene: Scenario, processes: EngineProcesses, report: Callable[[str], None]) -> list[TwinFinding]:
        report(scene.name)
        return list(_of_scene(processes, entries, scene, dt))

    with started_crews(jobs, len(chosen), entries, resources) as crews:
        return list(chain.from_iterable(results_in_parallel(chosen, of_scene, crews, on_progress or ignore)))


def _of_scene(processes: EngineProcesses, entries: Sequence[EngineEntry], scene: Scenario, dt: float) -> Iterator[TwinFinding]:
    """The findings for all pairs of engines in one scene."""
    motions = {entry.label: processes.call(entry, states_of, scene, dt) for entry in entries}
    effects: dict[str, list[Array]] = {}

    def effects_of(*both: tuple[EngineEntry, Array]) -> list[Array]:
        """Of rounding, on each of two engines."""
        for entry, states in both:
            if entry.label not in effects:
                result = processes.call(entry, effects_of_rounding, scene, dt, states)
                effects[entry.label] = [] if isinstance(result, Breakdown) else result
        return [effect for entry, _ in both for effect in effects[entry.label]]

    for entry, twin in combinations(entries, 2):
        none = TwinFinding(scene.name, entry.label, twin.label, "not run")
        first, second = motions[entry.label], motions[twin.label]
        if isinstance(first, Breakdown) or isinstance(second, Breakdown):
            broken = [(engine.label, motion) for engine, motion in ((entry, first), (twin, second)) if isinstance(motion, Breakdown)]
            yield replace(none, reason="; ".join(f"{label}: {breakdown.reason.removesuffix('.')}" for label, breakdown in broken))
            continue
        coarser = max(entry.adapter.precision, twin.adapter.precision, key=lambda precision: float(np.finfo(precision).eps))
        of_rounding = partial(effects_of, (entry, first), (twin, second))
        judgement = judged(Finding(scene.name, entry.label, twin.label, "not run"), scene, dt, [(first, second)], of_rounding, coarser)
        difference, times = differences(scene, first, second), dt * np.arange(len(first), dtype=float)
        until = 1 + min(int(Motions.of(scene, Trajectory.from_states(times, states)).first_flight_end) for states in (first, second))
        yield replace(
            none,
            status=judgement.status,
            first=_first((first != second).any(axis=1)),
            before_contact=float(difference[:until].max()),
            after_contact=float(difference[until:].max(initial=-np.inf)) if until < len(difference) else math.nan,
            beyond={level: _first(difference > level) for level in LEVELS},
            unexplained=judgement.step,
        )


def _first(rows: NDArray[np.bool_]) -> int | None:
    """The first row that is True; None if there is none."""
    return int(rows.argmax()) if rows.any() else None
