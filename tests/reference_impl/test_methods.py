"""What each method's module declares about itself, and what follows for a choice of methods."""

import math

import numpy as np
import pytest

import dropspin.reference_impl.state
import dropspin.scenarios.state
from dropspin.comparisons.engines import mapping
from dropspin.reference_impl import Body, Floor, Methods, World, simulate
from dropspin.reference_impl.methods import COLLIDE, CONTACTS, LAWS, ROTATIONS

LEAVES = [*ROTATIONS.values(), *LAWS.values(), *CONTACTS.values()]


@pytest.mark.parametrize("leaf", LEAVES, ids=lambda leaf: leaf.__name__)
def test_leaf_declares_its_order_cost_and_source(leaf):
    assert leaf.ORDER in (1.0, 2.0, 4.0, math.inf, None)
    lines = leaf.__doc__.splitlines()
    for fact in ("Order: ", "Cost: ", "Source: "):
        assert any(line.startswith(fact) for line in lines), fact


@pytest.mark.parametrize(
    ("methods", "gravity", "damping", "floor", "order"),
    [
        (Methods(), False, False, False, None),
        (Methods(rotation="rk4"), False, False, False, 4.0),
        (Methods(rotation="rk4"), True, False, False, 1.0),
        (Methods(rotation="rk4"), False, True, False, 1.0),
        (Methods(rotation="exact"), False, False, False, math.inf),
        (Methods(rotation="exact"), True, False, True, None),
        (Methods(rotation="midpoint"), False, False, False, 2.0),
    ],
)
def test_order_is_the_lowest_of_the_parts_that_a_motion_needs(methods, gravity, damping, floor, order):
    assert methods.order(gravity=gravity, damping=damping, floor=floor) == order


@pytest.mark.sample(2)
@pytest.mark.parametrize("law", LAWS)
def test_laws_without_a_friction_cone_reject_a_finite_coefficient(law):
    ball = Body(1.0, np.eye(3), np.zeros((1, 3)), (0.1, 0.1, 0.1))
    start, world = [0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.0], World(floor=Floor(0.5, 0.3))
    if LAWS[law].ANY_FRICTION:
        assert simulate(start, ball, world, 1e-3, 0, methods=Methods(law=law)).shape == (1, 13)
    else:
        with pytest.raises(ValueError, match=f"friction: got 0.3; law '{law}' takes 0 and infinity only; use law='coulomb'"):
            simulate(start, ball, world, 1e-3, 0, methods=Methods(law=law))


def test_every_contact_works_with_the_laws_of_its_table_only():
    assert set(COLLIDE) == set(CONTACTS)
    with pytest.raises(ValueError, match="contact 'sequential' works with the laws normal, coulomb, not with 'note'"):
        Methods(contact="sequential")


def test_discretisations_shared_with_other_engines_have_the_same_names():
    """Engines of the same discretisation must agree, so they must name it alike; this package cannot import the names."""
    assert ROTATIONS["gyroscopic"].DISCRETISATION == mapping.EXPLICIT_GYROSCOPIC
    assert ROTATIONS["implicit-gyroscopic"].DISCRETISATION == mapping.IMPLICIT_GYROSCOPIC
    assert Methods(rotation="rk4").discretisation(tumbles=False) == mapping.SEMI_IMPLICIT_EULER
    assert Methods(rotation="rk4").discretisation(tumbles=True) == "rk4"
    assert len({leaf.DISCRETISATION for leaf in ROTATIONS.values()}) == len(ROTATIONS)


def test_state_layouts_of_the_two_packages_agree():
    for name in ("POSITION", "ORIENTATION", "VELOCITY", "SPIN"):
        assert getattr(dropspin.reference_impl.state, name) == getattr(dropspin.scenarios.state, name)
