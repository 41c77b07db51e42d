"""Free flight: the centre of mass on a parabola, the body turning about it as a free rotor.

    x(t) = x₀ + v₀ t + g t²/2,   v(t) = v₀ + g t

Source: Galileo (1638), Discorsi, fourth day, for the parabola; `free_rotor` for the attitude.
Valid for: any body without floor and damping, or between two impacts.
"""

import numpy as np
from numpy.typing import NDArray

from scenarios.model import Scenario
from scenarios.truths.free_rotor import AsymmetricTop, free_rotor
from scenarios.truths.truth import States, Truth

Array = NDArray[np.float64]


def flight_states(state: Array, inertia: Array, acceleration: Array) -> States:
    """Times since `state`, shape (n,), to states, shape (n, 13)."""
    x, q, v, w = state[0:3], state[3:7], state[7:10], state[10:13]
    rotor = free_rotor(inertia, q, w)

    def states(t: Array) -> Array:
        s = t[:, None]
        orientation, angular_velocity = rotor(t)
        return np.hstack([x + s * v + 0.5 * s * s * acceleration, orientation, v + s * acceleration, angular_velocity])

    return states


def flight(scene: Scenario) -> Truth | None:
    """The truth of a scene in which nothing but gravity acts."""
    if scene.floor is not None or scene.damping is not None:
        return None
    q, w = np.array(scene.start.orientation), np.array(scene.start.angular_velocity)
    rotor = free_rotor(scene.body.inertia_tensor, q, w)
    parabola = "" if scene.gravity is None else "x = x0 + v0 t + g t²/2; "
    if isinstance(rotor, AsymmetricTop):
        name = "free-rotor"
        turning = "Jacobi's elliptic functions for rates and attitude (Landau & Lifshitz, section 37; Whittaker, section 69)"
    else:
        name = "principal-spin" if np.any(w) else "parabola"
        turning = "angular velocity constant, angle ωt" if np.any(w) else "orientation constant"
    states = flight_states(scene.initial_state, scene.body.inertia_tensor, scene.acceleration)
    return Truth(name, parabola + turning, states)
