"""The subtlest of the planted faults are caught, and a sound engine is left alone; `make faults` runs all of them."""

import pytest
from support import fault_suite

NUMBERS = {engine.title: number for number, engine in enumerate([*fault_suite.FAULTS, *fault_suite.SOUND])}


@pytest.mark.parametrize(
    "title",
    [
        "restitution 0.3 % too low",
        "99 % of the gyroscopic term",
        "Coulomb friction 1 % too strong",
    ],
)
def test_a_subtle_fault_is_caught(title):
    """By the core catalogue at its default steps."""
    assert fault_suite.catches(NUMBERS[title])


@pytest.mark.parametrize("title", ["single precision, declared"])
def test_a_sound_engine_raises_no_alarm(title):
    """Not one check fails."""
    assert fault_suite.catches(NUMBERS[title]) == []


def test_there_are_enough_of_them():
    """Forty faults and ten sound engines, each with a name of its own."""
    assert len(fault_suite.FAULTS) >= 40
    assert len(fault_suite.SOUND) >= 10
    assert len(NUMBERS) == len(fault_suite.FAULTS) + len(fault_suite.SOUND)
