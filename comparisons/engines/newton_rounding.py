"""The effects of single precision on the spin of Newton's bodies, which grow with the number of steps or with the speed."""

from collections.abc import Iterator

import numpy as np

from dropspin.comparisons.engines.base import Array, KnownLimitation
from dropspin.scenarios import Scenario
from dropspin.scenarios.rotations import length
from dropspin.scenarios.state import SPIN, VELOCITY

SPIN_GAINED = 3e-7
"""Share of ω in a step, at most; measured 1.9e-7 to 2.4e-7 with steps of 10 to 0.25 ms, about a principal axis."""
TORQUE = 3.6e-7
"""Three ulp, times m v²: the torque that rounding gives a body of the speed v; measured 0.5 to 1 ulp."""
ENERGIES = ("energy_error", "energy_gain", "energy_drift")


def rounding_met(solver: str, scene: Scenario, states: Array, duration: float, steps: int) -> Iterator[KnownLimitation]:
    """The limitation that a motion met, if it turns.

    Args:
        solver: The option's value.
        scene: The scene.
        states: Shape (n, 13).
        duration: Of the motion [s].
        steps: Of the motion.
    """
    fastest, speed = (float(length(states[:, part]).max()) for part in (SPIN, VELOCITY))
    if solver == "featherstone":
        torque = TORQUE * scene.body.mass * speed**2
        spin = torque * duration / float(np.linalg.eigvalsh(scene.body.inertia_tensor)[0])
        why = "featherstone adds the torque v × m v, which is 0 in exact arithmetic"
    else:
        spin, why = SPIN_GAINED * steps * fastest, "the solver turns ω to the body's axes and back in each step"
    if spin > 0.0 and fastest > 0.0:
        share = spin / fastest
        errors = {"orientation_error": 0.5 * spin * duration, "angular_momentum_error": share} | dict.fromkeys(ENERGIES, 2.0 * share)
        yield KnownLimitation(f"{why}; rounding then changes ω by up to {spin:.2g} rad/s", errors)
