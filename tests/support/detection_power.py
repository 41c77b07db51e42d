"""Smallest detectable fault of each parameter, in exact and in real engines: part of `make faults`, which writes docs/faults.md.

A faulty engine is a real adapter that is given a scene whose parameter differs by a relative size s from the scene that it is judged by,
and that hides this: it reports the right start, and not what it built.
"""

import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from copy import copy
from functools import cache, partial
from itertools import product
from math import inf
from typing import NamedTuple

import numpy as np

from dropspin.comparisons.engines.base import Engine, Simulation
from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.running.arguments import DEFAULT_DTS
from dropspin.comparisons.running.run import run
from dropspin.scenarios import load
from dropspin.scenarios.damping import Damping
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.state import VELOCITY
from support.fault_suite import (
    Made,
    with_body,
    with_coefficient,
    with_gravity,
    with_restitution,
    with_spin,
    write_section,
)
from support.gyroscopic_fault import wrong_gyroscope

Prepare = Callable[[Scenario, float], Simulation]
SIZES = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4)
REQUIRED = 3e-3
FINER_DTS = (*DEFAULT_DTS, 5e-4, 2.5e-4)


class Disguised(Simulation):
    """A simulation of another scene that reports the start of the right one."""

    def __init__(self, inner: Simulation, start: np.ndarray) -> None:
        self._inner, self._start, self._has_moved = inner, start, False
        self.velocity_lag, self.settings = inner.velocity_lag, inner.settings

    @property
    def known_limitations(self):
        return self._inner.known_limitations

    def advance(self, steps):
        self._inner.advance(steps)
        self._has_moved |= steps > 0

    def state(self):
        return self._inner.state() if self._has_moved else self._start.copy()

    def record(self, steps, every=1):
        rows = self._inner.record(steps, every)
        rows[0] = rows[0] if self._has_moved else self._start
        self._has_moved |= steps > 0
        return rows

    def close(self):
        self._inner.close()


# Faults: how an engine whose parameter is wrong by a size s prepares a scene.


def changed(change):
    """A fault of the scene that is simulated; `change(s)` is a function of the scene."""

    def plant(prepare: Prepare, scene: Scenario, dt: float, s: float) -> Simulation:
        return prepare(change(s)(scene), dt)

    return plant


def wrong_step(prepare, scene, dt, s):
    return prepare(scene, (1.0 + s) * dt)


def with_tilt(s):
    return with_gravity(np.eye(3) + s * np.eye(3, k=1))


def with_velocity(s):
    def change(scene):
        state = scene.initial_state
        state[VELOCITY] *= 1.0 + s
        return scene.starting_at(state)

    return change


def with_damping_rates(s, linear=0.0, angular=0.0):
    """Rates of damping that are wrong by shares of s."""

    def change(scene):
        rates = Damping(linear=(1.0 + linear * s) * scene.damping.linear, angular=(1.0 + angular * s) * scene.damping.angular)
        return scene.model_copy(update={"damping": rates})

    return change


def with_moment(axis):
    def change(s):
        return with_body(moments=lambda moments: moments * (1.0 + s * (np.arange(3) == axis)))

    return changed(change)


class SizedFault(NamedTuple):
    """A parameter, how an engine is prepared in which it is wrong by a share s, and scenes in which it matters, the most telling first."""

    title: str
    plant: Callable[[Prepare, Scenario, float, float], Simulation]
    scenes: tuple[str, ...]


TUMBLES = ("spin-asymmetric", "drop-box-corner", "drop-box-sticking")
ROLLS = ("tip-box", "drop-ball-backspin")
FAULTS = (
    SizedFault("gravity", changed(lambda s: with_gravity((1 + s) * np.eye(3))), ("fall-spin", "drop-ball")),
    SizedFault("direction of gravity, of 1 rad", changed(with_tilt), ("fall-spin", "drop-ball")),
    SizedFault("restitution", changed(lambda s: with_restitution(lambda e: (1 + s) * e)), ("drop-ball", "drop-ball-lively")),
    SizedFault("Coulomb coefficient", changed(lambda s: with_coefficient(1 + s)), ("slide-box", "turn-box-rough")),
    SizedFault("mass, with correct inertia", changed(lambda s: with_body(mass=1 + s)), ROLLS),
    SizedFault("inertia", changed(lambda s: with_body(moments=lambda m: (1 + s) * m)), ROLLS),
    SizedFault("moment of inertia about x", with_moment(0), TUMBLES),
    SizedFault("moment of inertia about y", with_moment(1), TUMBLES),
    SizedFault("moment of inertia about z", with_moment(2), TUMBLES),
    SizedFault("gyroscopic term", wrong_gyroscope, ("spin-dzhanibekov", "spin-asymmetric")),
    SizedFault("initial angular velocity", changed(lambda s: with_spin(lambda w, q: (1 + s) * w)), ("fall-spin", "spin-principal")),
    SizedFault("initial velocity", changed(with_velocity), ("fall-spin",)),
    SizedFault("linear damping", changed(partial(with_damping_rates, linear=1.0)), ("fall-damped",)),
    SizedFault("angular damping", changed(partial(with_damping_rates, angular=1.0)), ("spin-damped",)),
    SizedFault("time step", wrong_step, ("fall-spin", "drop-ball")),
)
SEQUENTIAL = "wang[contact=sequential,law=coulomb,rotation=rk4]"
ENGINES = ("exact", "wang", SEQUENTIAL, "mujoco", "pybullet")
NOT_EXPRESSED = {("gyroscopic term", "wang")}  # eq 6 of Wang's method has no such term


def sound_engine(name: str) -> Engine:
    """An engine without a fault; `exact` samples the exact solution."""
    return Made(title="exact") if name == "exact" else engine(name)


def faulty_engine(name: str, fault: SizedFault, s: float) -> Engine:
    """An engine with a fault; all that it states of itself, its label included, stays."""
    sound = sound_engine(name)
    faulty = copy(sound)
    prepare = lambda scene, dt: Disguised(fault.plant(sound.prepare, scene, dt, s), scene.initial_state)  # noqa: E731
    object.__setattr__(faulty, "prepare", prepare)
    object.__setattr__(faulty, "prepare_batch", lambda members, dt: None)  # which would not have the fault
    return faulty


def rows_with(verdicts: Sequence[str], scene: str, simulated: Engine, dts: Sequence[float]) -> set[tuple[str, str, str]]:
    """Kind, metric and time step of the measurements of a run that have some verdicts.

    Raises:
        RuntimeError: The engine broke down, which detects no wrong parameter.
    """
    with np.errstate(all="ignore"):
        table = run(scene, simulated, dts).table
    broken = table[table["verdict"].isin(["crashed", "timed_out", "declined"])]
    if len(broken):
        raise RuntimeError(f"{simulated.label} in {scene}: {broken['reason'].iloc[0]}")
    return {(row.kind, row.metric, str(row.dt)) for row in table[table["verdict"].isin(verdicts)].itertuples()}


FAILED = ("failed", "diverged")


@cache
def failed_without_fault(name: str, scene: str, dts: tuple[float, ...]) -> set[tuple[str, str, str]]:
    """The measurements that an engine fails without a fault."""
    return rows_with(FAILED, scene, sound_engine(name), dts)


def failures(name: str, fault: SizedFault, s: float, scene: str, dts: tuple[float, ...] = DEFAULT_DTS) -> set[tuple[str, str, str]]:
    """The measurements of a scene that an engine fails because of a fault."""
    return rows_with(FAILED, scene, faulty_engine(name, fault, s), dts) - failed_without_fault(name, scene, dts)


def is_caught(name: str, fault: SizedFault, s: float, dts: tuple[float, ...]) -> bool:
    """Whether a fault of a size is detected in one of its scenes, the parameter being too large and too small."""
    return all(any(failures(name, fault, signed, scene, dts) for scene in fault.scenes) for signed in (s, -s))


def smallest_caught(name: str, fault: SizedFault, dts: tuple[float, ...] = DEFAULT_DTS) -> float:
    """The smallest of the sizes that is detected, by bisection; inf if none is."""
    caught, missed = -1, len(SIZES)
    while missed - caught > 1:
        middle = (caught + missed) // 2
        caught, missed = (middle, missed) if is_caught(name, fault, SIZES[middle], dts) else (caught, middle)
    return SIZES[caught] if caught >= 0 else inf


class Power(NamedTuple):
    """The smallest detectable size of a fault, or why there is none, in words; and whether that is enough, or cannot be better."""

    words: str
    is_enough: bool


def _percent(size: float) -> str:
    return f"{100 * size:g} %" if size < inf else f"> {100 * SIZES[0]:g} %"


def detection_power(number: int, name: str) -> Power:
    """The smallest detectable size of a fault in an engine at the default time steps and, where that is too large, at finer ones too."""
    fault = FAULTS[number]
    if (fault.title, name) in NOT_EXPRESSED or any(sound_engine(name).refusal(load(scene)) for scene in fault.scenes):
        return Power("–", True)
    size = smallest_caught(name, fault, DEFAULT_DTS)
    if size <= REQUIRED:
        return Power(_percent(size), True)
    finer = smallest_caught(name, fault, FINER_DTS)
    limited = any(metric for scene in fault.scenes for _, metric, _ in rows_with(["limited"], scene, sound_engine(name), DEFAULT_DTS))
    words = f"{_percent(size)}; {_percent(finer)} at finer steps" if finer < size else _percent(size)
    return Power(words + " (limited)" * limited, finer <= REQUIRED or limited)


def as_table(words: Sequence[str]) -> str:
    """The table of the results, engine by engine and fault by fault."""
    head = ["parameter", *(f"`{name}`" for name in ENGINES), "scenes"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for number, fault in enumerate(FAULTS):
        row = words[len(ENGINES) * number :][: len(ENGINES)]
        lines.append("| " + " | ".join([fault.title, *row, ", ".join(fault.scenes)]) + " |")
    return "\n".join(lines) + "\n"


def main() -> int:
    """Print the table and write it to docs/faults.md; 1 if a fault of the required size is missed."""
    numbers, names = zip(*product(range(len(FAULTS)), ENGINES), strict=True)
    found = []
    with ProcessPoolExecutor() as pool:
        for number, name, power in zip(numbers, names, pool.map(detection_power, numbers, names), strict=True):
            sys.stdout.write(f"{FAULTS[number].title}, {name}: {power.words}\n")
            found.append(power)
    write_section("sizes", as_table([power.words for power in found]))
    return 0 if all(power.is_enough for power in found) else 1


if __name__ == "__main__":
    sys.exit(main())
