"""One time step: the note's Algorithm 1, line by line.

A part that is None (no gravity, no forces, no damping, no floor) is left out of the compiled step altogether.
"""

from reference_impl.contact import handle_collision
from reference_impl.quaternion import normalise, product, rotation_matrix
from reference_impl.vectors import Quat, Vec3, compiled, cross, row, transpose


@compiled
def advance(x, q, v, w, dt, body, gravity, forces, damping, floor):
    """The state (x, q, v, ω) one step of dt later."""
    if gravity is not None:
        v = v + dt * gravity
    if forces is not None:
        v, w = apply_forces(q, v, w, dt, body, forces)
    if damping is not None:
        v = damping.linear * v
        w = damping.angular * w
    if floor is not None:
        v, w = handle_collision(q, v, w, x.y, body, floor)
    x = x + dt * v  # eq 1: with the new velocity
    q = normalise(q + 0.5 * dt * product(Quat(w.x, w.y, w.z, 0.0), q))  # eq 6
    return x, q, v, w


@compiled
def apply_forces(q, v, w, dt, body, forces):
    """Eq 1, 6, 7 and 9: the velocities after forces on the vertices have acted for dt."""
    R = rotation_matrix(q)
    force = Vec3(0.0, 0.0, 0.0)
    torque = Vec3(0.0, 0.0, 0.0)
    for i in range(body.points.shape[0]):
        p = row(body.points, i)
        f = row(forces, i)
        force = force + f
        torque = torque + cross(R @ p, f)  # eq 9
    I_inverse = R @ body.inverse_inertia @ transpose(R)  # eq 7
    return v + dt * (force / body.mass), w + dt * (I_inverse @ torque)
