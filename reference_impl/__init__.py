"""The method of Huamin Wang's lecture note "Rigid Body Dynamics", executable: arrays in, arrays out.

This package imports no code of scenes or engines. README.md in this folder lists the function and the test of each equation.
"""

from dropspin.reference_impl import sources  # noqa: F401  # isort: skip  # before anything that is compiled from them
from dropspin.reference_impl.body import Body as Body
from dropspin.reference_impl.body import Floor as Floor
from dropspin.reference_impl.body import Wall as Wall
from dropspin.reference_impl.body import World as World
from dropspin.reference_impl.inertia import solid_box_inertia as solid_box_inertia
from dropspin.reference_impl.inertia import solid_sphere_inertia as solid_sphere_inertia
from dropspin.reference_impl.inertia import total_mass as total_mass
from dropspin.reference_impl.inertia import vertex_inertia as vertex_inertia
from dropspin.reference_impl.methods import Methods as Methods
from dropspin.reference_impl.simulate import Simulator as Simulator
from dropspin.reference_impl.simulate import UnsolvedContact as UnsolvedContact
from dropspin.reference_impl.simulate import simulate as simulate
from dropspin.reference_impl.simulate import step as step

if __name__ != "dropspin.reference_impl":  # in a checkout that is on the path
    raise ImportError("import dropspin.reference_impl, not reference_impl")
