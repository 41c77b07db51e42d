"""The settings of SAPIEN that can be given, by its names: defaults, calibrated values and reasons."""

from dropspin.comparisons.engines.options import Setting

GRIPPING = 1e6
FASTEST = 1e16  # m/s and rad/s
TOLERANCE = "m; a box's contacts stay while it moves less than 1/20 of it; at SAPIEN's 0.1 a box gains 8 % energy at impacts"
WORLD = {
    "enable_tgs": Setting(
        True,
        "the solver TGS, not PGS",
        why="for a coefficient: a cone; PGS has a pyramid, up to 1.41 times as strong; else PGS: TGS gains 1.3e-3 energy at impacts",
        is_computed=True,
    ),
    "bounce_threshold": Setting(
        2.0,
        "impact speed below which a body does not rebound",
        why="the scene's rest speed, but not 0; by default impacts below 2 m/s do not rebound",
        unit="m/s",
        least=1e-9,
        is_computed=True,
    ),
    "enable_pcm": Setting(True, "contacts are kept between steps"),
    "enable_ccd": Setting(False, "contacts between steps are found"),
    "enable_friction_every_iteration": Setting(True, "friction in each iteration of the solver"),
}
"""Of the scene."""
BODY = {
    "sleep_threshold": Setting(
        0.005,
        "energy per mass below which a body sleeps",
        0.0,
        "never falls asleep; by default drop-box-corner, in metres per millisecond, stops in the air after one step",
        "J/kg",
    ),
    "max_angular_velocity": Setting(100.0, "largest spin", FASTEST, "rad/s; no clamp, by default at 100", "rad/s"),
    "solver_position_iterations": Setting(
        10,
        "of the solver",
        why="for PGS; at 4 a gripping corner errs by 1.3e-2 in angular momentum, not 4e-3; for TGS, 100 add rounding",
        least=1,
        most=255,
        is_computed=True,
    ),
    "solver_velocity_iterations": Setting(1, "of the solver, for velocities", most=255),
    "linear_damping": Setting(
        0.0,
        "damping",
        why="(1 - exp(-rate dt))/dt: PhysX multiplies by 1 - c dt, which gives the scene's decay; angular_damping is the same",
        unit="1/s",
        is_computed=True,
    ),
    "angular_damping": Setting(0.05, "damping of rotation", unit="1/s", is_computed=True),
}
"""Of the body."""
SURFACE = {
    "contact_offset": Setting(
        0.01,
        "distance at which a contact begins, of each surface",
        why="a step's fall; at the default 1 cm a ball rebounds up to 1 mm above the floor; at 0 a tipping box errs fivefold",
        unit="m",
        least=1e-9,
        is_computed=True,
    ),
    "restitution": Setting(0.1, "of the body; the average of both acts", is_computed=True, most=1.0),
    "friction": Setting(
        0.3,
        "of the body; the average of both acts",
        why=f"{GRIPPING:g} where the floor grips; on both surfaces, as restitution: in SAPIEN, PhysX takes the average",
        is_computed=True,
    ),
    "floor_restitution": Setting(0.1, "of the floor", is_computed=True, most=1.0),
    "floor_friction": Setting(0.3, "of the floor", is_computed=True),
}
"""Of the body's surface and the floor's."""
SETTINGS = WORLD | BODY | SURFACE
REASONS = {"tolerance_length": TOLERANCE} | {name: setting.why for name, setting in SETTINGS.items() if setting.why}
"""Effects were measured at 1 ms on the core catalogue and on a ball that slides with spin about its path, without the one setting."""
