"""Planted faults of every kind are detected and a correct engine passes; `make faults` and the slow tests run the whole core catalogue."""

import pytest
from support.fault_suite import ENGINES, FAULTS, SOUND, failed_checks, scenes_with

NUMBERS = {engine.title: number for number, engine in enumerate(ENGINES)}
SUBTLE = {
    "restitution 0.3 % too low": "drop-ball",
    "99 % of the gyroscopic term": "spin-dzhanibekov",
    "Coulomb friction 1 % too strong": "slide-box",
}
HARD_CODED = {
    "0.6 in place of infinite friction": "drop-ball-grip",
    "1 in place of infinite friction": "drop-ball-grip",
    "damping ignored": "fall-damped",
    "gravity of 9.8 m/s² along -y in every scene": "drop-box-heavy",
    "mass of 1 kg in every scene, inertia right": "drop-box-heavy",
    "products of inertia dropped": "fall-tilted",
}
OTHER_KINDS = {
    "restitution that vanishes as dt → 0": "drop-ball",
    "orientation drifts by 1e-5 rad/s": "drop-ball",
    "0.1 % of energy gained at each bounce": "drop-ball",
    "angular damping of 1e-3 not switched off": "fall-spin",
    "second order, claimed fourth": "fall-spin",
}
STEPS_AND_IMPACTS = {
    "gravity of 9.81 for 9.8 m/s²": "drop-ball",
    "gravity acts twice in the first step": "fall-spin",
    "time steps that jitter by 20 %": "fall-spin",
    "half precision once": "fall-spin",
    "positions one step late": "fall-spin",
    "damping about one axis": "spin-dzhanibekov",
    "floor tilted by 1 mrad": "drop-ball",
    "restitution that falls with the impact speed": "drop-ball",
    "impulse at another vertex": "drop-box-corner",
    "velocity left from earlier simulations": "fall-spin",
    "moment of inertia about y 1 % too large": "spin-dzhanibekov",
    "inertia of a ball": "spin-dzhanibekov",
}

FRICTION = {
    "friction along the axes separately": "slide-box-askew",
    "friction in one direction only": "roll-ball",
    "friction that pushes": "slide-box",
    "rolling resistance of 0.5 % a second": "roll-ball",
    "speed gained on slopes, 0.1 % a second": "slope-box-slide",
    "acceleration of 1 mm/s² along a hidden axis": "roll-ball-back",
    "gravity along a slope dropped": "roll-slope",
    "balls of 2/3 M r²": "roll-ball",
    "landings on an edge that take 1 % less speed": "roll-prism-slope",
    "orientation that depends on the number of earlier simulations": "spin-dzhanibekov",
}


@pytest.mark.usefixtures("few_start_phases")
@pytest.mark.parametrize(("title", "scene"), (SUBTLE | HARD_CODED | OTHER_KINDS | STEPS_AND_IMPACTS | FRICTION).items())
def test_planted_fault_is_detected_in_one_scene(title, scene):
    """At the default time steps: a changed scene, changed states, changes at impacts and a wrong claim."""
    assert failed_checks(NUMBERS[title], [scene])


def test_correct_engine_passes_in_some_scenes():
    assert (
        failed_checks(NUMBERS["single precision, declared"], ["drop-ball", "spin-dzhanibekov", "slide-box", "roll-ball", "roll-slope"])
        == []
    )


@pytest.mark.slow
def test_correct_engine_passes_the_core_catalogue():
    assert failed_checks(NUMBERS["single precision, declared"]) == []


@pytest.mark.slow
@pytest.mark.parametrize("title", SUBTLE)
def test_subtle_fault_is_detected_by_the_core_catalogue(title):
    assert failed_checks(NUMBERS[title])


def test_suite_has_forty_faults_and_ten_correct_engines():
    """Each with a title of its own; the core catalogue has the scenes of these tests."""
    assert len(FAULTS) >= 40
    assert len(SOUND) >= 10
    assert len(NUMBERS) == len(FAULTS) + len(SOUND)
    assert {*SUBTLE.values(), *HARD_CODED.values(), *OTHER_KINDS.values(), *STEPS_AND_IMPACTS.values()} <= set(scenes_with("core"))
    assert set(FRICTION.values()) <= set(scenes_with("core", "friction"))
