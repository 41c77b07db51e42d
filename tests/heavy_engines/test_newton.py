"""Newton's settings, which depend on its solver."""

import pytest
from support.settings import other_value, verify_equal

from dropspin import scenarios
from dropspin.comparisons.engines.newton_settings import SETTINGS, SHAPE
from dropspin.comparisons.engines.registry import engine
from dropspin.scenarios import DropspinError


def in_force(options):
    """The settings of a sliding box, as Newton has them."""
    with engine(f"newton[{options}]").prepare(scenarios.load("slide-box"), 1e-3) as simulation:
        return simulation.settings


@pytest.mark.parametrize("solver", SETTINGS)
def test_defaults_are_those_of_the_library(solver):
    """Of a solver and of shapes that were made without them; the scene's are those of a new `ShapeConfig`."""
    import newton

    has, shape = in_force(f"solver={solver},profile=default"), newton.ModelBuilder.ShapeConfig()
    for name, setting in SETTINGS[solver].items():
        assert (getattr(shape, name) if setting.is_computed and name in SHAPE else has[name]) == setting.default, name


@pytest.mark.parametrize("solver", SETTINGS)
def test_solver_has_all_of_its_settings_that_are_given(solver):
    given = {name: other_value(setting) for name, setting in SETTINGS[solver].items()}
    has = in_force(",".join(f"{name}={value}" for name, value in {"solver": solver, **given}.items()))
    for name, value in given.items():
        verify_equal(has[name], value, name)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("ke=1e4", "ke has no effect with solver=xpbd; it needs solver=semi-implicit or solver=featherstone or solver=mujoco"),
        ("solver=mujoco,gap=0", "gap has no effect with solver=mujoco; it needs solver=xpbd"),
        ("solver=featherstone,angular_damping=0.05", "angular_damping has no effect with solver=featherstone"),
    ],
)
def test_settings_of_other_solvers_are_refused(given, message):
    with pytest.raises(DropspinError, match=message):
        engine(f"newton[{given}]")
