"""An engine at one setting: its runs, judged, from as many starts as it takes to leave luck out."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from comparisons.building import assert_built_as_meant, sound_record
from comparisons.engines.base import Diverged
from comparisons.extremes.axes import Axis, Setting, restored
from comparisons.extremes.conditions import SOUND, Condition, Finding, Run, clamped, held_speeds, judged, worst
from comparisons.isolation import Cells, Failed
from comparisons.phases import start_phases
from comparisons.simulating import Contestant
from scenarios import DropspinError, Scenario, Trajectory, truth_for
from scenarios.rotations import angle_between_orientations

Array = NDArray[np.float64]

LEAST_STEPS = 1000
"""Of a run that nothing pulls, to see whether it is stable; where something does, a longer run would be another."""
BROKEN = frozenset({"declined", "diverged", "crashed", "timed_out"})
"""Conditions of which there is no motion to compare."""
MOST_ROWS = 20_000
STARTS = 4
"""Of a scene with an impact, evenly apart within a step: what one start gets right may be luck."""
OTHER_START = 1.25
"""How much faster, and from how much higher, another start is, to see whether speeds are cut off."""
ALIKE = 1e-6
"""Over sizes and speeds of the scene: how much motions may differ whose scenes differ by a scale only."""

Look = Callable[[float], Finding]


class _Recorded(NamedTuple):
    """States for as long as the scene lasts, `every` so many steps, and of some more steps after it; and whether velocity lags."""

    own: Array
    every: int
    more: Array
    staggered: bool


class Runner:
    """An engine in its process, held to a tolerance."""

    def __init__(self, contestant: Contestant, within: float, cells: Cells) -> None:
        self.label = contestant.label
        self._contestant, self._within, self._cells = contestant, within, cells

    def along(self, setting: Setting, axis: Axis) -> Look:
        """What to look with along an axis, from value to finding."""
        if axis.name == "duration":
            return _AlongTime(self, setting, axis)
        own = _Own(self, setting, axis) if axis.promised else None

        def look(value: float) -> Finding:
            try:
                moved = axis.at(setting, value)
            except DropspinError as error:
                return _without_figure("declined", str(error))
            found = self.finding(moved)
            if own is None or found.condition != own.finding.condition or found.condition in BROKEN:
                return found
            return own.beside(moved, value)

        return look

    def finding(self, setting: Setting, goes_on: bool = True) -> Finding:
        """The worst that becomes of a scene at a step, from several starts if it has an impact; and after it."""
        scene, dt = setting
        phases = start_phases(scene, truth_for(scene), dt)
        starts = STARTS if scene.steps(dt) <= MOST_ROWS else 1
        some = phases[:: max(1, len(phases) // starts)]
        recorded = self.record([phase.scene for phase in some], dt, goes_on)
        if isinstance(recorded, Finding):
            return recorded
        runs = [self.run(Setting(phase.scene, dt), one) for phase, one in zip(some, recorded, strict=True)]
        return worst([judged(run, self._within) for run in runs] + self._clamps(setting, runs[0]))

    def record(self, scenes: Sequence[Scenario], dt: float, goes_on: bool = True) -> "list[_Recorded] | Finding":
        """What the engine does with each scene, and after it, or why it does not."""
        try:
            return self._cells.call(self._contestant, _record, scenes, dt, goes_on)
        except Failed as failure:
            return _without_figure("timed_out" if failure.verdict == "timed_out" else "crashed", failure.reason)

    def run(self, setting: Setting, recorded: _Recorded) -> Run:
        """A record as motions beside the truth."""
        scene, dt = setting
        own, every, more, staggered = recorded
        lag = 0.5 * dt if staggered else 0.0
        own_times = dt * every * np.arange(len(own), dtype=float)
        more_times = own_times[-1] + dt * np.arange(1, len(more) + 1, dtype=float)
        times, states = np.concatenate([own_times, more_times]), np.concatenate([own, more])
        return Run(scene, dt, Trajectory.from_states(own_times, own, lag), Trajectory.from_states(times, states, lag), truth_for(scene))

    def beginning(self, setting: Setting, recorded: _Recorded) -> Finding:
        """What becomes of a scene that is the beginning of a longer one."""
        rows = 1 + math.floor(setting.scene.duration / (setting.dt * recorded.every) + 1e-9)
        run = self.run(setting, recorded._replace(own=recorded.own[:rows], more=recorded.more[:0]))
        return worst([judged(run, self._within), *self._clamps(setting, run)])

    def _clamps(self, setting: Setting, run: Run) -> list[Finding]:
        """Whether speeds that look cut off are: from another start they come out the same."""
        stays = run.scene.floor is not None and not run.scene.starts_above_floor and not any(run.scene.start.velocity)
        if run.whole.first_bad_row is not None or (stays and not any(run.scene.start.angular_velocity)) or not held_speeds(run.whole):
            return []
        state = run.scene.initial_state
        state[7:13] *= OTHER_START
        state[1] += (OTHER_START - 1.0) * (run.scene.clearance if run.scene.floor is not None else 0.0)
        other = Setting(run.scene.starting_at(state), setting.dt)
        recorded = self.record([other.scene], other.dt)
        return [] if isinstance(recorded, Finding) else clamped(run.whole, self.run(other, recorded[0]).whole)


class _Own:
    """What an engine does with a scene itself, of which another scale should give the same."""

    def __init__(self, runner: Runner, setting: Setting, axis: Axis) -> None:
        self.finding = runner.finding(setting)
        self._runner, self._setting, self._axis = runner, setting, axis
        self._recorded = runner.record([setting.scene], setting.dt)

    def beside(self, moved: Setting, value: float) -> Finding:
        """Whether a motion is the scene's own, in its units, as far as the truth says that a motion can be foretold."""
        recorded = self._runner.record([moved.scene], moved.dt)
        if isinstance(recorded, Finding) or isinstance(self._recorded, Finding):
            return self.finding
        scene, dt = self._setting
        every, own = self._recorded[0].every, self._recorded[0].own
        found = restored(recorded[0].own, self._axis, self._axis.base(self._setting), value)
        rows = min(len(own), len(found))
        for truth, step in ((truth_for(scene), dt), (truth_for(moved.scene), moved.dt)):
            if truth is not None:
                rows = min(rows, int(np.count_nonzero(truth.covers(step * every * np.arange(rows, dtype=np.float64)))))
        apart = _apart(own[:rows], found[:rows], scene.body.size, float(np.linalg.norm(scene.acceleration)))
        if apart <= ALIKE:
            return SOUND
        said = f"another motion than at the scene's own {self._axis.name}, by {apart:.1e} of its sizes and speeds; it should be the same"
        return Finding("inaccurate", f"depends on {self._axis.name}", apart, said)


def _apart(first: Array, second: Array, size: float, g: float) -> float:
    """The largest difference of two motions, over sizes and speeds; infinite if one has numbers that are none."""
    if not (np.isfinite(first).all() and np.isfinite(second).all()):
        return math.inf
    turned = float(angle_between_orientations(first[:, 3:7], second[:, 3:7]).max())
    # Of what moves the body at all: a speed that is rounding is no scale.
    speed = max(float(np.abs(first[:, 7:10]).max()), size * float(np.abs(first[:, 10:13]).max()), math.sqrt(g * size))
    scales = ((slice(0, 3), size), (slice(7, 10), speed), (slice(10, 13), speed / size))
    ratios = [float(np.abs(first[:, part] - second[:, part]).max()) / scale for part, scale in scales if scale > 0.0]
    return max(turned, *ratios)


class _AlongTime:
    """Durations: those to begin with are run, those between are the beginnings of a longer run."""

    def __init__(self, runner: Runner, setting: Setting, axis: Axis) -> None:
        self._runner, self._setting, self._axis = runner, setting, axis
        self._beginning = runner.finding(setting, goes_on=False)
        self._runs: dict[float, _Recorded | Finding] = {}

    def __call__(self, duration: float) -> Finding:
        moved = self._axis.at(self._setting, duration)
        longer = [length for length in self._runs if length >= duration]
        if not longer:
            recorded = self._runner.record([moved.scene], moved.dt, goes_on=False)
            self._runs[duration] = recorded if isinstance(recorded, Finding) else recorded[0]
        found = self._runs[min(longer, default=duration)]
        return found if isinstance(found, Finding) else worst([self._beginning, self._runner.beginning(moved, found)])


def _without_figure(condition: Condition, reason: str) -> Finding:
    return Finding(condition, condition, math.nan, reason)


def _record(contestant: Contestant, scenes: Sequence[Scenario], dt: float, goes_on: bool) -> list[_Recorded] | Finding:
    engine = contestant.engine
    assert engine is not None
    refusal = engine.declines(scenes[0])
    if refusal is not None:
        return _without_figure("declined", refusal)
    found = []
    for scene in scenes:
        steps = scene.steps(dt)
        every = max(1, -(-steps // MOST_ROWS))
        more = max(0, LEAST_STEPS - steps) if goes_on and scene.gravity is None else 0
        with engine.prepare(scene, dt) as simulation:
            assert_built_as_meant(engine, scene, simulation)
            try:
                own = sound_record(simulation.record(steps, every), 1 + steps // every)
                later = sound_record(simulation.record(more), 1 + more)[1:] if np.isfinite(own[-1]).all() else own[:0]
            except Diverged as gave_up:
                return Finding("diverged", "gave up", math.inf, str(gave_up))
            found.append(_Recorded(own, every, later, simulation.staggered))
    return found
