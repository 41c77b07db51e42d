"""The settings of Newton's solvers and shapes that can be given, by its names: defaults, calibrated values and reasons."""

from functools import cache
from itertools import chain

from dropspin.comparisons.engines.options import Setting

STICKING = 1e4
SHAPE = {name: f"shape_material_{name}" for name in ("restitution", "mu", "mu_torsional", "mu_rolling", "ke", "kd", "kf", "ka")}
SHAPE |= {name: f"shape_{name}" for name in ("margin", "gap")}
"""Names of `ShapeConfig`, with those of the model's arrays."""
MU = {"mu": Setting(1.0, "coefficient of friction", why=f"{STICKING:g} where the floor grips", is_computed=True)}
SPRING = {
    "ke": Setting(2500.0, "stiffness of a contact; per unit of mass in mujoco", unit="N/m"),
    "kd": Setting(100.0, "damping of a contact; per unit of mass in mujoco", unit="N s/m"),
}
MARGIN = {"margin": Setting(0.0, "distance by which each surface is moved outwards", unit="m")}
SMOOTHED = SPRING | {
    "kf": Setting(1000.0, "friction per slip, up to the coefficient", unit="N s/m"),
    "ka": Setting(0.0, "distance within which contacts attract", unit="m"),
}
ANGULAR_DAMPING = Setting(
    0.05,
    "damping of rotation",
    0.0,
    "0.05 by default in semi-implicit, whatever the scene says; 0 in xpbd, and without effect in featherstone",
    "1/s",
)
SETTINGS = {
    "xpbd": {
        "iterations": Setting(2, "of the solver", least=1),
        "rigid_contact_relaxation": Setting(
            0.8,
            "share of a contact's depth that an iteration removes",
            1.0,
            "removes the whole depth of a contact; at the default 0.8 a block that rocks keeps 0.03 less of its angular speed in a landing",
        ),
        "rigid_contact_con_weighting": Setting(True, "corrections are divided by the number of contacts"),
        "enable_restitution": Setting(
            False,
            "bodies rebound",
            why="off by default, which is right for restitution 0 alone; on, it then slows rolling balls and rocking blocks",
            is_computed=True,
        ),
        "angular_damping": ANGULAR_DAMPING._replace(default=0.0),
        "restitution": Setting(0.0, "with enable_restitution", most=1.0, is_computed=True),
        **MU,
        "mu_torsional": Setting(
            0.005,
            "torsional friction",
            0.0,
            "none, as mu_rolling; at the default 0.005, a box that turns on a rough floor loses 0.044 of its spin too much",
            "m",
        ),
        "mu_rolling": Setting(0.0001, "rolling friction", 0.0, unit="m"),
        **MARGIN,
        "gap": Setting(0.1, "distance at which each surface looks for contacts", unit="m"),
    },
    "semi-implicit": {"angular_damping": ANGULAR_DAMPING, **MU, **SMOOTHED, **MARGIN},
    "featherstone": MU | SMOOTHED | MARGIN,
    "mujoco": {
        "iterations": Setting(100, "of the solver", least=1),
        "ls_iterations": Setting(50, "of the line search of mujoco", least=1),
        "integrator": Setting("implicitfast", "of mujoco", values=("euler", "rk4", "implicit", "implicitfast", "discrete")),
        "cone": Setting("pyramidal", "of friction in mujoco", values=("pyramidal", "elliptic")),
        "impratio": Setting(1.0, "hardness of friction over that of the normal force, in mujoco", least=1e-3),
        "density": Setting(0.0, "of the medium, in mujoco", unit="kg/m³"),
        "viscosity": Setting(0.0, "of the medium, in mujoco", unit="Pa s"),
        **MU,
        **SPRING,
    },
}
"""By solver."""


@cache
def settings_of(solver: str) -> dict[str, Setting]:
    """The settings, with the defaults of a solver; those that it does not have need one that has them."""
    found = dict(SETTINGS.get(solver, {}))
    for name, setting in chain.from_iterable(settings.items() for settings in SETTINGS.values()):
        having = [other for other, settings in SETTINGS.items() if name in settings]
        found.setdefault(name, setting._replace(needs=(("solver", *having),)))
    return found
