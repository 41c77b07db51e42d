"""A box that turns flat on a rough floor: uniform deceleration by Coulomb friction, and its range of validity."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dropspin.scenarios import load, truth_for
from dropspin.scenarios.rotations import rotate

HALF = np.array([0.3, 0.1, 0.2])
BOX = {"shape": "box", "half_extents": HALF.tolist(), "mass": 2.0, "inertia": [0.038, 0.06, 0.058]}


def turning(spin=(0.0, -8.0, 0.0), orientation=(0.0, 0.3, 0.0, 0.9), height=0.1, friction=0.3, **more):
    return load(
        {
            "name": "turning",
            "duration": 1.0,
            "body": BOX,
            "start": {"position": [1.0, height, 2.0], "orientation": list(orientation), "angular_velocity": list(spin)},
            "gravity": {"acceleration": [0.0, -9.8, 0.0]},
            "floor": {"restitution": 0.4, "friction": friction},
        }
        | more
    )


@pytest.mark.parametrize(("upright", "moment"), [(0, 0.038), (1, 0.06), (2, 0.058)])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_energy_lost_is_the_work_of_friction_at_the_corners(upright, moment, direction):
    """On any face: f M g/4 at each corner along its path of ρ φ, until all energy is lost; to 1e-13."""
    axis = np.roll([1.0, 0.0, 0.0], upright)
    quaternion = {0: [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)], 1: [0.0, 0.0, 0.0, 1.0], 2: [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]}[upright]
    assert abs(rotate(np.array(quaternion), axis)[1]) == pytest.approx(1.0)
    scene = turning((0.0, 8.0 * direction, 0.0), quaternion, HALF[upright])
    truth = truth_for(scene)
    assert truth.name == "coulomb-turn"
    motion = truth(np.linspace(0.0, 1.0, 401))
    angle = np.unwrap((Rotation.from_quat(motion.orientation) * Rotation.from_quat(quaternion).inv()).as_rotvec()[:, 1])
    lever = np.sqrt(np.sum(HALF**2) - HALF[upright] ** 2)
    left = 0.5 * moment * motion.angular_velocity[:, 1] ** 2
    np.testing.assert_allclose(left, 0.5 * moment * 64.0 - 0.3 * 2.0 * 9.8 * lever * np.abs(angle), atol=1e-13)
    assert left[-1] == 0.0
    assert np.sign(motion.angular_velocity[0, 1]) == np.sign(angle[-1]) == direction


@pytest.mark.parametrize(
    "change",
    [
        {"friction": "infinite"},
        {"height": 0.2},
        {"spin": (0.1, 3.0, 0.0)},
        {"spin": (0.0, 0.0, 0.0)},
        {"orientation": (0.1, 0.0, 0.0, 1.0), "height": 0.3},
        {"damping": {"angular": 0.1}},
        {"body": {"shape": "sphere", "radius": 0.1, "mass": 2.0}},
        {"body": BOX | {"center_of_mass": [0.05, 0.0, 0.0]}},
        {"body": BOX | {"inertia": [[0.038, 0.004, 0.0], [0.004, 0.06, 0.0], [0.0, 0.0, 0.058]]}},
    ],
)
def test_turn_is_limited_to_its_range_of_validity(change):
    """Not with sticking, a fall, another spin, rest, a tilt, damping or a ball; nor if the corners carry unequal loads."""
    truth = truth_for(turning(**change))
    assert truth is None or truth.name != "coulomb-turn"


def whirl_rates(scene):
    """Squared frequencies of the tilt on stiff corners [1/s², for a stiffness of 1], from forces and moments at each corner."""
    corners = rotate(np.array(scene.start.orientation), scene.body.vertices)
    base = corners[corners[:, 1] < 0.0]
    along = np.sign(scene.start.angular_velocity[1]) * np.cross([0.0, 1.0, 0.0], base * [1.0, 0.0, 1.0])
    along /= np.linalg.norm(along, axis=1)[:, None]
    axes = rotate(np.array(scene.start.orientation), np.eye(3))
    inertia = axes.T @ scene.body.inertia_tensor @ axes
    matrix = np.empty((2, 2))
    for column, tilt in enumerate(np.eye(3)[[0, 2]]):
        load = -np.cross(tilt, base)[:, 1]
        forces = load[:, None] * ([0.0, 1.0, 0.0] - scene.floor.friction * along)
        moment = np.cross(base, forces).sum(axis=0)
        matrix[:, column] = -np.linalg.solve(inertia, moment)[[0, 2]]
    return np.linalg.eigvals(matrix)


def test_a_turn_that_flutters_has_no_solution_except_without_restitution():
    """The load of the corners flutters where the tilt has complex frequencies: boxes of any shape and friction, some of each kind."""
    random = np.random.default_rng(3)
    found = []
    for _ in range(60):
        half = random.uniform(0.1, 0.5, 3)
        body = {"shape": "box", "half_extents": half.tolist(), "mass": 2.0, "inertia": ("solid", "vertices")[random.integers(2)]}
        start = {"position": [0.0, half[1], 0.0], "angular_velocity": [0.0, 5.0, 0.0]}
        change = {"body": body, "start": start}
        friction = float(random.uniform(0.02, 0.8))
        flutters = bool(np.abs(whirl_rates(turning(friction=friction, **change)).imag).max() > 0.0)
        assert (truth_for(turning(friction=friction, **change)) is None) == flutters
        inelastic = turning(**change, floor={"restitution": 0.0, "friction": friction})
        assert truth_for(inelastic).name == "coulomb-turn"
        found.append(flutters)
    assert 10 < sum(found) < 50
