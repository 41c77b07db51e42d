"""The settings of DART that can be given, by the names of dartpy: defaults, calibrated values and reasons."""

from dropspin.comparisons.engines.options import Setting

WORLD = {
    "deactivation": Setting(
        True,
        "bodies at rest fall asleep",
        False,
        "never falls asleep; else a block that tips over more slowly than 0.05 rad/s stops halfway",
    ),
    "collision_detector": Setting(
        "fcl",
        "what finds contacts",
        "ode",
        "finds all corners on the half-space; the default, FCL, finds one, and an edge rebounds with 0.217, not 0.5",
        values=("fcl", "dart", "bullet", "ode"),
    ),
    "split_impulse": Setting(
        False,
        "depth is corrected apart from velocities",
        True,
        "corrects depth without changing velocities; else a ball of restitution 0 rebounds at 1 mm/s, at any step",
    ),
    "lcp_solver": Setting(
        "dantzig",
        "what solves contacts",
        why="Coulomb's cone, to 1e-8 m/s, for a coefficient; with the default pyramid a turning box loses or gains 0.23 of its spin",
        values=("dantzig", "pgs", "nsgs"),
        is_computed=True,
    ),
}
"""Of the world."""
SETTINGS = WORLD | {
    "restitution": Setting(
        0.0,
        "of the body, multiplied by that of the floor",
        why="e + (1 + e) 1e-5: DART's contacts are compliant by 1e-5, which Python cannot set; uncorrected, 0.5 becomes 0.499985",
        is_computed=True,
        most=1.0,
    ),
    "friction": Setting(
        1.0,
        "of the body; the smaller one of body and floor acts",
        why="the scene's coefficient; 1e6 where the floor grips (1e2 to 1e9 give the same)",
        is_computed=True,
    ),
    "floor_restitution": Setting(0.0, "of the floor", 1.0, "DART multiplies the two", most=1.0),
    "floor_friction": Setting(1.0, "of the floor", is_computed=True),
}
"""Effects were measured on balls dropped from 1 m and boxes on an edge, tipping and turning flat, without the one setting."""
