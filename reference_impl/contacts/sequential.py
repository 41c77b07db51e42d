"""`contact=sequential`: one impulse at each vertex, repeated until none changes (projected Gauss-Seidel).

Each submerged vertex is to separate at e times its approach speed. Impulses accumulate, only push, and stay within the friction cone.

Order: none claimed (see the package's docstring).
Keeps: no submerged vertex approaches faster than `TOLERANCE` after a step that converged. At restitution above 0 it can add a little
energy: a vertex that was separating does not limit the restitution of its neighbours.
Stops: the number of sweeps is limited, and a step that did not converge is reported. With friction of about 1 and above at several vertices
a solution need not exist.
Cost: about ten to a few hundred sweeps over the vertices per step.
Source: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics (1988); M. Jean, The non-smooth contact dynamics
method, CMAME 177 (1999).
"""

import math

import numpy as np

from dropspin.reference_impl.contacts.response import impulse_response
from dropspin.reference_impl.floor_plane import along_normal, contact_count, contact_offset, is_below
from dropspin.reference_impl.quaternion import rotation_matrix
from dropspin.reference_impl.vectors import Vec3, compiled, cross, row, transpose

ORDER = None

TOLERANCE = 1e-10  # m/s; converged where no vertex's velocity changed by more in a sweep
MAX_SWEEPS = 2000


@compiled
def collide_normal(x, q, v, w, body, floor, law):
    """For `law=normal`: without friction, for any coefficient of the floor."""
    return _sweep(x, q, v, w, body, floor, 0.0)


@compiled
def collide_coulomb(x, q, v, w, body, floor, law):
    """For `law=coulomb`: within the cone of the floor's coefficient; infinity sticks."""
    return _sweep(x, q, v, w, body, floor, floor.friction)


@compiled
def _sweep(x, q, v, w, body, floor, friction):
    R = rotation_matrix(q)
    I_inverse = R @ body.inverse_inertia @ transpose(R)
    impulses = np.zeros((contact_count(body), 3))
    v0, w0 = v, w
    for _ in range(MAX_SWEEPS):
        largest = 0.0
        for i in range(contact_count(body)):
            r = contact_offset(R, body, i)
            if is_below(x, r, floor):
                approach = along_normal(v0 + cross(w0, r))
                mu = 0.0 if abs(approach) < floor.rest_speed else floor.restitution
                j = row(impulses, i)
                K = impulse_response(r, I_inverse, body.mass)
                more = _improve(j, K, v + cross(w, r), max(-mu * approach, 0.0), friction)
                change = more - j
                v = v + (1.0 / body.mass) * change
                w = w + I_inverse @ cross(r, change)
                impulses[i, 0], impulses[i, 1], impulses[i, 2] = more.x, more.y, more.z
                largest = max(largest, abs(change.x) * K.row1.x + abs(change.y) * K.row2.y + abs(change.z) * K.row3.z)
        if largest <= TOLERANCE:
            return v, w, True
    return v, w, False


@compiled
def _improve(j, K, u, wanted, friction):
    """The next iterate of a vertex's impulse j at velocity u: first the normal part, then friction within its cone."""
    normal = max(j.y + (wanted - u.y) / K.row2.y, 0.0)
    if friction == 0.0:
        return Vec3(0.0, normal, 0.0)
    # One scale for both directions, that of the more compliant one, so that friction opposes the slip where the vertex slips.
    half_difference = 0.5 * (K.row1.x - K.row3.z)
    softest = 0.5 * (K.row1.x + K.row3.z) + math.sqrt(half_difference * half_difference + K.row1.z * K.row1.z)
    x = j.x - u.x / softest
    z = j.z - u.z / softest
    length = math.sqrt(x * x + z * z)
    most = friction * normal if normal > 0.0 else 0.0
    scale = 1.0 if length <= most else most / length
    return Vec3(scale * x, normal, scale * z)
