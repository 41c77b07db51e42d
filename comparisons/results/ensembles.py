"""Ensembles: what became of each start, and the metrics that are means over them."""

from collections.abc import Callable
from dataclasses import dataclass

from dropspin.scenarios.state import Array

SAMPLES = 41
"""Times at which an ensemble's energy is kept, the start and the end among them."""
QUICK_MEMBERS = 16
"""Members that a quick run simulates; they are drawn independently, so the first ones are a sample."""


@dataclass(frozen=True, eq=False)
class EnsembleOutcome:
    """The results of each member of an ensemble.

    Attributes:
        t: Times [s], shape (SAMPLES,).
        energy: Energy of each member at these times, divided by the scene's energy, shape (size, SAMPLES).
        rebound: Largest height of each member after its first contact, divided by its initial height, shape (size,); 0 without a contact.
        rest_time: The last time at which each member moved [s], shape (size,).
        angular_momentum: Magnitude of the angular momentum of each member at these times, divided by r √(2 E M), with the scene's energy E
            and the body's size r and mass M, shape (size, SAMPLES).
    """

    t: Array
    energy: Array
    rebound: Array
    rest_time: Array
    angular_momentum: Array


@dataclass(frozen=True)
class EnsembleMetric:
    """A mean over an ensemble: its unit, its definition, and the value of each member."""

    unit: str
    definition: str
    of_each: Callable[[EnsembleOutcome], Array]


OF_SCENE = "divided by the scene's energy (of the fall, or of the initial motion)."
AFTER_CONTACT = "Largest height of the centre of mass after the first contact, divided by the initial height; 0 without a contact."
ENSEMBLE_METRICS = {
    "energy_halfway": EnsembleMetric("1", f"Energy at half the duration, {OF_SCENE}", lambda o: o.energy[:, SAMPLES // 2]),
    "energy_at_end": EnsembleMetric("1", f"Energy at the end, {OF_SCENE}", lambda o: o.energy[:, -1]),
    "rebound_height": EnsembleMetric("1", AFTER_CONTACT, lambda o: o.rebound),
    "rest_time": EnsembleMetric("s", "Last time of motion, as in rest_time_error; the end if the body still moves.", lambda o: o.rest_time),
}
