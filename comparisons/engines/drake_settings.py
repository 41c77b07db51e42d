"""The settings of Drake that can be given, by its names: defaults, calibrated values and reasons."""

from dropspin.comparisons.engines.options import Setting

PLANT = {
    "discrete_contact_approximation": Setting(
        "lagged",
        "what solves contacts",
        why="tamsi for a coefficient, else sap; the default, lagged, with this dissipation stops a sliding box",
        values=("tamsi", "sap", "similar", "lagged"),
        is_computed=True,
    ),
    "sap_near_rigid_threshold": Setting(
        1.0,
        "from which on contacts are softened",
        0.01,
        "at the default 1, a flat box rests 0.3 mm deep instead of 0.014, and a rocking block's error doubles",
    ),
    "stiction_tolerance": Setting(1e-4, "slip at which contacts stick, for tamsi", unit="m/s", least=1e-12),
}
"""Of the plant, by the names of its methods."""
SURFACE = {
    "relaxation_time": Setting(
        0.1,
        "of a contact, for sap",
        1.0,
        "s, for sap; a body leaves the floor at depth over this; at the default 0.1 a ball rebounds at 10 mm/s instead of 1",
        "s",
    ),
    "dissipation": Setting(
        50.0,
        "of Hunt and Crossley",
        1e7,
        "s/m, for tamsi; the remaining rebound speed is 1 over this; at the default it is 20 mm/s, at any step",
        "s/m",
    ),
    "stiffness": Setting(
        (1e6, 1e6),
        "of floor and body",
        why="N/m, floor and body; contacts lie on the stiffer; if equal, half a depth inside, and a gripped ball errs by 13 mm/s",
        unit="N/m",
        is_computed=True,
    ),
    "friction": Setting(
        0.5, "of the body", why="the scene's coefficient; 1e6 where the floor grips (1e3 gives the same)", is_computed=True
    ),
    "floor_friction": Setting(0.5, "of the floor; the harmonic mean of both acts", is_computed=True),
}
"""Of the contacts."""
SETTINGS = PLANT | SURFACE
"""Effects were measured at 1 ms on boxes and a ball with backspin that lands at 3 m/s, without the one setting."""
