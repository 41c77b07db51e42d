"""The settings of PyBullet that can be given, by the names of its calls: defaults and calibrated values.

The defaults were measured: each leaves the motions of a ball and a box as they are without the setting, bit for bit.
"""

import math
from typing import Any

from dropspin.comparisons.engines.options import Setting
from dropspin.comparisons.engines.pybullet_limitations import STRONGEST_FRICTION

NEVER_SLEEPS = 2  # pybullet.ACTIVATION_STATE_DISABLE_SLEEPING
FASTEST = 1e12  # m/s and rad/s; Bullet clamps the speeds of a multibody to 100 by default
MULTIBODY, MAXIMAL = (("coordinates", "multibody"),), (("coordinates", "maximal"),)
WORLD = {
    "numSubSteps": Setting(0, "steps within a time step", 0, "no steps within a step, whose states would not be recorded"),
    "solverResidualThreshold": Setting(
        1e-7,
        "at which the solver ends",
        why="the square of one ulp of the speed that gravity gives in a step: solved to rounding, for two thirds of the cost of 0; at the "
        "default 1e-7 a resting box jitters at 5 mm/s, a corner errs by 5e-6",
        unit="m²/s²",
        is_computed=True,
    ),
    "numSolverIterations": Setting(
        50,
        "of the solver, at most",
        500,
        "enough to solve contacts to rounding; the default, 50, leaves an error at impacts on a floor that grips",
        least=1,
    ),
    "erp": Setting(0.2, "share of an error of joints corrected in a step", 0.0, "as contactERP, for joints", most=1),
    "contactERP": Setting(
        0.08,
        "share of a depth corrected in a step",
        0.0,
        "corrects no depth; at the default 0.08 a resting box jitters at 3 mm/s, and rebounds gain the depth over a step",
        most=1,
    ),
    "frictionERP": Setting(0.2, "share of a slip corrected in a step, with friction anchors", 0.0, "as contactERP, for friction", most=1),
    "contactSlop": Setting(1e-5, "depth that is not corrected", 0.0, "tolerates no depth", unit="m"),
    "restitutionVelocityThreshold": Setting(
        0.2,
        "speed below which restitution is 0",
        why="the scene's rest speed, by default 0; Bullet drops restitution below 0.2 m/s",
        unit="m/s",
        is_computed=True,
    ),
    "useSplitImpulse": Setting(
        1, "depths are corrected without changing velocities", 1, "keeps corrections of depth out of the velocities", most=1, needs=MAXIMAL
    ),
    "splitImpulsePenetrationThreshold": Setting(
        -0.04, "depth, negative, beyond which impulses are split", 0.0, "at any depth", unit="m", least=-math.inf, needs=MAXIMAL
    ),
    "enableConeFriction": Setting(
        1,
        "the same friction in every direction",
        1,
        "the same friction in every direction, for a multibody; maximal coordinates ignore it, and limit friction along the initial slip "
        "and across it separately, so that friction is up to 1.41 times larger where the slip turns in an impact",
        most=1,
        needs=MULTIBODY,
    ),
    "deterministicOverlappingPairs": Setting(0, "contacts are sorted", 1, "contacts in the same order in every run", most=1),
    "globalCFM": Setting(0.0, "softness of contacts and joints"),
    "warmStartingFactor": Setting(0.1, "share of the last step's impulses with which the solver starts", most=1, needs=MAXIMAL),
}
"""Of setPhysicsEngineParameter."""
BODY = {
    "restitution": Setting(
        0.0,
        "of the body; Bullet multiplies it by that of the floor",
        why="the scene's; Bullet multiplies those of two bodies, and the floor's is 1",
        is_computed=True,
    ),
    "lateralFriction": Setting(
        0.5,
        "of the body; Bullet multiplies it by that of the floor",
        why=f"the scene's coefficient; {STRONGEST_FRICTION:g}, the most that Bullet allows, where the floor grips",
        is_computed=True,
    ),
    "rollingFriction": Setting(0.0, "against rolling", unit="m"),
    "spinningFriction": Setting(0.0, "against spinning on the spot", unit="m", needs=MULTIBODY),
    "contactStiffness": Setting(-1.0, "of a soft contact, with contactDamping; -1 for a hard one", unit="N/m", least=-1.0),
    "contactDamping": Setting(-1.0, "of a soft contact, with contactStiffness; -1 for a hard one", unit="N s/m", least=-1.0),
    "frictionAnchor": Setting(0, "corrects slip by frictionERP", most=1),
    "anisotropicFriction": Setting((1.0, 1.0, 1.0), "factors of friction along the body's axes"),
    "contactProcessingThreshold": Setting(
        1e30,
        "distance below which contacts are solved",
        0.0,
        "contacts begin at touch; at the default, restitution 0.5 becomes 0.248 at 1 ms and 0.024 at 0.25 ms",
        unit="m",
    ),
    "linearDamping": Setting(
        0.04,
        "of a multibody k in dv/dt = -k v (1 + |v|), 0 in maximal coordinates",
        why="1 - exp(-rate), 0 without damping; a multibody's default is 0.04",
        unit="1/s",
        is_computed=True,
    ),
    "angularDamping": Setting(0.04, "as linearDamping, of rotation", why="as linearDamping", unit="1/s", is_computed=True),
    "activationState": Setting(
        NEVER_SLEEPS, "1 if the body may fall asleep, 2 if not", NEVER_SLEEPS, "never falls asleep", least=1, most=2
    ),
    "sleepThreshold": Setting(0.05, "below which a body falls asleep", needs=(("activationState", "1"),)),
    "maxJointVelocity": Setting(
        100.0,
        "largest speed along each axis, in m/s and rad/s",
        FASTEST,
        "no clamp of a multibody's speeds, which are by default 100 m/s and 100 rad/s (velocity_clamp=kept keeps them)",
        needs=(*MULTIBODY, ("velocity_clamp", "lifted")),
    ),
}
"""Of changeDynamics of the body."""
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
