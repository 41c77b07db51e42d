"""The settings of Rapier that can be given, by its names: defaults, calibrated values and reasons."""

import numpy as np

from dropspin.comparisons.engines.options import Setting
from dropspin.comparisons.engines.rapier_scenes import WHY_FRICTION, why_damping

LARGEST = float(np.finfo(np.float32).max)
WORLD = {
    "num_solver_iterations": Setting(
        4, "substeps", 1, "substeps; at the default 4 velocity lags by an eighth of a step, and a ball gains 1.7e-3 of its energy", least=1
    ),
    "num_internal_pgs_iterations": Setting(
        1, "of positions", 50, "for positions; at 1 a turning box on a rough floor errs by 1e-4 in energy instead of 8e-6", least=1
    ),
    "num_internal_stabilization_iterations": Setting(
        1, "of velocities", 50, "for velocities; with 1 for both, a gripping corner keeps moving down at 1.4 of 3.8 m/s", least=1
    ),
    "normalized_max_corrective_velocity": Setting(
        3.0,
        "largest correction of depth",
        LARGEST,
        "corrects depth in one step without changing the velocity; 3 m/s by default",
        unit="m/s",
    ),
    "static_contact_softness": Setting(
        (60.0, 10.0),
        "frequency [Hz] and damping ratio of contacts with the floor",
        (1e9, 1.0),
        "Hz, damping ratio; at 60 Hz a bounce errs by 4.6e-3, not 8e-4; boxes rest 0.1 mm deep",
    ),
    "normalized_max_linear_velocity": Setting(400.0, "largest speed", LARGEST, "no clamp of the speed, at 400 m/s by default", unit="m/s"),
    "friction_in_bias_pass": Setting(
        False,
        "friction in position corrections",
        True,
        "also in position corrections; without it a rocking block gains 3.7e-5 of its energy, not 4e-6",
    ),
    "normalized_prediction_distance": Setting(
        0.02,
        "distance at which a contact begins",
        why="a step's fall; at 0 turning on a rough floor errs by 0.19 rad, not 5e-3; at 2 cm landings by 1.5 %",
        unit="m",
        is_computed=True,
    ),
    "normalized_allowed_linear_error": Setting(0.005, "depth that is not corrected", unit="m"),
    "warmstart_coefficient": Setting(1.0, "share of the last step's impulses with which the solver starts"),
}
"""Of the integration parameters."""
BODY = {
    "can_sleep": Setting(True, "the body may fall asleep", False, "never falls asleep"),
    "allow_fast_rotation": Setting(
        False, "no limit of the angular velocity", True, "no clamp of the angular velocity, at π/4 a step by default"
    ),
    "gyroscopic_forces": Setting(
        True,
        "the gyroscopic term",
        why="off in steady flight, where they are 0; rounding in L = I ω and back would add 1.2e-4 of L in 1000 steps",
        is_computed=True,
    ),
    "linear_damping": Setting(0.0, "damping", why=f"{why_damping()}; angular_damping is the same", unit="1/s", is_computed=True),
    "angular_damping": Setting(0.0, "damping of rotation", unit="1/s", is_computed=True),
}
"""Of the body."""
SURFACE = {
    "restitution": Setting(0.0, "of the body", is_computed=True),
    "friction": Setting(0.5, "of the body", why=WHY_FRICTION, is_computed=True),
}
FLOOR = {f"floor_{name}": setting._replace(what="of the floor") for name, setting in SURFACE.items()}
SETTINGS = WORLD | BODY | SURFACE | FLOOR
"""Effects were measured at 1 ms without the one setting."""
