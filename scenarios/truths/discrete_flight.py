"""Free flight as Algorithm 1 of the note must give it, to the last digits: semi-implicit Euler's own exact solution.

    v_n = v₀ + n h g,   x_n = x₀ + n h v₀ + h² g n (n + 1)/2
    ω_n = ω₀,           q_n: turned by n θ about ω₀, with θ = 2 atan(|ω| h/2) by the note's eq 6, or |ω| h by an exact rotation

x is g h t/2 ahead of the parabola; the angle lags by (ω h)²/12 of itself. From it follows an engine's error in flight, metric by metric.

Source: H. Wang, Rigid Body Dynamics, eq 1 and 6; arithmetic and geometric sums.
Valid for: no floor, no damping; eq 6 for any body, because it leaves out the gyroscopic term; exact rotation where ω stays as it is.
"""

import math

import numpy as np
from numpy.typing import NDArray

from scenarios.model import Scenario
from scenarios.rotations import about, multiply
from scenarios.trajectory import Trajectory

Array = NDArray[np.float64]


def discrete_flight(scene: Scenario, dt: float, *, exact_rotation: bool = False) -> Trajectory:
    """The scene's steps of dt [s], the start as first row; velocity lags position by half a step.

    Raises:
        ValueError: The scene has a floor or damping.
    """
    if scene.floor is not None or scene.damping is not None:
        raise ValueError(f"scene {scene.name!r} is no undamped free flight")
    start, g = scene.initial_state, scene.acceleration
    n = np.arange(scene.steps(dt) + 1, dtype=float)
    states = np.tile(start, (len(n), 1))
    states[:, 0:3] += np.outer(n * dt, start[7:10]) + np.outer(0.5 * n * (n + 1.0) * dt * dt, g)
    states[:, 7:10] += np.outer(n * dt, g)
    speed = float(np.linalg.norm(start[10:13]))
    if speed > 0.0:
        turn = speed * dt if exact_rotation else 2.0 * math.atan(0.5 * speed * dt)
        states[:, 3:7] = multiply(about(start[10:13] / speed, n * turn), start[3:7])
    return Trajectory.from_states(n * dt, states, velocity_lag=0.5 * dt)
