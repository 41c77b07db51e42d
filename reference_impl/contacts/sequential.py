"""`contact=sequential`: an impulse at each vertex, over and over until none changes (projected Gauss-Seidel).

Each submerged vertex shall separate at e times its approach; impulses add up, push only, and stay in the friction cone.
Source: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics (1988); M. Jean, The non-smooth contact
dynamics method, CMAME 177 (1999). Cost: some ten to some hundred sweeps over the vertices. Leaves no submerged vertex
approaching faster than `TOLERANCE`. Sweeps are capped, and a step that did not converge says so; with friction of about 1 and above at
several vertices there need not be a solution. At restitution above 0 it can add a little energy: a vertex that was separating is held back
by none of its neighbours' restitution.
"""

import math

import numpy as np

from reference_impl.contacts.mean import along_normal, impulse_response, vertex
from reference_impl.quaternion import rotation_matrix
from reference_impl.vectors import Vec3, compiled, cross, transpose

TOLERANCE = 1e-10  # m/s: no vertex's velocity changes by more in the last sweep
MOST_SWEEPS = 2000


@compiled
def collide_normal(x, q, v, w, body, floor, law):
    """Without friction, whatever the floor's coefficient is."""
    return _sweep(x, q, v, w, body, floor, 0.0)


@compiled
def collide_coulomb(x, q, v, w, body, floor, law):
    """With Coulomb's cone of the floor's coefficient; infinity sticks."""
    return _sweep(x, q, v, w, body, floor, floor.friction)


@compiled
def _sweep(x, q, v, w, body, floor, friction):
    R = rotation_matrix(q)
    I_inverse = R @ body.inverse_inertia @ transpose(R)
    impulses = np.zeros((body.points.shape[0], 3))
    v0, w0 = v, w
    for _ in range(MOST_SWEEPS):
        largest = 0.0
        for i in range(body.points.shape[0]):
            r = vertex(R, body, i)
            if x.y + along_normal(r) < 0.0:
                approach = along_normal(v0 + cross(w0, r))
                mu = 0.0 if abs(approach) < floor.rest_speed else floor.restitution
                j = Vec3(float(impulses[i, 0]), float(impulses[i, 1]), float(impulses[i, 2]))
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
    """The vertex's impulse j after one more look at its velocity u: separation first, then friction within its cone."""
    normal = max(j.y + (wanted - u.y) / K.row2.y, 0.0)
    if friction == 0.0:
        return Vec3(0.0, normal, 0.0)
    # One scale for both directions, so that where it slips friction is opposite to the slip: that of the direction that gives way most.
    half_difference = 0.5 * (K.row1.x - K.row3.z)
    softest = 0.5 * (K.row1.x + K.row3.z) + math.sqrt(half_difference * half_difference + K.row1.z * K.row1.z)
    x = j.x - u.x / softest
    z = j.z - u.z / softest
    length = math.sqrt(x * x + z * z)
    most = friction * normal if normal > 0.0 else 0.0
    scale = 1.0 if length <= most else most / length
    return Vec3(scale * x, normal, scale * z)
