"""The defaults in an engine's table of settings are those of its library, where the adapter reads them back."""

from dataclasses import replace

from dropspin import scenarios
from dropspin.comparisons.engines.options import spelled
from dropspin.comparisons.engines.registry import engine


def test_defaults_are_those_of_the_library(case):
    """What the adapter computes from the scene is left out."""
    chosen = engine(case.label)
    if "profile" not in chosen.choices:
        return
    default = replace(chosen, options={**chosen.options, "profile": "default"})
    with default.prepare(scenarios.load("slide-box"), 1e-3) as simulation:
        found = simulation.settings
    read = [name for name, setting in chosen.settings.items() if name in found and not setting.is_computed]
    assert {name: spelled(found[name]) for name in read} == {name: spelled(chosen.settings[name].default) for name in read}
