"""The settings of PyBullet that can be given, by the names of its calls: defaults and calibrated values.

The defaults were measured: each leaves the motions of a ball and a box as they are without the setting, bit for bit.
"""

from typing import Any

from dropspin.comparisons.engines.settings import settings_beside

WORLD, BODY = settings_beside(__file__).values()
"""Of setPhysicsEngineParameter, and of changeDynamics of the body."""
OF_FLOOR = {"restitution": "1, so that the product is the scene's", "lateralFriction": "as floor_restitution"}
FLOOR = {
    f"floor_{name}": BODY[name]._replace(what=f"as {name}, of the floor and the walls", why=OF_FLOOR.get(name, f"as {name}"))
    for name in (*OF_FLOOR, "rollingFriction", "spinningFriction", "contactStiffness", "contactDamping", "contactProcessingThreshold")
}
"""Of changeDynamics of the floor and the walls."""
SETTINGS = WORLD | BODY | FLOOR
OF_BODY = {"lateralFriction": 1, "restitution": 5, "rollingFriction": 6, "spinningFriction": 7, "contactDamping": 8, "contactStiffness": 9}
"""Where getDynamicsInfo has settings; in maximal coordinates it has that of lateralFriction alone, and no values in the other places."""


def read_back(bullet: Any, body: int, floor: int | None, is_maximal: bool) -> dict[str, Any]:
    """The settings that PyBullet returns: of the world, the body, and the floor if there is one."""
    found = {name: value for name, value in bullet.getPhysicsEngineParameters().items() if name in WORLD}
    places = {"lateralFriction": 1} if is_maximal else OF_BODY
    for prefix, number in (("", body), ("floor_", floor)):
        if number is not None:
            dynamics = bullet.getDynamicsInfo(number, -1)
            found |= {f"{prefix}{name}": dynamics[place] for name, place in places.items()}
    return found
