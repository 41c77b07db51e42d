"""A compiled model of MuJoCo with its data, the mass properties of its bodies, and what depends on the version of MuJoCo."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import mujoco
import numpy as np

from dropspin.comparisons.diagnosis.loose_body import MassProperties


def placed(model: Any) -> tuple[Any, Any]:
    """A compiled model, and its data with the bodies where the file has them."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def mass_properties(model: Any, data: Any, group: Sequence[int]) -> MassProperties | None:
    """Those of a body and what is welded to it, in the frame of the body, the first of the group; None without mass."""
    masses, origin, turn = model.body_mass[group], data.xpos[group[0]], data.xmat[group[0]].reshape(3, 3)
    if not masses.sum() > 0.0:
        return None
    points = (data.xipos[group] - origin) @ turn
    centre, inertia = np.average(points, axis=0, weights=masses), np.zeros((3, 3))
    for mass, moments, axes, arm in zip(masses, model.body_inertia[group], data.ximat[group], points - centre, strict=True):
        turned = turn.T @ axes.reshape(3, 3)
        inertia += turned @ np.diag(moments) @ turned.T + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return MassProperties(float(masses.sum()), centre, inertia)


@cache
def lowers_margin() -> bool:
    """Whether contacts act only below margin - gap, as in older versions of MuJoCo; in newer ones they act below the margin."""
    ball = '<worldbody><geom type="plane" size="0 0 1"/><body><freejoint/><geom size="1" margin="2" gap="1"/></body></worldbody>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{ball}</mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return bool(data.contact.includemargin[0] < 2.0)


def sleeps(option: Any) -> bool:
    """Whether slow bodies sleep, which older versions of MuJoCo have not."""
    return bool(option.enableflags & getattr(mujoco.mjtEnableBit, "mjENBL_SLEEP", 0) and option.sleep_tolerance)
