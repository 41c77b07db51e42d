"""Synthetic tosses of a cube by an engine, as recordings whose flights are known, and fits of them."""

from dataclasses import dataclass

import numpy as np

from dropspin.comparisons.logs.continued_tosses import STEPS_PER_FRAME, Launches, poses, scene_of
from dropspin.comparisons.logs.flights import Flights, Start
from dropspin.comparisons.logs.header import Header
from dropspin.comparisons.logs.log import Log, Toss
from dropspin.comparisons.logs.noise import Noise, Regression
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.scenarios.rotations import multiply, rotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY

WANG = "wang[contact=sequential,law=coulomb]"
RATE, FLIGHT, FRAMES = 148.0, 30, 8
FINE = 1.0 / RATE / 256
"""A time step that is much finer than those of a fit [s]."""
WHITE = np.repeat([2e-4, 2e-3], 3)
"""Noise of positions [m] and of rotation vectors [rad]."""
HEADER = Header(
    data="tosses.npz",
    body={"shape": "box", "half_extents": (0.0524, 0.0524, 0.0524), "mass": 0.37},
    floor={"friction": 0.3, "restitution": 0.3},
)


def covariance():
    """Of the state at the end of a flight by least squares, in the order of `Start`."""
    t = np.arange(1 - FLIGHT, 1) / RATE
    normal = np.linalg.inv(np.array([[FLIGHT, t.sum()], [t.sum(), t @ t]]))
    return np.kron(normal, np.diag(WHITE**2))


def quaternions(vectors):
    angles = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.concatenate([vectors / angles * np.sin(angles / 2), np.cos(angles / 2)], axis=-1)


def true_states(random, count, height=0.0):
    """States of the cube up to a frame before it strikes the floor, or a height [m] above these."""
    states = np.zeros((count, 13))
    states[:, ORIENTATION] = (q := random.normal(size=(count, 4))) / np.linalg.norm(q, axis=1, keepdims=True)
    states[:, VELOCITY] = random.uniform([-1.0, -2.5, -1.0], [1.0, -1.5, 1.0], (count, 3))
    states[:, SPIN] = random.uniform(-8.0, 8.0, (count, 3))
    lowest = rotate(states[:, None, ORIENTATION], scene_of(HEADER).body.vertices)[..., 1].min(axis=1)
    states[:, 1] = height - lowest + random.uniform(0.1, 1.0, count) * -states[:, 8] / RATE
    return states


def tosses(random, count, engine, friction, restitution, frames=FRAMES, height=0.0, dt=1.0 / RATE / STEPS_PER_FRAME):
    """Flights of tosses that an engine makes, with noise in the frames after the flight and errors in the states at its end."""
    states, t = true_states(random, count, height), np.arange(frames + 1) / RATE
    launched = Launches(scene_of(HEADER), dt, np.zeros(3), states, np.tile(t, (count, 1)))
    [motions] = poses(engine_entry(engine), launched, [{"friction": friction, "restitution": restitution}])
    noise = random.normal(size=(count, frames + 1, 6)) * WHITE
    positions = motions[..., POSITION] + noise[..., :3]
    orientations = multiply(quaternions(noise[..., 3:]), motions[..., ORIENTATION])
    errors = random.multivariate_normal(np.zeros(12), covariance(), count)
    starts = []
    for number in range(count):
        toss = Toss(str(number), t, positions[number], orientations[number])
        exact = Start(toss, 0, 0, states[number], covariance(), WHITE)
        starts.append(Start(toss, 0, 0, exact.moved(errors[number : number + 1])[0], covariance(), WHITE))
    return recording(starts)


@dataclass(frozen=True, eq=False)
class KnownFlights(Flights):
    """Flights whose starts are known."""

    known: list[Start]

    def starts(self):
        return self.known


def recording(starts):
    moving, turning = (
        Regression(np.zeros(6), Noise(white, 0.0), np.ones(0), np.eye(6)[np.newaxis], np.zeros((1, 6)), 1) for white in WHITE[[0, 3]]
    )
    return KnownFlights(Log(HEADER, tuple(start.toss for start in starts), "tosses", ()), moving, (), turning, starts)
