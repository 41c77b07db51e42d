"""Each setting of an engine given with another value than its default, and read back."""

import math

import numpy as np

from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.engines.settings import Setting, Value, spelled
from dropspin.scenarios import Scenario


def other_value(setting: Setting) -> str:
    """A value that is allowed, and not the default."""
    if isinstance(setting.default, bool):
        return spelled(not setting.default)
    if setting.values:
        return next(word for word in setting.values[::-1] if word != setting.default)
    return "7" if setting.default == math.inf else spelled(np.minimum(np.add(setting.default, 1), setting.most).tolist())


def verify_settings_are_in_force(name: str, scene: Scenario) -> None:
    """An engine has each setting that is given: in single precision, what is read back is rounded."""
    settings = engine(name).settings
    assert settings
    for option, setting in settings.items():
        value = other_value(setting)
        needs = "".join(f",{other}={needed}" for other, needed, *_ in setting.needs)
        with engine(f"{name}[{option}={value}{needs}]").prepare(scene, 1e-3) as simulation:
            simulation.advance(1)
            verify_equal(simulation.settings.get(option, setting.default), value, option)


def verify_defaults_are_in_force(name: str, scene: Scenario) -> None:
    """With profile=default, an engine has the default of each setting that does not follow from the scene, as those of the floor do."""
    chosen = engine(f"{name}[profile=default]")
    with chosen.prepare(scene, 1e-3) as simulation:
        for option, setting in chosen.settings.items():
            if option in simulation.settings and not setting.is_computed and not option.startswith("floor_"):
                verify_equal(simulation.settings[option], spelled(setting.default), option)


def verify_equal(has: Value, expected: str, option: str) -> None:
    """A setting has a value that is written as text: a number to the digits of single precision."""
    if isinstance(has, str | bool):
        assert spelled(has) == expected, option
    else:
        np.testing.assert_allclose(has, [float(part) for part in expected.split()], rtol=1e-6, err_msg=option)
