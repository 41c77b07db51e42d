"""The settings of ODE that can be given, by the names of its functions and surfaces: defaults, calibrated values and reasons."""

import math

from dropspin.comparisons.engines.options import Setting

GRIPPING = 1e6
WORLD = {
    "ERP": Setting(0.2, "share of the depth that a step corrects", most=1.0),
    "CFM": Setting(1e-10, "softness of constraints", why="1e-10 over the mass: equally soft for all bodies", unit="1/kg", is_computed=True),
    "ContactMaxCorrectingVel": Setting(math.inf, "largest speed that corrects depth", unit="m/s"),
    "ContactSurfaceLayer": Setting(0.0, "depth that is not corrected", unit="m"),
    "QuickStepNumIterations": Setting(20, "iterations of the quick solver", least=1, needs=(("solver", "quick"),)),
    "QuickStepW": Setting(1.3, "overrelaxation of the quick solver", least=0.01, most=2.0, needs=(("solver", "quick"),)),
}
"""Of the world, by the names of `dWorldSet…`."""
BODY = {
    "AutoDisableFlag": Setting(False, "the body may fall asleep"),
    "FiniteRotationMode": Setting(False, "steps turn by the exact rotation", True, "turns by ω dt; by 2 atan(ω dt/2) by default"),
    "GyroscopicMode": Setting(True, "the gyroscopic term"),
    "MaxAngularSpeed": Setting(math.inf, "largest spin", unit="rad/s"),
    "LinearDamping": Setting(
        0.0, "share of the velocity that a step removes", why="1 - exp(-rate dt); AngularDamping is the same", most=1.0, is_computed=True
    ),
    "AngularDamping": Setting(0.0, "share of the angular velocity that a step removes", most=1.0, is_computed=True),
    "LinearDampingThreshold": Setting(0.01, "speed below which nothing is damped", 0.0, "damps at any speed", "m/s"),
    "AngularDampingThreshold": Setting(0.01, "spin below which nothing is damped", 0.0, "damps at any spin", "rad/s"),
}
"""Of the body, by the names of `dBodySet…`."""
SURFACE = {
    "mu": Setting(
        0.0, "coefficient of friction", why=f"{GRIPPING:g} where the floor grips, for infinity needs no normal force", is_computed=True
    ),
    "Approx1": Setting(False, "mu is of the normal force, not a force in N", True, "by default mu is a force in N"),
    "FDir1": Setting(
        False,
        "friction along the slip, not the world's axes",
        True,
        "along the slip; along the world's axes, as by default, a turning box errs by 0.23 in angular momentum",
    ),
    "bounce": Setting(0.0, "restitution", most=1.0, is_computed=True),
    "bounce_vel": Setting(
        0.0, "impact speed below which a body does not rebound", why="the scene's rest speed", unit="m/s", is_computed=True
    ),
    "soft_erp": Setting(0.2, "share of the depth that a contact corrects", 0.0, "adds no velocity that corrects depth", most=1.0),
    "soft_cfm": Setting(1e-10, "softness of contacts", why="CFM of the world", unit="1/kg", is_computed=True),
}
"""Of a contact."""
SETTINGS = WORLD | BODY | SURFACE
"""Effects were measured at 1 ms without the one setting."""
