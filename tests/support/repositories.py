"""A user's repository for tests of the pytest plugin: engines, a scene, and a test of scenes."""

ENGINES = """
import os
import numpy as np
from dropspin.comparisons.engines.base import Engine, Simulation
from dropspin.scenarios import truth_for

print("imported", file=open("imports.log", "a"))

class Exact(Simulation):
    def __init__(self, scene, dt, fault):
        self.truth, self.start, self.dt, self.step, self.fault = truth_for(scene), scene.initial_state, dt, 0, fault
        self.settings = {"version": "1"}

    def advance(self, steps):
        self.step += steps

    def state(self):
        state = self.truth(np.array([self.step * self.dt])).states[0] if self.step else self.start.copy()
        state[10:] *= 1.0 + self.fault * (self.step > 0)
        return state

class Mine(Engine):
    name = "mine"
    order = float("inf")

    def prepare(self, scene, dt):
        return Exact(scene, dt, 0.0)

class Faulty(Engine):
    name = "faulty"

    def prepare(self, scene, dt):
        return Exact(scene, dt, 1e-3)

class Dying(Mine):
    name = "dying"

    def prepare(self, scene, dt):
        os.abort()

class Shy(Mine):
    name = "shy"

    def declines(self, scene):
        return "I do not spin"
"""
NEEDLE = """
duration = 1.0
[body]
shape = "box"
half_extents = [0.01, 0.5, 0.01]
mass = 1.0
[start]
angular_velocity = [0.0, 3.0, 0.0]
[[expect]]
metric = "energy_error"
below = 1e-9
reason = "nothing acts on it"
"""
SCENE_TEST = """
import pytest

@pytest.mark.dropspin("spin-principal", dt=0.004)
def test_scene(dropspin_result, dropspin_check):
    dropspin_check(dropspin_result)
"""


def options(*engines):
    return [word for engine in engines for word in ("--dropspin-engine", f"engines:{engine}")]


def fill(pytester):
    """Write the engines, a scene and a test that does not use dropspin into the folder of a pytester."""
    pytester.makepyfile(engines=ENGINES, test_own="def test_own(): pass")
    (pytester.path / "needle.toml").write_text(NEEDLE)
    return pytester
