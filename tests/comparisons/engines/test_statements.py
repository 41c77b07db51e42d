"""A limit of an adapter is stated as one: what the engine does by itself, and what the adapter says."""

import numpy as np
import pytest

from dropspin.comparisons.engines.registry import engine
from dropspin.scenarios import load

TENSOR = np.array([[1.0, 0.3, 0.0], [0.3, 2.0, 0.0], [0.0, 0.0, 2.5]])
GRAVITY = {"acceleration": [0.0, -9.8, 0.0]}
BLOCK = {"shape": "box", "half_extents": [0.1, 0.2, 0.3], "mass": 1.0}
RING = [[0.2 * np.cos(angle), y, 0.2 * np.sin(angle)] for angle in np.pi / 5 * np.arange(10) for y in (-0.1, 0.1)]
ROUND = {"shape": "vertices", "points": RING, "mass": 1.0, "inertia": [0.03, 0.04, 0.03]}
LANDING = {"start": {"position": [0.0, 1.0, 0.0]}, "gravity": GRAVITY}


def test_pybullet_itself_takes_products_of_inertia(tmp_path):
    """It diagonalises the tensor of a URDF file."""
    import pybullet

    moments = " ".join(f'{name}="{value}"' for name, value in zip(("ixx", "iyy", "izz", "ixy"), (1.0, 2.0, 2.5, 0.3), strict=True))
    link = f'<link name="l"><inertial><mass value="1"/><inertia {moments} ixz="0" iyz="0"/></inertial></link>'
    (tmp_path / "askew.urdf").write_text(f'<robot name="r">{link}</robot>')
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = pybullet.loadURDF(str(tmp_path / "askew.urdf"), flags=pybullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client)
        assert pybullet.getDynamicsInfo(body, -1, physicsClientId=client)[2] == pytest.approx(np.linalg.eigvalsh(TENSOR))
    finally:
        pybullet.disconnect(client)


def test_pybullet_itself_builds_compound_shapes_of_more_than_16_parts(tmp_path):
    """All 24 parts of a URDF file; createCollisionShapeArray, which the adapter calls, drops all after the 16th."""
    import pybullet

    ball = '<collision><origin xyz="{0} 0 0"/><geometry><sphere radius="0.001"/></geometry></collision>'
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    link = f'<link name="l">{inertial}{"".join(ball.format(0.1 * number) for number in range(24))}</link>'
    (tmp_path / "many.urdf").write_text(f'<robot name="r">{link}</robot>')
    client = pybullet.connect(pybullet.DIRECT)
    try:
        parts = {"radii": [1e-3] * 24, "collisionFramePositions": [[0.1 * number, 0.0, 0.0] for number in range(24)]}
        shape = pybullet.createCollisionShapeArray([pybullet.GEOM_SPHERE] * 24, physicsClientId=client, **parts)
        bodies = (
            pybullet.createMultiBody(1.0, shape, physicsClientId=client),
            pybullet.loadURDF(str(tmp_path / "many.urdf"), physicsClientId=client),
        )
        assert [len(pybullet.getCollisionShapeData(body, -1, client)) for body in bodies] == [16, 24]
    finally:
        pybullet.disconnect(client)


def test_pybullet_itself_damps_faster_than_the_adapter_allows():
    """A rate of 33 per second, for 0.1 s; the coefficient has three digits left."""
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = pybullet.createMultiBody(1.0, -1, useMaximalCoordinates=True, physicsClientId=client)
        pybullet.changeDynamics(body, -1, linearDamping=-np.expm1(-33.0), physicsClientId=client)
        pybullet.resetBaseVelocity(body, [1.0, 0.0, 0.0], physicsClientId=client)
        pybullet.setPhysicsEngineParameter(fixedTimeStep=1e-3, physicsClientId=client)
        for _ in range(100):
            pybullet.stepSimulation(client)
        assert pybullet.getBaseVelocity(body, client)[0][0] == pytest.approx(np.exp(-3.3), rel=1e-2)
    finally:
        pybullet.disconnect(client)


def test_mujoco_itself_grips_at_a_larger_coefficient_than_the_adapter_takes():
    """A ball without a rebound that strikes a floor of friction 1e12 at 1 m/s along it rolls on with 5/7 of that."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.001" gravity="0 0 0" cone="elliptic"/><worldbody>
        <geom name="floor" type="plane" size="0 0 1" contype="0" conaffinity="0"/>
        <body pos="0 0 0.0999"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="0.004 0.004 0.004"/>
        <geom name="ball" size="0.1" contype="0" conaffinity="0"/></body></worldbody>
        <contact><pair geom1="floor" geom2="ball" condim="3" friction="1e12 1e12 0 0 0" solref="0 -1000" solimp="0.9999 0.9999 0.001 0.5 2"
        solreffriction="0 -1000"/></contact></mujoco>"""
    )
    data = mujoco.MjData(model)
    data.qvel[:3] = 1.0, 0.0, -2.0
    mujoco.mj_step(model, data)
    assert data.qvel[[0, 2]] == pytest.approx([5 / 7, 0.0], abs=2e-3)


def test_drake_itself_damps_about_one_axis_alone():
    """By a generalised force, beside which a floating joint has one coefficient for all axes of rotation."""
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import RotationalInertia, SpatialInertia
    from pydrake.systems.analysis import Simulator

    plant = MultibodyPlant(1e-2)
    plant.AddRigidBody("body", SpatialInertia.MakeFromCentralInertia(1.0, np.zeros(3), RotationalInertia(1.0, 1.0, 1.0)))
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    plant.Finalize()
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    plant.SetVelocities(context, [0.01, 0.01, 0.0, 0.0, 0.0, 0.0])
    for step in range(1, 101):
        plant.get_applied_generalized_force_input_port().FixValue(context, -plant.GetVelocities(context) * [0, 1, 0, 0, 0, 0])
        simulator.AdvanceTo(1e-2 * step)
    np.testing.assert_allclose(plant.GetVelocities(context)[:3], [0.01, 0.01 * 0.99**100, 0.0], atol=1e-12)


def test_rapier_itself_combines_restitutions_in_other_ways_than_the_average():
    """0.5 and 0.9 have the average 0.7, which is the default, and the product 0.45."""
    import rapier3d

    rebounds = []
    for rule in ({}, {"restitution_combine_rule": rapier3d.CoefficientCombineRule.MULTIPLY}):
        world = rapier3d.PhysicsWorld(gravity=(0.0, 0.0, 0.0))
        ball = world.add_body(rapier3d.RigidBody.dynamic().position(((0.0, 0.105, 0.0), (0.0, 0.0, 0.0, 1.0))).linvel((0.0, -2.0, 0.0)))
        world.add_collider(rapier3d.Collider.ball(0.1, restitution=0.5, friction=0.0, **rule), ball)
        world.add_collider(rapier3d.Collider.halfspace((0.0, 1.0, 0.0), restitution=0.9, friction=0.0, **rule))
        world.integration_parameters.dt = 1e-3
        for _ in range(20):
            world.step()
        rebounds.append(world.rigid_bodies[ball].linvel.y / 2.0)
    assert rebounds == pytest.approx([0.7, 0.45], abs=1e-3)
    assert "by default" in engine("rapier").reasons["friction"]


@pytest.mark.parametrize("name", ["mujoco", "rapier", "dart"])
def test_engines_without_a_rest_speed_say_so_in_one_form(name):
    body, floor = {"shape": "sphere", "radius": 0.1, "mass": 1.0}, {"restitution": 0.5, "friction": "none", "rest_speed": 0.2}
    scene = load({"duration": 1.0, "body": body, "floor": floor, "start": {"position": [0.0, 1.0, 0.0]}, "gravity": GRAVITY})
    assert engine(name).declines(scene).partition(" ")[2].startswith("has no setting for the speed below which restitution is 0")


@pytest.mark.parametrize(
    ("name", "body", "tables"),
    [
        ("dart", BLOCK, {"damping": {"angular": 0.1}}),
        ("drake", BLOCK, {"damping": {"angular": 0.1}}),
        ("pybullet", BLOCK, {"damping": {"linear": 31.0}}),
        ("pybullet", ROUND, LANDING | {"floor": {"restitution": 0.5, "friction": "none"}}),
        ("mujoco", BLOCK, LANDING | {"floor": {"restitution": 0.5, "friction": 2e9}}),
        ("mujoco[spring_steps=20]", BLOCK, LANDING | {"floor": {"restitution": 0.0, "friction": "none"}}),
    ],
)
def test_limit_of_the_adapter_is_not_stated_as_one_of_the_engine(name, body, tables):
    assert engine(name).declines(load({"duration": 1.0, "body": body, **tables})).startswith("the adapter ")
