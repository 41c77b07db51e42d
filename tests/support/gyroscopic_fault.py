"""A gyroscopic torque that is wrong by a share of itself, planted into exact and into real engines."""

import numpy as np

from dropspin.comparisons.engines.base import Simulation
from dropspin.comparisons.engines.mujoco_simulation import MuJoCoSimulation
from dropspin.comparisons.engines.pybullet_simulation import PyBulletSimulation
from dropspin.comparisons.engines.wang import WangSimulation
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.state import ORIENTATION, SPIN, VELOCITY
from support.fault_suite import Made, WrongRotor

STEPS_OF_A_TURN = 8
"""Steps between two additions to the angular velocity; one a step would take most of the time."""

# Each adds to the angular velocity, given along the body's axes, which are the rows of `axes` in the world frame.


def turn_document(simulation, added, axes):
    simulation._batch._states[0, SPIN] += added @ axes


def turn_mujoco(simulation, added, axes):
    simulation._data.qvel[3:6] += added


def turn_pybullet(simulation, added, axes):
    state, body = simulation.state(), simulation._body
    turned = state[SPIN] + added @ axes
    simulation._bullet.resetBaseVelocity(body, state[VELOCITY].tolist(), turned.tolist())


TURNS = {WangSimulation: turn_document, MuJoCoSimulation: turn_mujoco, PyBulletSimulation: turn_pybullet}


class WrongGyroscope(Simulation):
    """A simulation with a share s of the gyroscopic torque more than the engine's, added to the angular velocity every few steps."""

    def __init__(self, inner, scene, dt, s):
        self._inner, self.velocity_lag, self.settings = inner, inner.velocity_lag, inner.settings
        tensor = scene.body.inertia_tensor
        self._tensor, self._factor = tensor, -s * dt * np.linalg.inv(tensor)

    def advance(self, steps):
        self.record(steps)

    def record(self, steps, every=1):
        rows = []
        for taken in range(0, steps, STEPS_OF_A_TURN):
            number = min(STEPS_OF_A_TURN, steps - taken)
            rows.append(self._inner.record(number)[:-1])
            self._turn(number)
        return np.vstack([*rows, self.state()])[::every]

    def _turn(self, number):
        state = self.state()
        axes = rotate(state[ORIENTATION], np.eye(3))  # the body's axes, in the world frame
        spin = axes @ state[SPIN]
        TURNS[type(self._inner)](self._inner, number * self._factor @ np.cross(spin, self._tensor @ spin), axes)

    def state(self):
        return self._inner.state()

    def close(self):
        self._inner.close()


def wrong_gyroscope(prepare, scene, dt, s):
    if isinstance(prepare.__self__, Made):
        return WrongRotor(share=1.0 + s).prepare(scene, dt)
    return WrongGyroscope(prepare(scene, dt), scene, dt, s)
