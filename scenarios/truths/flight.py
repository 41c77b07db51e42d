"""Free flight: the centre of mass on a parabola and the body turning as a free rotor, or both with exponential damping.

Without damping:

    x(t) = x₀ + v₀ t + g t²/2,   v(t) = v₀ + g t

With decay rates k of velocity and κ of angular velocity (v' = g - k v, (I ω)' = -κ I ω), φ₁(z) = (1 - e⁻ᶻ)/z, φ₂(z) = (z - 1 + e⁻ᶻ)/z²:

    x(t) = x₀ + v₀ t φ₁(kt) + g t² φ₂(kt),   v(t) = v₀ e⁻ᵏᵗ + g t φ₁(kt)
    ω(t) = e^(-κt) Ω(s),  orientation of the free rotor Ω at the time s = t φ₁(κt)

because with s as the time, the damped Euler equations become those without damping.

Source: Galileo (1638), Discorsi, fourth day, for the parabola; J. Bernoulli (1719) for a resistance proportional to speed; `free_rotor`
for the orientation.
Valid for: any body without floor, or, undamped, between two impacts.
"""

import math
from dataclasses import dataclass

import numpy as np

from dropspin.scenarios.damping import Damping
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.state import ORIENTATION, PARTS, SPIN, Array
from dropspin.scenarios.truths.free_rotor import FreeRotor, free_rotor
from dropspin.scenarios.truths.truth import Truth

UNDAMPED = Damping()
TURNS_OVER = "rounding of the initial state and of the moments of inertia determines when the body turns over"
SERIES_TERMS = 22  # enough for 17 digits of φ₂ up to z = 1


@dataclass(frozen=True, eq=False)
class Flight:
    """A free flight; call it with times since its start [s], shape (n,), for states, shape (n, 13).

    Attributes:
        start: State at the time 0, shape (13,).
        acceleration: Gravity [m/s²], shape (3,).
        rotor: The rotation without damping.
        damping: Decay rates.
    """

    start: Array
    acceleration: Array
    rotor: FreeRotor
    damping: Damping = UNDAMPED

    @property
    def horizon(self) -> float:
        """Time up to which a difference of one eps in the initial state does not change the motion noticeably [s]."""
        kappa, until = self.damping.angular, self.rotor.horizon
        if kappa == 0.0:
            return until
        return -math.log1p(-kappa * until) / kappa if kappa * until < 1.0 else math.inf

    def __call__(self, t: Array) -> Array:
        """The states at times since the start [s]."""
        x, _, v, _ = (self.start[part] for part in PARTS.values())
        t_ = t[:, None]
        if self.damping == UNDAMPED:
            orientation, angular_velocity = self.rotor(t)
            position = x + t_ * v + t_ * t_ * 0.5 * self.acceleration
            return np.hstack([position, orientation, v + t_ * self.acceleration, angular_velocity])
        k = self.damping.linear
        slowed = t_ * phi1(k * t_)
        orientation, angular_velocity = self.rotor(t * phi1(self.damping.angular * t))
        position = x + slowed * v + t_ * t_ * phi2(k * t_) * self.acceleration
        velocity = np.exp(-k * t_) * v + slowed * self.acceleration
        return np.hstack([position, orientation, velocity, np.exp(-self.damping.angular * t_) * angular_velocity])


def flight_states(state: Array, inertia: Array, acceleration: Array, damping: Damping = UNDAMPED) -> Flight:
    """The flight from a state, shape (13,)."""
    return Flight(state, acceleration, free_rotor(inertia, state[ORIENTATION], state[SPIN]), damping)


def flight(scene: Scenario) -> Truth:
    """The exact solution of a scene without a floor."""
    states = flight_states(scene.initial_state, scene.body.inertia_tensor, scene.acceleration, scene.damping or UNDAMPED)
    parabola = "" if scene.gravity is None else "x = x0 + v0 t + g t²/2; "
    if not states.rotor.is_steady:
        name = "free-rotor"
        turning = "angular velocity and orientation by Jacobi's elliptic functions (Landau & Lifshitz, section 37; Whittaker, section 69)"
    else:
        spins = states.rotor.largest_spin > 0.0
        name = "principal-spin" if spins else "parabola"
        turning = "the angular velocity ω is constant, and the body turns by the angle ω t" if spins else "the orientation is constant"
    if scene.damping is not None:
        name = f"damped-{name}"
        parabola = "" if scene.gravity is None else "the centre of mass moves with resistance proportional to its velocity; "
        if scene.damping.angular:
            turning += "; with the angular damping κ, (1 - exp(-κ t))/κ replaces t, and ω is multiplied by exp(-κ t)"
    return Truth(name, parabola + turning, states, horizon=states.horizon, ends=TURNS_OVER if states.horizon < scene.duration else "")


def phi1(z: Array) -> Array:
    """(1 - e⁻ᶻ)/z, 1 at 0."""
    safe = np.where(z == 0.0, 1.0, z)
    return np.where(z == 0.0, 1.0, -np.expm1(-safe) / safe)


def phi2(z: Array) -> Array:
    """(z - 1 + e⁻ᶻ)/z², 1/2 at 0; by its series below 1, where the difference would lose digits."""
    series = np.polynomial.polynomial.polyval(np.minimum(z, 1.0), [(-1.0) ** n / math.factorial(n + 2) for n in range(SERIES_TERMS)])
    safe = np.maximum(z, 1.0)
    return np.where(z < 1.0, series, (safe + np.expm1(-safe)) / (safe * safe))
