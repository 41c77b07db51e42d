"""Runs of an engine at operating points, with the failure mode of each. Scenes with impacts are run from several start phases."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.measuring.differences import differences
from dropspin.comparisons.robustness.axes import Axis
from dropspin.comparisons.robustness.failure_modes import (
    SOUND,
    Diagnosis,
    ExtendedMotion,
    FailureMode,
    clamped,
    diagnose,
    held_speeds,
    worst,
)
from dropspin.comparisons.robustness.operating_point import OperatingPoint
from dropspin.comparisons.robustness.transformations import in_nominal_units
from dropspin.comparisons.running.engine_process import Failed
from dropspin.comparisons.running.inputs import EngineEntry
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.recording import Breakdown, Recording, try_record
from dropspin.comparisons.running.start_phases import start_phases
from dropspin.scenarios import DropspinError, Scenario, Trajectory, truth_for
from dropspin.scenarios.state import RATES

Array = NDArray[np.float64]

FEWEST_STEPS_WITHOUT_GRAVITY = 1000
"""Smallest number of steps of a run without gravity, to test its stability; with gravity, a longer run would be another motion."""
BROKEN = frozenset({"declined", "diverged", "crashed", "timed_out"})
"""Failure modes without a motion to compare."""
MOST_STEPS_PER_START = 20_000
"""A longer run has one start phase only."""
MOST_ROWS = 400_000
"""Of a longer run, only evenly spaced states are recorded."""
STARTS = 4
"""Number of start phases of a scene with an impact, evenly spaced within a step, because a single one may be accurate by chance."""
OTHER_START = 1.25
"""Factor on speed and height of a second initial state, by which clamped speeds are detected."""
SAME_MOTION = 1e-6
"""Largest difference of the scaled motions of scenes that differ only by a scale, relative to sizes and speeds of the scene."""

Diagnose = Callable[[float], Diagnosis]


class Runner:
    """An engine in its process, and the tolerance with which it is judged."""

    def __init__(self, entry: EngineEntry, within: float, processes: EngineProcesses) -> None:
        self.label = entry.label
        self._entry, self._within, self._processes = entry, within, processes

    def along(self, nominal: OperatingPoint, axis: Axis) -> Diagnose:
        """The function from a value on an axis to a diagnosis."""
        if axis.name == "duration":
            return _AlongDuration(self, nominal, axis)
        unscaled = _Unscaled(self, nominal, axis) if axis.invariant else None

        def diagnose_at(value: float) -> Diagnosis:
            try:
                moved = axis.at(nominal, value)
            except DropspinError as error:
                return _without_value("declined", str(error))
            found = self.diagnosis(moved)
            if unscaled is None or found.mode != unscaled.diagnosis.mode or found.mode in BROKEN:
                return found
            return unscaled.compare(moved, value)

        return diagnose_at

    def diagnosis(self, point: OperatingPoint, extend: bool = True) -> Diagnosis:
        """The most severe diagnosis of a scene at a time step, over its start phases, and beyond its end if `extend`."""
        scene, dt = point
        phases = start_phases(scene, truth_for(scene), dt)
        starts = STARTS if scene.steps(dt) <= MOST_STEPS_PER_START else 1
        some = phases[:: max(1, len(phases) // starts)]
        recordings = self.record([phase.scene for phase in some], dt, extend)
        if isinstance(recordings, Diagnosis):
            return recordings
        motions = [_extended(phase.scene, dt, one) for phase, one in zip(some, recordings, strict=True)]
        return worst([diagnose(one, self._within) for one in motions] + self._clamps(point, motions[0]))

    def record(self, scenes: Sequence[Scenario], dt: float, extend: bool = True) -> "list[Recording] | Diagnosis":
        """The engine's motions of scenes, or the reason why there are none."""
        try:
            return self._processes.call(self._entry, _record, scenes, dt, extend)
        except Failed as failure:
            return _without_value("timed_out" if failure.verdict == "timed_out" else "crashed", failure.reason)

    def beginning(self, point: OperatingPoint, recording: Recording) -> Diagnosis:
        """The diagnosis of the beginning of a longer motion."""
        interval = float(recording.motion.t[1] - recording.motion.t[0])
        rows = 1 + math.floor(point.scene.duration / interval + 1e-9)
        cut = replace(recording, motion=recording.motion[:rows], continuation=recording.continuation[:0])
        motion = _extended(point.scene, point.dt, cut)
        return worst([diagnose(motion, self._within), *self._clamps(point, motion)])

    def _clamps(self, point: OperatingPoint, motion: ExtendedMotion) -> list[Diagnosis]:
        """Speeds that are clamped: they are cut off, and have the same value from another initial state."""
        scene = motion.scene
        stays = scene.floor is not None and not scene.starts_above_floor and not any(scene.start.velocity)
        if motion.whole.first_bad_row is not None or (stays and not any(scene.start.angular_velocity)) or not held_speeds(motion.whole):
            return []
        state = scene.initial_state
        state[RATES] *= OTHER_START
        state[1] += (OTHER_START - 1.0) * (scene.clearance if scene.floor is not None else 0.0)
        other = scene.starting_at(state)
        recordings = self.record([other], point.dt)
        return [] if isinstance(recordings, Diagnosis) else clamped(motion.whole, _extended(other, point.dt, recordings[0]).whole)


class _Unscaled:
    """The scene at its nominal scale, whose motion every other scale should reproduce in scaled units."""

    def __init__(self, runner: Runner, nominal: OperatingPoint, axis: Axis) -> None:
        self.diagnosis = runner.diagnosis(nominal)
        self._runner, self._nominal, self._axis = runner, nominal, axis
        self._recordings = runner.record([nominal.scene], nominal.dt)

    def compare(self, moved: OperatingPoint, value: float) -> Diagnosis:
        """Whether the scaled motion equals the nominal one, up to the end of the exact solution."""
        recordings = self._runner.record([moved.scene], moved.dt)
        if isinstance(recordings, Diagnosis) or isinstance(self._recordings, Diagnosis):
            return self.diagnosis
        scene = self._nominal.scene
        own, other = self._recordings[0].motion, recordings[0].motion
        found = in_nominal_units(other.states, self._axis.name, self._axis.base(self._nominal), value)
        rows = min(len(own), len(found))
        for truth, times in ((truth_for(scene), own.t[:rows]), (truth_for(moved.scene), other.t[:rows])):
            if truth is not None:
                rows = min(rows, int(np.count_nonzero(truth.covers(times))))
        difference = float(differences(scene, own.states[:rows], found[:rows]).max())
        if difference <= SAME_MOTION:
            return SOUND
        message = f"the motion differs from the one at the nominal {self._axis.name} by {difference:.1e} of its sizes and speeds"
        return Diagnosis("inaccurate", f"depends on {self._axis.name}", difference, message)


class _AlongDuration:
    """Diagnoses of durations: the initial values are run, and those between them are beginnings of a longer run."""

    def __init__(self, runner: Runner, nominal: OperatingPoint, axis: Axis) -> None:
        self._runner, self._nominal, self._axis = runner, nominal, axis
        self._beginning = runner.diagnosis(nominal, extend=False)
        self._runs: dict[float, Recording | Diagnosis] = {}

    def __call__(self, duration: float) -> Diagnosis:
        moved = self._axis.at(self._nominal, duration)
        longer = [length for length in self._runs if length >= duration]
        if not longer:
            recordings = self._runner.record([moved.scene], moved.dt, extend=False)
            self._runs[duration] = recordings if isinstance(recordings, Diagnosis) else recordings[0]
        found = self._runs[min(longer, default=duration)]
        return found if isinstance(found, Diagnosis) else worst([self._beginning, self._runner.beginning(moved, found)])


def _extended(scene: Scenario, dt: float, recording: Recording) -> ExtendedMotion:
    """A recorded motion as a `Motion`: for the duration of the scene, and as a whole."""
    own, more = recording.motion, recording.continuation
    times, states = np.concatenate([own.t, more.t]), np.concatenate([own.states, more.states])
    return ExtendedMotion(scene, dt, own, Trajectory.from_states(times, states, own.velocity_lag), truth_for(scene))


def _without_value(mode: FailureMode, reason: str) -> Diagnosis:
    return Diagnosis(mode, mode, math.nan, reason)


def _record(entry: EngineEntry, scenes: Sequence[Scenario], dt: float, extend: bool) -> list[Recording] | Diagnosis:
    """The engine's motions of scenes, or the reason why there are none; runs in the engine's process."""
    found = []
    for scene in scenes:
        steps = scene.steps(dt)
        extra = max(0, FEWEST_STEPS_WITHOUT_GRAVITY - steps) if extend and scene.gravity is None else 0
        recording = try_record(entry.adapter, scene, dt, max(1, -(-steps // MOST_ROWS)), extra_steps=extra)
        if isinstance(recording, Breakdown):
            if recording.verdict == "diverged":
                return Diagnosis("diverged", "gave up", math.inf, recording.reason)
            return _without_value("declined" if recording.verdict == "declined" else "crashed", recording.reason)
        found.append(recording)
    return found
