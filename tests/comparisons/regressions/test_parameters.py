"""The single wrong parameter that the asymptotic errors of an engine are consistent with."""

import pytest
from support import engines as made
from support.detection_power import FAULTS, faulty_engine

from comparisons.regressions.parameters import _parameters, wrong_parameters
from comparisons.running.run import run
from reports.views.failures import failures, grouped
from scenarios import load

OF = {fault.title: fault for fault in FAULTS}


def lasting(name, seconds=6.0):
    """A scene that ends after some seconds at the latest; the faults show well before."""
    scene = load(name)
    return scene.model_copy(update={"duration": min(scene.duration, seconds)})


@pytest.mark.parametrize(
    ("title", "engine", "scenes", "size", "words"),
    [
        ("restitution", "exact", ["drop-ball", "drop-ball-lively"], 0.005, "restitution 0.5 % too high"),
        ("restitution", "mujoco", ["drop-ball"], -0.003, "restitution 0.3 % too low"),
        ("linear damping", "exact", ["fall-damped"], -0.01, "linear damping wrong by 1 %"),
        ("moment of inertia about x", "exact", ["spin-asymmetric"], 0.01, "moment of inertia about x wrong by 1 %"),
        ("Coulomb coefficient", "exact", ["slide-box"], 0.01, "Coulomb coefficient wrong by 1 % or gravity wrong by 1 %"),
    ],
)
def test_planted_fault_is_among_the_parameters_that_are_named(title, engine, scenes, size, words):
    """An error that two parameters cause alike names both: sliding depends on their product."""
    results = run([lasting(name) for name in scenes], faulty_engine(engine, OF[title], size))
    [group] = grouped(results, failures(results))
    assert group.consistent_with == f"Consistent with {words}."


@pytest.mark.parametrize(
    "engine",
    [faulty_engine("exact", OF["gyroscopic term"], 0.01), made.engine_with("turned", made.turned_by(0.1)), made.Exact()],
    ids=["gyroscopic", "turned", "sound"],
)
def test_fault_of_another_kind_is_attributed_to_no_parameter(engine):
    assert wrong_parameters(run(lasting("spin-asymmetric"), engine), engine.label) == []


def test_moments_that_no_body_has_explain_no_error():
    """The largest moment of a thin plate is almost the sum of the other two."""
    plate = load({"duration": 1.0, "body": {"shape": "box", "half_extents": [0.3, 0.001, 0.2], "mass": 1.0}})
    about_y = _parameters()["moment of inertia about y"]
    assert about_y(plate, 0.01) is None
    assert about_y(plate, -0.01) is not None
