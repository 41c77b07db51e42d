"""What the damping and the armature of a free body do to its fall and its spin: the motion of which an engine computes an approximation.

With the mass m, the armature a (a mass that resists acceleration and has no weight), c₁ and c₂ the coefficients of a damping force, and
v the speed of a fall:

    (m + a) v' = m g - c₁ v - c₂ v²,   v(0) = 0
    v = G t T(βt) / (1 + αt T(βt)),   G = m g/(m + a),  α = c₁/2(m + a),  β² = α² + c₂ G/(m + a),  T(x) = tanh(x)/x

    y = G t² μ log(1 + xyμ)/xyμ,   x = (β - α) t,  y = (β + α) t,  μ = (x φ₂(-x) + y φ₂(y)) / (x + y)

which is (m + a)/c₂ (log(cosh βt + α/β sinh βt) - αt), written as sums of positive terms. About a principal axis, with J = I + a:

    J ω' = -c₁ ω - c₂ |ω| ω,   ω = ω₀ e^(-c₁t/J) / (1 + c₂ |ω₀| t/J φ₁(c₁t/J))

φ₁ and φ₂ are those of `flight`.

Source: J. Bernoulli (1719) for the spin; L. Euler, Mechanica I (1736), chapter 4, for the fall; `free_motion` by numerical integration.
Valid for: coefficients >= 0; the closed forms, for a body whose centre of mass is the origin of its joint.
"""

import math
from collections.abc import Callable

import numpy as np

from dropspin.scenarios.rotations import crossing, multiply, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, SPIN, VELOCITY, Array
from dropspin.scenarios.truths.flight import phi1, phi2

Resistance = Callable[[Array, Array], tuple[Array, Array]]
"""A function of the velocity of the joint's origin in the world frame and of the angular velocity in the body frame, each of shape (3,),
that returns the force of the damping in the world frame [N] and its torque in the body frame [N m].
"""
TOLERANCE = 1e-13
"""Relative error of one step of `free_motion`."""


def fall(
    t: Array | float, gravity: float, mass: float, armature: float = 0.0, linear: float = 0.0, quadratic: float = 0.0
) -> tuple[Array, Array]:
    """Distance fallen [m] and speed [m/s], from rest, at times; each has the shape of t.

    Args:
        t: Times [s], any shape.
        gravity: g >= 0 [m/s²].
        mass: Mass [kg].
        armature: Armature of the linear degrees of freedom [kg].
        linear: c₁ [N s/m].
        quadratic: c₂ [N s²/m²].
    """
    t = np.asarray(t, dtype=float)
    resisting = mass + armature
    pull, alpha = mass * gravity / resisting, 0.5 * linear / resisting
    product = quadratic * pull / resisting  # β² - α²
    beta = math.sqrt(alpha**2 + product)
    slower = product / (beta + alpha) if product else 0.0  # β - α
    x, y, share = slower * t, (beta + alpha) * t, _over(np.tanh, beta * t)
    weighted, near = x * phi2(-np.minimum(x, 1.0)) + y * phi2(y), np.minimum(x, 1.0)
    mean = np.where(x + y == 0.0, 0.5, weighted / np.where(x + y == 0.0, 1.0, x + y))
    fallen = pull * t * t * mean * _over(np.log1p, near * y * mean)
    if slower:  # far from the start the logarithm is large and its argument overflows
        far = resisting / quadratic * (x + np.log1p(slower / (2.0 * beta) * np.expm1(-2.0 * beta * t)))
        fallen = np.where(x > 1.0, far, fallen)
    return fallen, pull * t * share / (1.0 + alpha * t * share)


def terminal_speed(gravity: float, mass: float, linear: float = 0.0, quadratic: float = 0.0, cubic: float = 0.0) -> float:
    """The speed [m/s] at which damping balances the weight: c₁ v + c₂ v² + c₃ v³ = m g; infinite without damping.

    Args:
        gravity: g > 0 [m/s²].
        mass: Mass [kg].
        linear: c₁ [N s/m].
        quadratic: c₂ [N s²/m²].
        cubic: c₃ [N s³/m³].
    """
    weight = mass * gravity
    resistance = linear + math.sqrt(linear**2 + 4.0 * quadratic * weight)
    slowest = 2.0 * weight / resistance if resistance else math.inf
    if not cubic:
        return slowest
    from scipy.optimize import brentq

    most = min(slowest, math.cbrt(weight / cubic))
    return float(brentq(lambda v: v * (linear + v * (quadratic + v * cubic)) - weight, 0.0, most * (1.0 + 1e-9), xtol=1e-300, rtol=1e-15))


def spin_about_axis(
    t: Array | float, spin: float, inertia: float, armature: float = 0.0, linear: float = 0.0, quadratic: float = 0.0
) -> Array:
    """Angular velocity about a principal axis [rad/s] at times; it has the shape of t.

    Args:
        t: Times [s], any shape.
        spin: ω₀ [rad/s].
        inertia: Moment of inertia about the axis [kg m²].
        armature: Armature of the angular degrees of freedom [kg m²].
        linear: c₁ [N m s/rad].
        quadratic: c₂ [N m s²/rad²].
    """
    resisting = inertia + armature
    rate = linear / resisting * np.asarray(t, dtype=float)
    return spin * np.exp(-rate) / (1.0 + quadratic * abs(spin) / resisting * np.asarray(t) * phi1(rate))


def time_constant(
    spin: float, inertia: float, armature: float = 0.0, linear: float = 0.0, quadratic: float = 0.0, cubic: float = 0.0
) -> float:
    """The time [s] after which a spin about a principal axis is 1/e of ω₀; infinite without damping. Arguments: `spin_about_axis`.

    With a torque c₃ ω³ [N m s³/rad³] it is the integral of J/(c₁ + c₂ |ω| + c₃ ω²) over log ω.
    """
    if cubic:
        nodes, weights = np.polynomial.legendre.leggauss(40)
        speeds = abs(spin) * np.exp(0.5 * (nodes - 1.0))
        return float((inertia + armature) * 0.5 * weights @ (1.0 / (linear + speeds * (quadratic + speeds * cubic))))
    resistance = linear + quadratic * abs(spin)
    if not resistance:
        return math.inf
    return (inertia + armature) * (math.e - 1.0) / resistance * float(_over(np.log1p, np.array((math.e - 1.0) * linear / resistance)))


def joint_damping(linear: float, quadratic: float = 0.0, cubic: float = 0.0) -> Resistance:
    """The damping of a free joint of MuJoCo: -(c₁ + c₂ |v| + c₃ v²) v for each component v of velocity and of angular velocity.

    The velocity and the angular velocity have the same values of the coefficients: c₁ in N s/m and in N m s/rad, and so on.
    """

    def resistance(velocity: Array, spin: Array) -> tuple[Array, Array]:
        force, torque = (-(linear + quadratic * np.abs(v) + cubic * v * v) * v for v in (velocity, spin))
        return force, torque

    return resistance


def bullet_damping(mass: float, inertia: Array, linear: float = 0.04, angular: float = 0.04) -> Resistance:
    """The damping of a multibody's base in PyBullet: a force -κ (1 + |v|) m v and a torque -κ (1 + |ω|) I ω.

    Args:
        mass: Mass [kg].
        inertia: Inertia tensor in the body frame [kg m²], shape (3, 3).
        linear: κ of the velocity [1/s], and [1/m] for the term with |v|.
        angular: κ of the angular velocity [1/s], and [1/rad] for the term with |ω|.
    """

    def resistance(velocity: Array, spin: Array) -> tuple[Array, Array]:
        speed, rate = np.linalg.norm(velocity), np.linalg.norm(spin)
        return -linear * mass * (1.0 + speed) * velocity, -angular * (1.0 + rate) * (inertia @ spin)

    return resistance


def free_motion(
    times: Array,
    start: Array,
    mass: float,
    inertia: Array,
    gravity: Array,
    resistance: Resistance,
    *,
    armature: float = 0.0,
    centre: Array | None = None,
) -> Array:
    """The states of a body on a free joint with damping and armature, shape (n, 13).

    The joint's origin O moves with the velocity u, and c is the centre of mass as seen from O. Armature and damping act on u and on ω:
    a force F = -a u' + F_d at O and a torque τ = -a ω' + τ_d, in addition to the laws of Newton and Euler about the centre of mass:

        m v' = m g + F,   I ω' + ω × I ω = τ - c × F

    With c = 0 the two motions are independent. The spin is then that of a body of the tensor I + a, because ω × a ω = 0; without damping,
    `free_rotor` has it in closed form. Energy and angular momentum of I + a are conserved, and those of I about a principal axis alone.

    Args:
        times: Ascending, none before 0 and the last one after it [s], shape (n,).
        start: State at the time 0, shape (13,); position and velocity are those of the centre of mass.
        mass: Mass [kg].
        inertia: Inertia tensor about the centre of mass in the body frame [kg m²], shape (3, 3).
        gravity: Acceleration of gravity [m/s²], shape (3,).
        resistance: Damping, such as `joint_damping` or `bullet_damping`.
        armature: a, in kg for the velocity and in kg m² for the angular velocity.
        centre: c in the body frame [m], shape (3,); 0 if None.

    Source: L. Euler (1776), Nova methodus motum corporum rigidorum determinandi; integrated by LSODA (Petzold, 1983), also where damping
    is stiff.
    """
    from scipy.integrate import solve_ivp

    c = np.zeros(3) if centre is None else np.asarray(centre, dtype=float)
    # Unknown: acceleration of the centre of mass and ω', in the body frame; u' = v' + c × ω' - ω × (ω × c)
    lever = crossing(c)
    matrix = np.block(
        [
            [(mass + armature) * np.eye(3), armature * lever],
            [-armature * lever, inertia + armature * (np.eye(3) - lever @ lever)],
        ]
    )
    inverse = np.linalg.inv(matrix)

    def rates(_: float, state: Array) -> Array:
        velocity, spin = state[VELOCITY], state[SPIN]
        to_world, turning = rotate(state[ORIENTATION], np.eye(3)).T, crossing(spin)
        circling = turning @ c
        force, torque = resistance(velocity - to_world @ circling, spin)
        force = force @ to_world + armature * (turning @ circling)
        load = [mass * (gravity @ to_world) + force, torque - turning @ (inertia @ spin) - lever @ force]
        acceleration, spun = (inverse @ np.concatenate(load)).reshape(2, 3)
        turned = 0.5 * multiply(state[ORIENTATION], np.append(spin, 0.0))
        return np.concatenate([velocity, turned, to_world @ acceleration, spun])

    begin = np.array(start, dtype=float)
    begin[SPIN] = unrotate(begin[ORIENTATION], begin[SPIN])  # ω in the body frame during the integration
    solution = solve_ivp(rates, (0.0, float(times[-1])), begin, "LSODA", t_eval=times, rtol=TOLERANCE, atol=0.1 * TOLERANCE)
    states: Array = solution.y.T.copy()
    states[:, ORIENTATION] /= np.linalg.norm(states[:, ORIENTATION], axis=1, keepdims=True)
    states[:, SPIN] = rotate(states[:, ORIENTATION], states[:, SPIN])
    return states


def _over(function: Callable[[Array], Array], x: Array) -> Array:
    """f(x)/x of a function with f(x) = x + O(x²), 1 at 0."""
    return np.where(x == 0.0, 1.0, function(x) / np.where(x == 0.0, 1.0, x))
