"""A simulation that samples the exact motion of a scene, distorted."""

import numpy as np

from dropspin import scenarios
from dropspin.comparisons.engines.base import Simulation


class Sampled(Simulation):
    """The exact motion of a scene, distorted, instead of another scene's simulation."""

    def __init__(self, scene, dt, simulated, distort):
        truth = scenarios.truth_for(simulated) or scenarios.truth_for(scene)
        assert truth is not None
        self._start, self._truth, self._dt, self._distort, self._step = scene.initial_state, truth, dt, distort, 0

    def advance(self, steps):
        self._step += steps

    def state(self):
        return self._states(np.arange(self._step + 1))[-1]

    def record(self, steps, every=1):
        rows = self._states(np.arange(self._step + steps + 1))[self._step :: every]
        self._step += steps
        return rows

    def _states(self, steps):
        times = steps * self._dt
        # Beyond the horizon of the exact solution no state is compared; it must only be valid.
        exact = self._truth(np.minimum(times, self._truth.horizon)).states
        rows = self._distort(exact, times, self._dt, self._truth)
        rows[0] = self._start
        return rows


def undistorted(rows, times, dt, truth):
    """No distortion."""
    return rows
