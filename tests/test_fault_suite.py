"""Planted faults of every kind are detected and a correct engine passes; `make faults` and the slow tests run the whole core catalogue."""

import pytest
from support.fault_suite import ENGINES, FAULTS, SOUND, failed_checks, scenes_with

NUMBERS = {engine.title: number for number, engine in enumerate(ENGINES)}
SUBTLE = {
    "restitution 0.3 % too low": "drop-ball",
    "gyroscopic term 1 % too small": "spin-dzhanibekov",
    "coefficient of friction 1 % too large": "slide-box",
}
HARD_CODED = {
    "coefficient of friction 0.6 in place of infinite friction": "drop-ball-grip",
    "coefficient of friction 1 in place of infinite friction": "drop-ball-grip",
    "damping ignored": "fall-damped",
    "gravity of 9.8 m/s² along -y in every scene": "drop-box-heavy",
    "mass of 1 kg in every scene, correct inertia": "drop-box-heavy",
    "products of inertia set to 0": "fall-tilted",
}
OTHER_KINDS = {
    "restitution that vanishes as dt → 0": "drop-ball",
    "orientation drifts by 1e-5 rad/s": "drop-ball",
    "0.1 % of energy gained at each bounce": "drop-ball",
    "additional angular damping of 1e-3 1/s in free flight": "fall-spin",
    "method of second order, claimed to be of fourth order": "fall-spin",
}
STEPS_AND_IMPACTS = {
    "gravity of 9.81 instead of 9.8 m/s²": "drop-ball",
    "gravity acts twice in the first time step": "fall-spin",
    "time steps that vary at random by up to 20 %": "fall-spin",
    "state rounded once to half precision, after 0.1 s": "fall-spin",
    "positions reported one time step late": "fall-spin",
    "additional angular damping about one axis of the body": "spin-dzhanibekov",
    "floor tilted by 1 mrad under falling balls": "drop-ball",
    "restitution of balls that decreases with the impact speed": "drop-ball",
    "impulse at another vertex than the one that strikes": "drop-box-corner",
    "initial velocity 1 mm/s larger in each further simulation": "fall-spin",
    "moment of inertia about y 1 % too large": "spin-dzhanibekov",
    "three equal moments of inertia instead of the true ones": "spin-dzhanibekov",
}

FRICTION = {
    "friction computed for each axis separately": "slide-box-askew",
    "no friction on bodies that slide along +z": "roll-ball",
    "friction that accelerates the body along its slip": "slide-box",
    "balls on a rough floor lose 0.5 % of their speed per second": "roll-ball",
    "bodies on slopes gain 0.1 % of their speed per second": "slope-box-slide",
    "additional acceleration of 1 mm/s² along x on a rough floor": "roll-ball-back",
    "component of gravity along the floor set to 0": "roll-slope",
    "balls with the moment of inertia 2/3 M r² of a hollow ball": "roll-ball",
    "landing on an edge takes 1 % less angular velocity than it should": "roll-prism-slope",
    "orientation wrong by a further 1 mrad in each further simulation": "spin-dzhanibekov",
}


@pytest.mark.sample(1)
@pytest.mark.usefixtures("few_start_phases")
@pytest.mark.parametrize(("title", "scene"), (SUBTLE | HARD_CODED | OTHER_KINDS | STEPS_AND_IMPACTS | FRICTION).items())
def test_planted_fault_is_detected_in_one_scene(title, scene):
    """At the default time steps: changed scenes, states and impacts, and a wrong claim; an engine that crashes tests nothing."""
    assert {check for _, check in failed_checks(NUMBERS[title], [scene])} - {"crashed"}


@pytest.mark.extended
def test_correct_engine_passes_in_some_scenes():
    assert (
        failed_checks(
            NUMBERS["the exact solution in single precision, declared as such"],
            ["drop-ball", "spin-dzhanibekov", "slide-box", "roll-ball", "roll-slope"],
        )
        == []
    )


@pytest.mark.slow
def test_correct_engine_passes_the_core_catalogue():
    assert failed_checks(NUMBERS["the exact solution in single precision, declared as such"]) == []


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
