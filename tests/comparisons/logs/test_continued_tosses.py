"""Engines continue measured flights: in flight exactly, and from above the floor."""

from dataclasses import replace

import numpy as np
import pytest
from support import log_fits

from dropspin.comparisons.logs.continued_tosses import STEPS_PER_FRAME, Launches, launches, poses, scene_of, usable
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.scenarios import DropspinError
from dropspin.scenarios.rotations import angle_between_orientations
from dropspin.scenarios.state import ORIENTATION, POSITION
from dropspin.scenarios.truths.flight import flight_states

DT = 1.0 / log_fits.RATE / STEPS_PER_FRAME


@pytest.mark.parametrize("name", [log_fits.WANG, "mujoco", "pybullet"])
def test_flight_of_an_engine_is_the_exact_one_in_every_frame(name):
    """Velocities that lag half a step start half a step earlier: semi-implicit Euler is then exact in its positions."""
    state = log_fits.true_states(np.random.default_rng(1), 1)[0]
    state[1] += 2.0
    scene, frames = scene_of(log_fits.HEADER), np.arange(20) / log_fits.RATE
    found = poses(engine_entry(name), Launches(scene, DT, np.zeros(3), state[np.newaxis], frames[np.newaxis]))[0, 0]
    exact = flight_states(state, scene.body.inertia_tensor, scene.acceleration)(frames)
    assert np.abs(found[:, POSITION] - exact[:, POSITION]).max() < 1e-12
    assert angle_between_orientations(found[:, ORIENTATION], exact[:, ORIENTATION]).max() < 2e-4  # of the first order, 1.5e-5 measured


def test_state_that_noise_puts_below_the_floor_starts_earlier():
    flights = log_fits.tosses(np.random.default_rng(2), 5, log_fits.WANG, 0.3, 0.3)
    starts, scene = usable(flights), scene_of(log_fits.HEADER)
    states = np.array([start.state for start in starts])
    depth = scene.starting_at(states[0]).clearance + 1e-4
    states[0, 1] -= depth
    with pytest.raises(DropspinError, match=r"toss 0: the body is 0\.1 mm below the floor"):
        launches(log_fits.HEADER, starts, states, DT)
    starts[0] = replace(starts[0], frame=1, toss=replace(starts[0].toss, t=np.arange(10) / log_fits.RATE))
    found = launches(log_fits.HEADER, starts, states, DT)
    assert found.frames[0, 0] == pytest.approx(DT)
    assert scene.starting_at(found.states[0]).clearance > 0.0


def test_too_few_tosses_are_named():
    with pytest.raises(DropspinError, match="has 4 tosses with 1 frame after a flight; give at least 5"):
        usable(log_fits.tosses(np.random.default_rng(3), 4, log_fits.WANG, 0.3, 0.3))
