"""`rotation=symmetric-top`: a composition of fourth order of two exact motions, that of a symmetric top and a rotation about one axis.

    T = (m₁² + m₂²)/2I₁ + m₃²/2I₃   +   m₂²/2 (1/I₂ - 1/I₁)

Order: 4, by Strang's splitting five times with Suzuki's steps. Exact for a symmetric body, because the axes are ordered so that I₁ and I₂
are the closest.
Keeps: L in space, to rounding; energy oscillates and does not drift.
Valid for: |ω| dt up to about 1.6.
Cost: twenty rotations about an axis per step, each with sines and cosines.
Source: S. Reich, Physica D 76 (1994), and A. Dullweber, B. Leimkuhler & R. McLachlan, J. Chem. Phys. 107 (1997), for splitting the free
body; M. Suzuki, Phys. Lett. A 146 (1990), for the composition.
"""

import math

from dropspin.reference_impl.quaternion import conjugate, normalise, product, to_body, to_world
from dropspin.reference_impl.vectors import Quat, Vec3, compiled, dot

ORDER = 4.0
DISCRETISATION = "symmetric-top"

OUTER_STEP = 1.0 / (4.0 - 4.0 ** (1.0 / 3.0))
INNER_STEP = 1.0 - 4.0 * OUTER_STEP


@compiled
def turn(q, w, dt, body):
    """Orientation and angular velocity (q, ω) after dt."""
    q = product(q, body.axes)  # work along the principal axes
    spin = to_body(q, w)
    I = body.moments
    m = Vec3(I.x * spin.x, I.y * spin.y, I.z * spin.z)
    for part in range(5):
        h = (INNER_STEP if part == 2 else OUTER_STEP) * dt
        q, m = _about_second(q, m, 0.5 * h, I)
        q, m = _symmetric_top(q, m, h, I)
        q, m = _about_second(q, m, 0.5 * h, I)
    q = normalise(q)
    w = to_world(q, Vec3(m.x / I.x, m.y / I.y, m.z / I.z))
    return product(q, conjugate(body.axes)), w


@compiled
def _about_second(q, m, h, I):
    """The flow of m₂²/2 (1/I₂ - 1/I₁): a rotation about the second axis."""
    angle = h * m.y * (1.0 / I.y - 1.0 / I.x)
    c, s = math.cos(angle), math.sin(angle)
    half = 0.5 * angle
    return product(q, Quat(0.0, math.sin(half), 0.0, math.cos(half))), Vec3(c * m.x - s * m.z, m.y, s * m.x + c * m.z)


@compiled
def _symmetric_top(q, m, h, I):
    """The flow of the symmetric top: a rotation about L by h |L|/I₁, followed by one about its symmetry axis."""
    length = math.sqrt(dot(m, m))
    half = 0.5 * h * length / I.x
    # sin(half)/length, which is h/(2 I₁) where the body is at rest
    share = math.sin(half) / (length if length > 0.0 else 1.0)
    angle = h * m.z * (1.0 / I.z - 1.0 / I.x)
    c, s = math.cos(angle), math.sin(angle)
    about_momentum = Quat(share * m.x, share * m.y, share * m.z, math.cos(half))
    about_axis = Quat(0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle))
    return product(product(q, about_momentum), about_axis), Vec3(c * m.x + s * m.y, -s * m.x + c * m.y, m.z)
