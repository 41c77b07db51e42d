"""The source of an adapter, which tests write beside a scene and change."""

DRIFTING = """
from dropspin import Engine, Simulation

class Drifting(Simulation):
    settings = {"version": "1"}
    def __init__(self, scene, dt):
        self.now, self.dt = scene.initial_state.copy(), dt
    def advance(self, steps):
        self.now[:3] += steps * self.dt * self.now[7:10]
    def state(self):
        return self.now.copy()

class Mine(Engine):
    name = "mine"
    def prepare(self, scene, dt):
        return Drifting(scene, dt)
"""
