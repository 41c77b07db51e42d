"""The errors that MuJoCo's known limitations explain, in drawn scenes: as large as the errors that are measured, and not much larger."""

import pytest

import dropspin as ds
from comparisons.engines.registry import engine


@pytest.mark.parametrize(
    ("name", "explained"),
    [
        ("draw-7-006", "several forces share an impulse"),  # a box on a face: 9e-5 of the restitution
        ("draw-8-037", "several forces share an impulse"),  # a gripping corner: 1.2e-3
        ("draw-7-025", "contacts slip"),  # a rough ball: its rebound is 3.7 times too fast
        ("draw-10-005", "contacts slip"),  # 5.9e-2, as large as the limitation allows
    ],
)
def test_known_limitations_of_mujoco_explain_its_restitution(name, explained):
    """The error does not vanish as dt → 0; the bound is not generous: it allows at most twenty times as much."""
    results = ds.run(name, "mujoco")
    assert results.exit_code() == 0
    asymptotic = results.table[(results.table["kind"] == "asymptotic_error") & (results.table["metric"] == "restitution_error")].iloc[0]
    assert (asymptotic["verdict"], asymptotic["cause"]) == ("limited", "model")
    assert explained in asymptotic["reason"]
    scene = ds.load(name)
    simulation = engine("mujoco").prepare(scene, 1e-3)
    simulation.record(scene.steps(1e-3))
    [allowed] = [one.explained_errors["restitution_error"] for one in simulation.known_limitations if explained in one.message]
    assert allowed < 20.0 * abs(asymptotic["value"])
