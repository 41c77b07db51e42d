"""One time step: Algorithm 1 of the lecture note, line by line.

A part that is None (gravity, forces, damping, floor, walls or rotation) is left out of the compiled step.

Order: 1 for the translation under gravity, as semi-implicit Euler, and under damping, which is exact but acts before the motion.
Source: H. Wang, Rigid Body Dynamics (lecture note), Algorithm 1.
"""

from dropspin.reference_impl.quaternion import rotation_matrix
from dropspin.reference_impl.vectors import Vec3, compiled, cross, row, transpose
from dropspin.reference_impl.walls import collide_with_walls

TRANSLATION_ORDER = 1.0
DAMPING_ORDER = 1.0
TRANSLATION_DISCRETISATION = "semi-implicit Euler"


@compiled
def advance(x, q, v, w, dt, body, gravity, forces, damping, floor, walls, turn, collide, law):
    """The state (x, q, v, ω) after one step of dt, and whether the contact iteration converged."""
    converged = True
    if gravity is not None:
        v = v + dt * gravity
    if forces is not None:
        v, w = apply_forces(q, v, w, dt, body, forces)
    if damping is not None:
        v = damping.linear * v
        w = damping.angular * w
    if floor is not None:
        if x.y < body.reach:  # otherwise no vertex can be below the floor
            v, w, converged = collide(x, q, v, w, body, floor, law)
    if walls is not None:
        v, w, converged = collide_with_walls(x, q, v, w, body, walls, collide, law, converged)
    x = x + dt * v  # eq 1: with the new velocity
    if turn is not None:
        q, w = turn(q, w, dt, body)  # eq 6, or the rotation chosen instead
    return x, q, v, w, converged


@compiled
def apply_forces(q, v, w, dt, body, forces):
    """Eq 1, 6, 7 and 9: the velocities after forces on the vertices have acted for dt."""
    R = rotation_matrix(q)
    force = Vec3(0.0, 0.0, 0.0)
    torque = Vec3(0.0, 0.0, 0.0)
    for i in range(body.points.shape[0]):
        f = row(forces, i)
        force = force + f
        torque = torque + cross(R @ row(body.points, i), f)  # eq 9
    I_inverse = R @ body.inverse_inertia @ transpose(R)  # eq 7
    return v + dt * (force / body.mass), w + dt * (I_inverse @ torque)
