"""Engines made for tests: the exact motion, sampled, and the same with one fault each; and the scenes that take seconds."""

import numpy as np

from dropspin.comparisons.engines.base import BatchSimulation, Diverged, Engine, Simulation
from dropspin.scenarios import load, names, truth_for
from dropspin.scenarios.rotations import multiply

SLOW = tuple(name for name in names() if "slow" in load(name).tags)
QUICK = tuple(name for name in names() if name not in SLOW)
CORE = tuple(name for name in names() if "core" in load(name).tags)


class ExactSimulation(Simulation):
    """Samples the truth."""

    def __init__(self, scene, dt, distort=None):
        self._truth, self._dt, self._step, self._distort = truth_for(scene), dt, 0, distort
        self._start = scene.initial_state
        self.settings = {"made": "for tests"}

    def advance(self, steps):
        self._step += steps

    def state(self):
        return self._states(np.array([self._step]))[0]

    def record(self, steps, every):  # no default, because dropspin gives both
        rows = self._states(self._step + every * np.arange(1 + steps // every))
        self._step += steps
        return rows

    def _states(self, steps):
        times = np.minimum(steps * self._dt, self._truth.horizon)
        exact = self._truth(times).states
        exact[steps == 0] = self._start  # which some truths give to rounding only
        if self._distort is None:
            return exact
        return np.array([self._distort(row, time) if time > 0 else row for row, time in zip(exact, times, strict=True)])


class Exact(Engine):
    """No error at all."""

    name = "exact"
    order = float("inf")
    distort = None

    def prepare(self, scene, dt):
        return ExactSimulation(scene, dt, type(self).distort)


class Together(BatchSimulation):
    """Single simulations as a batch, whose record passes through a function."""

    def __init__(self, simulations, change=lambda motions: motions):
        self._simulations, self._change = simulations, change
        self.velocity_lag = simulations[0].velocity_lag

    def advance(self, steps):
        for simulation in self._simulations:
            simulation.advance(steps)

    def states(self):
        return np.array([simulation.state() for simulation in self._simulations])

    def record(self, steps, every):  # no default, because dropspin gives both
        return self._change(np.array([simulation.record(steps, every) for simulation in self._simulations]))


def in_batches(name, change, of=Exact):
    """An engine whose batches pass their record, shape (size, rows, 13), through a function."""

    def prepare_batch(self, members, dt):
        return Together([self.prepare(member, dt) for member in members], change)

    return type("Batched", (of,), {"name": name, "prepare_batch": prepare_batch, "__doc__": name})()


def engine_with(name, distort):
    """The exact engine, with each state after the start passed through `distort(state, time)`."""
    return type("Distorted", (Exact,), {"name": name, "distort": staticmethod(distort), "__doc__": name})()


def nan_after_half_a_second(state, time):
    return state * np.nan if time > 0.5 else state


def turned_by(angle):
    """An attitude that is wrong by a fixed angle."""

    def distort(state, time):
        state = state.copy()
        state[3:7] = multiply(np.array([np.sin(angle / 2), 0, 0, np.cos(angle / 2)]), state[3:7])
        return state

    return distort


class Crashing(Exact):
    """Raises on the way."""

    name = "crashing"

    def prepare(self, scene, dt):
        raise RuntimeError("no such thing as a floor")


class GivingUp(Exact):
    """Says that it diverged."""

    name = "giving-up"

    def prepare(self, scene, dt):
        raise Diverged("step 3: a number beyond 1e10")


class Declining(Exact):
    """Will not."""

    name = "declining"

    def declines(self, scene):
        return "I do not bounce"


class HeavyInertia(Exact):
    """Simulates another body than it was given, and says so when asked."""

    name = "heavy-inertia"

    def prepare(self, scene, dt):
        from dropspin.comparisons.engines.base import AsBuilt

        simulation = ExactSimulation(scene, dt)
        body = scene.body
        simulation.as_built = lambda: AsBuilt(body.mass, body.inertia_tensor * (1 + 1e-13), scene.acceleration)
        return simulation


class WrongStart(Exact):
    """Starts one part in 1e13 too high."""

    name = "wrong-start"

    def prepare(self, scene, dt):
        state = scene.initial_state
        state[1] *= 1 + 1e-13
        return ExactSimulation(scene.starting_at(state), dt)


class TooLively(Exact):
    """Bounces with 1 % more restitution than the scene has."""

    name = "too-lively"

    def prepare(self, scene, dt):
        floor = scene.floor.model_copy(update={"restitution": 1.01 * scene.floor.restitution})
        return ExactSimulation(scene.model_copy(update={"floor": floor}), dt)


class FrozenSimulation(Simulation):
    """Says the start for ever."""

    def __init__(self, scene):
        self._start = scene.initial_state
        self.settings = {}

    def advance(self, steps):
        pass

    def state(self):
        return self._start.copy()


class Frozen(Engine):
    """Never moves."""

    name = "frozen"

    def prepare(self, scene, dt):
        return FrozenSimulation(scene)
