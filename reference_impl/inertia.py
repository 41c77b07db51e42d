"""Mass and inertia: eq 2 and 8 of the lecture note, and the solid bodies that engines build from a shape."""

import math

import numpy as np
from numpy.typing import NDArray


def total_mass(masses: NDArray[np.float64]) -> float:
    """Eq 2: M = Σ mᵢ [kg]."""
    return float(masses.sum())


def vertex_inertia(points: NDArray[np.float64], masses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inertia tensor of point masses at the vertices, eq 8 with masses: I_body = Σ mᵢ (pᵢᵀpᵢ 1 − pᵢpᵢᵀ).

    The lecture note prints the formula without mᵢ; masses of 1 give the printed formula.

    Args:
        points: Vertices relative to the centre of mass, in the body frame [m], shape (n, 3).
        masses: Mass of each vertex [kg], shape (n,).

    Returns:
        Inertia about the centre of mass [kg m²], shape (3, 3).
    """
    products = np.array([[math.fsum(masses * a * b) for b in points.T] for a in points.T])  # Σ mᵢ pᵢpᵢᵀ, summed exactly
    return np.trace(products) * np.eye(3) - products


def solid_box_inertia(mass: float, half_extents: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inertia tensor of a uniform box with half extents a, b, c: m/3 (b² + c²) about the axis of a [kg m²], shape (3, 3)."""
    a, b, c = half_extents**2
    return np.diag(mass / 3.0 * np.array([b + c, c + a, a + b]))


def solid_sphere_inertia(mass: float, radius: float) -> NDArray[np.float64]:
    """Inertia tensor of a uniform ball of radius R: 2/5 m R² [kg m²], shape (3, 3)."""
    return 0.4 * mass * radius**2 * np.eye(3)
