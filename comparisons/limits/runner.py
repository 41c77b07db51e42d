"""Runs of an engine at operating points, with the failure mode of each. Scenes with impacts are run from several start phases."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np

from dropspin.comparisons.limits.axes import Axis
from dropspin.comparisons.limits.failure_modes import (
    SOUND,
    Diagnosis,
    ExtendedMotion,
    FailureMode,
    clamped,
    diagnose,
    held_speeds,
    worst,
)
from dropspin.comparisons.limits.operating_point import OperatingPoint, in_nominal_units
from dropspin.comparisons.measuring.differences import differences
from dropspin.comparisons.running.arguments import MOST_ROWS, EngineEntry, ignore
from dropspin.comparisons.running.driving import Breakdown, record, verify_accepted
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.start_phases import start_phases
from dropspin.scenarios import DropspinError, Scenario, Trajectory, truth_for
from dropspin.scenarios.state import RATES

FEWEST_STEPS_WITHOUT_GRAVITY = 1000
"""Smallest number of steps of a run without gravity, to test its stability; with gravity, a longer run would be another motion."""
BROKEN = frozenset({"declined", "diverged", "crashed", "timed_out"})
"""Failure modes without a motion to compare."""
MOST_STEPS_PER_START = 20_000
"""A longer run has one start phase only."""
STARTS = 4
"""Number of start phases of a scene with an impact, evenly spaced within a step, because a single one may be accurate by chance."""
OTHER_START = 1.25
"""Factor on speed and height of a second initial state, by which clamped speeds are detected."""
SAME_MOTION = 1e-6
"""Largest difference of the scaled motions of scenes that differ only by a scale, relative to sizes and speeds of the scene."""

Diagnose = Callable[[float], Diagnosis]


@dataclass(frozen=True)
class Runner:
    """An engine in its process, the scene and time step of which a quantity is varied, and the tolerance of its errors.

    Attributes:
        entry: The engine.
        nominal: The scene and the time step.
        within: The largest error that counts as accurate.
        processes: The engine's process.
        report: Called with a description of each run.
    """

    entry: EngineEntry
    nominal: OperatingPoint
    within: float
    processes: EngineProcesses
    report: Callable[[str], None] = ignore

    def along(self, axis: Axis) -> Diagnose:
        """The function from a value on an axis to a diagnosis."""
        if axis.name == "duration":
            return self._along_duration(axis)
        if axis.invariant:
            unscaled, motions = self._diagnosis(self.nominal), self._record([self.nominal.scene], self.nominal.dt, extend=False)

        def diagnose_at(value: float) -> Diagnosis:
            try:
                moved = axis.at(self.nominal, value)
            except DropspinError as error:
                return _without_motion(Breakdown("declined", str(error)))
            diagnosis = self._diagnosis(moved)
            if not axis.invariant or diagnosis.mode != unscaled.mode or diagnosis.mode in BROKEN:
                return diagnosis
            other = self._record([moved.scene], moved.dt, extend=False)
            if isinstance(motions, Breakdown) or isinstance(other, Breakdown):
                return unscaled
            return self._dependence(axis, value, motions[0], moved.scene, other[0])

        return diagnose_at

    def _along_duration(self, axis: Axis) -> Diagnose:
        """Diagnoses of durations: the initial values are run, and those between them are beginnings of a longer run."""
        nominal = self._diagnosis(self.nominal, extend=False)
        runs: dict[float, list[Trajectory] | Breakdown] = {}

        def diagnose_at(duration: float) -> Diagnosis:
            scene, dt = axis.at(self.nominal, duration)
            longer = [length for length in runs if length >= duration]
            if not longer:
                runs[duration] = self._record([scene], dt, extend=False)
            motions = runs[min(longer, default=duration)]
            if isinstance(motions, Breakdown):
                return _without_motion(motions)
            interval = float(motions[0].t[1] - motions[0].t[0])
            beginning = motions[0][: 1 + math.floor(duration / interval + 1e-9)]
            return worst([nominal, self._of_motions([ExtendedMotion(scene, dt, beginning, beginning, truth_for(scene))])])

        return diagnose_at

    def _diagnosis(self, point: OperatingPoint, extend: bool = True) -> Diagnosis:
        """The most severe diagnosis of a scene at a time step, over its start phases, and beyond its end if `extend`."""
        scene, dt = point
        phases = start_phases(scene, truth_for(scene), dt)
        starts = STARTS if scene.steps(dt) <= MOST_STEPS_PER_START else 1
        scenes = [phase.scene for phase in phases[:: max(1, len(phases) // starts)]]
        motions = self._record(scenes, dt, extend)
        if isinstance(motions, Breakdown):
            return _without_motion(motions)
        both = zip(scenes, motions, strict=True)
        return self._of_motions([ExtendedMotion(start, dt, whole[: 1 + start.steps(dt)], whole, truth_for(start)) for start, whole in both])

    def _record(self, scenes: Sequence[Scenario], dt: float, extend: bool = True) -> list[Trajectory] | Breakdown:
        """The engine's motions of scenes, or the reason why there are none."""
        return self.processes.call(self.entry, _recorded, scenes, dt, extend)

    def _of_motions(self, motions: Sequence[ExtendedMotion]) -> Diagnosis:
        return worst([*(diagnose(motion, self.within) for motion in motions), *self._clamps(motions[0])])

    @cached_property
    def _eps(self) -> float:
        """The precision of the engine, which is not known outside its process."""
        found = self.processes.call(self.entry, _eps_of)
        return float(np.finfo(float).eps) if isinstance(found, Breakdown) else found

    def _clamps(self, motion: ExtendedMotion) -> list[Diagnosis]:
        """Speeds that are clamped: they are cut off, and have the same value from another initial state."""
        scene = motion.scene
        stays = scene.floor is not None and not scene.starts_above_floor and not any(scene.start.velocity)
        is_still = stays and not any(scene.start.angular_velocity)
        if motion.whole.first_bad_row is not None or is_still or not held_speeds(motion.whole, self._eps):
            return []
        state = scene.initial_state
        state[RATES] *= OTHER_START
        state[1] += (OTHER_START - 1.0) * (scene.clearance if scene.floor is not None else 0.0)
        other = scene.starting_at(state)
        motions = self._record([other], motion.dt)
        return [] if isinstance(motions, Breakdown) else clamped(motion.whole, motions[0], self._eps)

    def _dependence(self, axis: Axis, value: float, nominal: Trajectory, moved: Scenario, other: Trajectory) -> Diagnosis:
        """Whether the motion of a scaled scene equals the nominal one in its units, up to the end of the exact solution."""
        scene = self.nominal.scene
        scaled = in_nominal_units(other.states, axis.name, axis.base(self.nominal), value)
        rows = min(len(nominal), len(scaled))
        for truth, times in ((truth_for(scene), nominal.t[:rows]), (truth_for(moved), other.t[:rows])):
            if truth is not None:
                rows = min(rows, int(np.count_nonzero(truth.covers(times))))
        difference = float(differences(scene, nominal.states[:rows], scaled[:rows]).max())
        if difference <= SAME_MOTION:
            return SOUND
        message = f"the motion differs from the one at the nominal {axis.name} by {difference:.1e} of its sizes and speeds"
        return Diagnosis("inaccurate", f"depends on {axis.name}", difference, message)


def _recorded(entry: EngineEntry, scenes: Sequence[Scenario], dt: float, extend: bool) -> list[Trajectory]:
    """The engine's motions of scenes, beyond their end if `extend`; runs in the engine's process.

    Of more than `MOST_ROWS` steps, only evenly spaced states are recorded.
    """
    motions = []
    for scene in scenes:
        verify_accepted(entry.adapter, scene)
        steps = scene.steps(dt)
        extra = max(0, FEWEST_STEPS_WITHOUT_GRAVITY - steps) if extend and scene.gravity is None else 0
        motions.append(record(entry.adapter, scene, dt, max(1, -(-steps // MOST_ROWS)), extra_steps=extra).motion)
    return motions


def _eps_of(entry: EngineEntry) -> float:
    return float(np.finfo(entry.adapter.precision).eps)


def _without_motion(breakdown: Breakdown) -> Diagnosis:
    if breakdown.verdict == "diverged":
        return Diagnosis("diverged", "gave up", math.inf, breakdown.reason)
    return Diagnosis(cast(FailureMode, breakdown.verdict), breakdown.verdict, math.nan, breakdown.reason)
