"""Walls: each is a floor in its own frame, whose y axis is the wall's normal, so that contact treatments and laws know the floor alone.

A lecture note that has a floor and a wall treats one after the other; so do these loops, in the order of the walls.

Source: H. Wang, Rigid Body Dynamics, Algorithm 2, for each plane.
"""

from dropspin.reference_impl.floor_plane import N
from dropspin.reference_impl.parameters import read_wall
from dropspin.reference_impl.quaternion import product
from dropspin.reference_impl.vectors import compiled, dot, transpose


@compiled
def collide_with_walls(x, q, v, w, body, walls, collide, law, converged):
    """The velocities (v, ω) after each wall has acted, and whether all contact iterations converged."""
    columns, count = walls
    for number in range(count):
        wall = read_wall(columns, number)
        height = dot(wall.frame.row2, x) - wall.distance
        if height < body.reach:
            v_in, w_in = wall.frame @ v, wall.frame @ w
            at = wall.frame @ x - wall.distance * N
            v_out, w_out, solved = collide(at, product(wall.turn, q), v_in, w_in, body, wall.surface, law)
            # Only the change is turned back, so that a body that does not touch the wall keeps its velocities to the last bit.
            v = v + transpose(wall.frame) @ (v_out - v_in)
            w = w + transpose(wall.frame) @ (w_out - w_in)
            converged = converged and solved
    return v, w, converged
