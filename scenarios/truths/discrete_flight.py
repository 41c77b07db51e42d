"""Free flight as computed by Algorithm 1 without rounding: the exact solution of the difference equations of semi-implicit Euler.

    v_n = v₀ + n h g,   x_n = x₀ + n h v₀ + h² g n (n + 1)/2
    ω_n = ω₀,           q_n: rotated by n θ about ω₀, with θ = 2 atan(|ω| h/2) by eq 6, or |ω| h by an exact rotation

x is g h t/2 ahead of the parabola; the relative lag of the angle is (ω h)²/12. From this follow the predicted errors of engines in flight.

Source: H. Wang, Rigid Body Dynamics, eq 1 and 6; arithmetic and geometric sums.
Valid for: no floor, no damping; eq 6 for any body, because it omits the gyroscopic term; exact rotation where ω is constant.
"""

import math

import numpy as np

from dropspin.scenarios.model import Scenario
from dropspin.scenarios.rotations import about, multiply
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY
from dropspin.scenarios.trajectory import Trajectory


def discrete_flight(scene: Scenario, dt: float, *, exact_rotation: bool = False) -> Trajectory:
    """The states after each step of dt [s], the start first; velocity lags position by half a step.

    Raises:
        ValueError: The scene has a floor or damping.
    """
    if scene.floor is not None or scene.damping is not None:
        raise ValueError(f"scene {scene.name!r} is not an undamped free flight")
    start, g = scene.initial_state, scene.acceleration
    n = np.arange(scene.steps(dt) + 1, dtype=float)
    states = np.tile(start, (len(n), 1))
    states[:, POSITION] += np.outer(n * dt, start[VELOCITY]) + np.outer(0.5 * n * (n + 1.0) * dt * dt, g)
    states[:, VELOCITY] += np.outer(n * dt, g)
    speed = float(np.linalg.norm(start[SPIN]))
    if speed > 0.0:
        turn = speed * dt if exact_rotation else 2.0 * math.atan(0.5 * speed * dt)
        states[:, ORIENTATION] = multiply(about(start[SPIN] / speed, n * turn), start[ORIENTATION])
    return Trajectory.from_states(n * dt, states, velocity_lag=0.5 * dt)
