"""A limit of an adapter is stated as one: what the engine does by itself, and what the adapter says."""

import numpy as np
import pytest

from dropspin.comparisons.engines.registry import engine
from dropspin.scenarios import load

TENSOR = np.array([[1.0, 0.3, 0.0], [0.3, 2.0, 0.0], [0.0, 0.0, 2.5]])
ASKEW = {"shape": "vertices", "points": [[0.2, 0.0, 0.1], [-0.1, 0.3, 0.0], [0.0, -0.2, 0.25], [0.1, 0.1, -0.3]], "mass": 2.7}
BLOCK = {"shape": "box", "half_extents": [0.1, 0.2, 0.3], "mass": 1.0}


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


@pytest.mark.parametrize(
    ("name", "body", "tables"),
    [
        ("pybullet", ASKEW, {}),
        ("mujoco", ASKEW, {"damping": {"angular": 0.1}}),
        ("dart", BLOCK, {"damping": {"angular": 0.1}}),
        ("drake", BLOCK, {"damping": {"angular": 0.1}}),
    ],
)
def test_limit_of_the_adapter_is_not_stated_as_one_of_the_engine(name, body, tables):
    assert engine(name).declines(load({"duration": 1.0, "body": body, **tables})).startswith("the adapter ")
