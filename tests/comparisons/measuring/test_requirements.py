"""Which scenes have what a metric needs, where one number decides."""

from types import SimpleNamespace

import numpy as np
import pytest

from dropspin.comparisons.measuring.requirements import gains_no_energy, keeps_horizontal_momentum
from dropspin.scenarios import load
from dropspin.scenarios.variations import changed

BALL = load("drop-ball")


@pytest.mark.parametrize(
    ("acceleration", "keeps"), [((0.0, -9.8, 0.0), True), ((0.1, -9.8, 0.0), False), ((0.0, -9.8, 0.1), False), ((0.1, -9.8, 0.1), False)]
)
def test_horizontal_momentum_is_kept_under_gravity_straight_down(acceleration, keeps):
    scene = changed(BALL, floor={"friction": "none"}, gravity={"acceleration": acceleration})
    assert bool(keeps_horizontal_momentum(scene, None)) == keeps


@pytest.mark.parametrize(("share", "gains"), [(1.0, False), (1.0 + 1e-10, False), (1.0 + 1e-8, True), (1.2, True)])
def test_impact_after_which_the_energy_is_larger_gains_energy(share, gains):
    before, after = (np.array([0.0] * 6 + [1.0, 0.0, speed] + [0.0] * 4) for speed in (-2.0, 2.0 * np.sqrt(share)))
    truth = SimpleNamespace(events=[SimpleNamespace(before=before, after=after)])
    assert gains_no_energy(BALL, truth) is not gains
