"""Restitution and friction as MuJoCo's contact parameters.

MuJoCo has no coefficient of restitution. A contact is a damped spring with the reference acceleration a_ref = -b v - k r, and its force
only pushes. Two settings give a restitution e:

The damper, over one step: k = 0 and b = (1 + e) / dt turn the normal velocity v into -e v in one step of a one-stage integrator. The
impedance d < 1 leaves an error of (1 - d) g dt. In addition, k = kappa / dt² removes the share kappa of the depth in each step, and adds
up to kappa to e.

The spring, over N steps, with any integrator: its damping leaves the restitution e when its force ends. The force ends where
k r + b v = 0, before the depth r is 0: e = exp(-z c), with the angle c(z) of `_contact_angle` below. (If it ended at r = 0, e would be
exp(-π z / √(1 - z²)); the z of that formula for e = .5 gives .55.) Source: the damped oscillator x'' + 2 z w x' + w² x = 0 from x = 0,
until x'' = 0.
"""

import math
from typing import Any

IMPEDANCE = 0.9999  # the largest that MuJoCo allows
INFINITE_FRICTION = 1e6
STRONGEST_FRICTION = 1e9
"""The largest coefficient that the adapter sets."""
MOST_DAMPED = 1e3


def contact(restitution: float, friction: str | float, dt: float, kappa: float = 0.0, spring_steps: float = 0.0) -> dict[str, Any]:
    """The settings of a contact pair.

    Args:
        restitution: e.
        friction: 'none', 'infinite' or a coefficient.
        dt: Time step [s].
        kappa: The share of the depth that the damper removes in a step.
        spring_steps: N, the steps that a collision takes with the spring; 0 for the damper, with which it takes one.
    """
    coefficient = {"none": 0.0, "infinite": INFINITE_FRICTION}[friction] if isinstance(friction, str) else friction
    if spring_steps:
        z = damping_ratio(restitution)
        w = _contact_angle(z) / (spring_steps * dt)
        solref = [-(w**2), -2.0 * z * w]
    else:
        solref = [0.0 - kappa / dt**2, -(1.0 + restitution) / dt]  # 0.0, not -0.0, without a spring
    return {
        "condim": 3 if coefficient else 1,
        "friction": [coefficient, coefficient, 0.0, 0.0, 0.0],
        "solref": solref,
        "solimp": [IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0],
        "solreffriction": [0.0, -1.0 / dt],
    }


def damping_ratio(restitution: float) -> float:
    """The damping ratio z of a spring that only pushes and gives a restitution 0 < e <= 1."""
    from scipy.optimize import brentq

    if restitution == 1.0:
        return 0.0
    return float(brentq(lambda z: z * _contact_angle(z) + math.log(restitution), 0.0, MOST_DAMPED, xtol=1e-15, rtol=1e-15))


def _contact_angle(z: float) -> float:
    """The duration of a spring's push times its undamped angular frequency [rad]."""
    if z < 1.0:
        s = math.sqrt(1.0 - z * z)
        return math.atan2(2.0 * z * s, 2.0 * z * z - 1.0) / s
    if z == 1.0:
        return 2.0
    s = math.sqrt(z * z - 1.0)
    return math.log((z + s) / (z - s)) / s
