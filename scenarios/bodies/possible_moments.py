"""Which second moments a distribution of mass inside a convex body can have.

Masses of shares w at points p of a convex body, whose centre of mass is the origin, have the second moments

    S = Σ w p pᵀ,   Σ w = 1,   Σ w p = 0

S is possible if and only if Λ : S <= 1 for every vector λ and every symmetric Λ for which λ·p + p·Λ p <= 1 on the whole body. On a
polytope, a quadratic form that is not concave is largest on the surface: at a corner, or where it is stationary on an edge or a face.
Hence the largest possible multiple of S follows from linear programmes over a few points; to these is added where on the surface the form
of the last programme is largest, until the upper and the lower bound agree. Corners alone do not suffice: masses on the edges of a triangle
have moments that masses at its corners have not, and S is not possible because a larger one is.

Source: L. V. Kantorovich (1939) and M. G. Krein (1951) on moments and linear programmes; P. C. Gilmore & R. E. Gomory, Operations Research
9 (1961), 849-859, for the generation of columns.
"""

import math

import numpy as np

from dropspin.scenarios.bodies.hull import convex_hull
from dropspin.scenarios.state import Array

THICKNESS = 1e-6
"""Half of the thickness, relative to its size, that a flat body is given."""
SLACK = 3e-5
"""By which each moment may differ, relative to those of the body: without it, moments of 0 leave the programmes no room."""
AGREEMENT = 3e-4
"""Relative distance at which the bounds of the multiple agree."""
FIRST, ROUNDS, ADDED = 50, 200, 8
"""Corners of the first programme, most programmes, and the points that each adds."""
PAIRS = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])


def largest_multiple(points: Array, squares: Array, enough: float) -> float:
    """The largest multiple of second moments that is possible inside the hull of points, or up to 1e-3 of it more.

    Args:
        points: Points relative to the centre of mass [m], shape (n, 3).
        squares: S [m²], shape (3, 3), positive semidefinite up to rounding.
        enough: A multiple above which any other is returned, because no more is needed.
    """
    from scipy.optimize import linprog

    # The problem is the same after any linear map; after this one the body is about as wide in all directions.
    centred = points if convex_hull(points) else _thickened(points)
    spread, axes = np.linalg.eigh(centred.T @ centred)
    to_round = axes / np.sqrt(spread / len(centred))
    hull = convex_hull(centred @ to_round)
    wanted = to_round.T @ squares @ to_round
    unit = float(np.trace(wanted))
    triangles, columns = hull.points[hull.simplices], hull.points[hull.vertices][:: 1 + len(hull.vertices) // FIRST]
    slack, target = np.eye(9)[:, :6], np.append(wanted[PAIRS] / unit, np.zeros(3))[:, None]
    upper = math.inf
    for _ in range(ROUNDS):
        shares = np.append(np.ones(len(columns)), np.zeros(7))
        cost = np.append(np.zeros(len(columns)), [-1.0, *np.zeros(6)])
        bounds = [(0.0, None)] * (len(columns) + 1) + [(-SLACK, SLACK)] * 6
        solved = linprog(cost, shares[None], [1.0], np.hstack([_powers(columns).T, -target, slack]), np.zeros(9), bounds)
        best, values = _largest(triangles, solved.eqlin.marginals)
        lower, upper = -float(solved.fun), min(upper, float(values.max() + SLACK * np.abs(solved.eqlin.marginals[:6]).sum()))
        if lower >= enough * unit or upper - lower <= AGREEMENT * lower:
            break
        columns = np.vstack([columns, best[np.argsort(-values)[:ADDED]]])
    return upper / unit


def _powers(points: Array) -> Array:
    """The six products of coordinates, and the coordinates, shape (n, 9)."""
    return np.hstack([points[:, PAIRS[0]] * points[:, PAIRS[1]], points])


def _largest(triangles: Array, form: Array) -> tuple[Array, Array]:
    """Where a quadratic form is largest on each triangle, shape (n, 3), among candidates that contain its maximum on all, and its values.

    The candidates are the corners, and the points inside where the form is stationary on an edge or on the triangle.
    """
    quadratic = np.zeros((3, 3))
    quadratic[PAIRS] = form[:6]
    quadratic = quadratic + quadratic.T
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    candidates = [*np.moveaxis(triangles, 1, 0)]
    with np.errstate(divide="ignore", invalid="ignore"):
        for begin, along in ((a, u), (a, v), (a + u, v - u)):
            share = -_slope(begin, along, quadratic, form) / np.sum(along @ quadratic * along, axis=1)
            candidates.append(begin + np.where((share > 0.0) & (share < 1.0), share, 0.0)[:, None] * along)
        uu, uv, vv = (np.sum(p @ quadratic * q, axis=1) for p, q in ((u, u), (u, v), (v, v)))
        along_u, along_v = (_slope(a, along, quadratic, form) for along in (u, v))
        s, t = (uv * along_v - vv * along_u) / (uu * vv - uv**2), (uv * along_u - uu * along_v) / (uu * vv - uv**2)
        inside = (s > 0.0) & (t > 0.0) & (s + t < 1.0)
    candidates.append(a + np.where(inside, s, 0.0)[:, None] * u + np.where(inside, t, 0.0)[:, None] * v)
    values = np.array([_powers(points) @ form for points in candidates])
    which, rows = values.argmax(axis=0), np.arange(len(a))
    return np.array(candidates)[which, rows], values[which, rows]


def _slope(points: Array, along: Array, quadratic: Array, form: Array) -> Array:
    """The derivative of the form at points in directions, shape (n,)."""
    return np.sum((points @ quadratic + form[6:]) * along, axis=1)


def _thickened(points: Array) -> Array:
    """The points moved by a small distance along each axis, both ways: their hull has a volume and contains that of the points."""
    by = THICKNESS * np.abs(points).max() * np.vstack([np.eye(3), -np.eye(3)])
    return (points[:, None] + by).reshape(-1, 3)
