"""The first impact of tumbling round bodies with an offset centre of mass, by integration of their equations up to it."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.event_driven import COULOMB, NO_FRICTION, STICKING, _matrix, _struck

from dropspin.scenarios import load, truth_for

OFFSET = {"mass": 2.0, "center_of_mass": [0.02, -0.03, 0.01], "inertia": [0.02, 0.012, 0.017, 1e-3, -2e-3, 5e-4]}
BODIES = {
    "sphere": {"radius": 0.15},
    "capsule": {"radius": 0.1, "half_length": 0.15},
    "cylinder": {"radius": 0.12, "half_length": 0.15},
    "ellipsoid": {"half_extents": [0.12, 0.25, 0.17]},
}
FRICTIONS = [("none", NO_FRICTION), ("infinite", STICKING), (0.3, COULOMB)]


def rates(t, state, gravity, inertia):
    """Of position, quaternion, velocity and angular velocity in the body frame."""
    (x, y, z, s), (a, b, c) = state[3:7], state[10:13]
    turning = [s * a + y * c - z * b, s * b + z * a - x * c, s * c + x * b - y * a, -(x * a + y * b + z * c)]
    return np.concatenate(
        [state[7:10], 0.5 * np.array(turning), gravity, np.linalg.solve(inertia, np.cross(inertia @ state[10:13], state[10:13]))]
    )


def lowest(body, state):
    """The vector from the centre of mass to the lowest point, by the matrix of the ellipsoid in the world."""
    R = _matrix(state[3:7] / np.linalg.norm(state[3:7]))
    across = (R * body.semi_axes**2) @ R.T
    corner = min((R @ (np.array(corner) - body.centre) for corner in body.corners), key=lambda at: at[1])
    return corner - across[:, 1] / np.sqrt(across[1, 1])


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", BODIES)
def test_first_impact_of_a_tumbling_offset_body_is_that_of_an_integration(name):
    """Of six random throws, with every kind of friction: the time to 1e-11, velocity and angular velocity after it to 1e-9."""
    random = np.random.default_rng(7)
    for friction, kind in FRICTIONS * 2:
        one = load(
            {
                "duration": 0.5,
                "body": {"shape": name, **OFFSET, **BODIES[name]},
                "start": {
                    "position": [0.0, 0.45, 0.0],
                    "orientation": random.normal(size=4).tolist(),
                    "velocity": [random.normal(), -1.0, random.normal()],
                    "angular_velocity": (5.0 * random.normal(size=3)).tolist(),
                },
                "gravity": {"acceleration": [0.0, -9.8, 0.0]},
                "floor": {"restitution": 0.5, "friction": friction},
            }
        )
        start, inertia = one.initial_state, one.body.inertia_tensor
        start[10:13] = _matrix(start[3:7]).T @ start[10:13]

        def touches(t, state, *given, body=one.body):
            return state[1] + lowest(body, state)[1]

        touches.terminal = True
        moved = solve_ivp(
            rates, (0.0, 0.5), start, "DOP853", args=(one.acceleration, inertia), events=touches, rtol=1e-13, atol=1e-14, max_step=0.02
        )
        before = moved.y_events[0][0]
        R = _matrix(before[3:7] / np.linalg.norm(before[3:7]))
        arm, floor = lowest(one.body, before), one.floor
        coefficient = friction if kind == COULOMB else 0.0
        velocity, spin, _ = _struck(
            R, arm, before[7:10], before[10:13], 2.0, np.linalg.inv(inertia), floor.restitution, 0.0, kind, coefficient
        )
        event = truth_for(one.model_copy(update={"duration": moved.t_events[0][0] + 1e-3})).events[0]
        assert event.time == pytest.approx(moved.t_events[0][0], rel=1e-11)
        np.testing.assert_allclose(event.after[7:13], np.concatenate([velocity, R @ spin]), rtol=0, atol=1e-9)
