"""The method of Huamin Wang's lecture note "Rigid Body Dynamics", executable: arrays in, arrays out.

This package imports no code of scenes or engines. README.md in this folder lists the function and the test of each equation.
"""

from dropspin.reference_impl import sources  # noqa: F401  # isort: skip  # before anything that is compiled from them
from dropspin.reference_impl.body import Body, Floor, World
from dropspin.reference_impl.inertia import solid_box_inertia, solid_sphere_inertia, total_mass, vertex_inertia
from dropspin.reference_impl.methods import Methods
from dropspin.reference_impl.simulate import Simulator, UnsolvedContact, simulate, step

__all__ = [
    "Body",
    "Floor",
    "Methods",
    "Simulator",
    "UnsolvedContact",
    "World",
    "simulate",
    "solid_box_inertia",
    "solid_sphere_inertia",
    "step",
    "total_mass",
    "vertex_inertia",
]

if __name__ != "dropspin.reference_impl":  # in a checkout that is on the path
    raise ImportError("import dropspin.reference_impl, not reference_impl")
