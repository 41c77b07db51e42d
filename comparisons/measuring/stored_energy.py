"""The energy that soft contacts store and give back, which is not gained."""

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.measuring.contact_runs import RESOLVED, STEADY
from dropspin.comparisons.measuring.motions import Motions

Array = NDArray[np.float64]


def energy_with_stored(motions: Motions) -> Array:
    """Energy plus the largest energy that a contact may have stored and give back [J], shape (..., n).

    A force that grows with the depth of the lowest point below its height before the contact stores at most force times depth, and no more
    than the energy that the body lost in the contact. A contact is rigid, and stores none, unless the point moves down against a force
    larger than the weight in two successive time steps.
    """
    runs = motions.contacts
    motion, step, number = runs.steps
    energy, lowest, velocity = map(np.atleast_2d, (motions.energy, motions.lowest_height, motions.states.vertical_velocity))
    fall, dt, mass = (np.broadcast_to(one, len(energy))[motion] for one in (motions.fall, motions.dt, motions.setup.mass))
    rise, sinking = velocity[motion, step + 1] - velocity[motion, step], lowest[motion, step] - lowest[motion, step + 1]
    compressed = (rise > STEADY * fall) & (sinking > RESOLVED * fall * dt)
    again = compressed[1:] & compressed[:-1] & (number[1:] == number[:-1])
    is_soft = np.zeros(len(runs.motion), dtype=bool)
    is_soft[number[1:][again]] = True
    before = runs.before[number]
    level = np.maximum(lowest[motion, np.maximum(before - 1, 0)], 0.0)
    force = np.where(is_soft[number], mass * np.maximum(rise + fall, 0.0) / dt, 0.0)
    found = energy.copy()
    for row in (step, step + 1):
        lost = energy[motion, before] - energy[motion, row]
        stored = np.minimum(force * np.maximum(level - lowest[motion, row], 0.0), lost)
        found[motion, row] = np.maximum(found[motion, row], energy[motion, row] + stored)
    return found.reshape(motions.energy.shape)
