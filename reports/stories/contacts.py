"""The contacts of a scene: for each engine, the largest violation of each law of contact, and the start of the contact that has it."""

import math

import numpy as np

from dropspin.comparisons.measuring.contact_laws import RESIDUALS, contacts
from dropspin.comparisons.measuring.requirements import obeys_contact_laws
from dropspin.comparisons.results.results import Results
from dropspin.reports.document import Rows
from dropspin.reports.stories.numbers import formatted


@np.errstate(all="ignore")  # an engine may return 1e300
def worst_contacts(results: Results, scene_name: str) -> Rows:
    """A row for each engine whose body touches the floor at the finest time step: number of contacts, largest violation of each law.

    The motion is the one from the initial state of the scene. The list is empty if the forces of the floor cannot be computed.
    """
    scene = results.scenes[scene_name]
    if not obeys_contact_laws(scene, None):
        return []
    mine = {(engine, dt): motion for (name, engine, dt), motion in results.trajectories.items() if name == scene_name}
    rows = []
    for engine in results.engines:
        motion = next((mine[key] for key in sorted(mine, key=lambda key: key[1]) if key[0] == engine), None)
        sound = None if motion is None else motion[: motion.first_bad_row]
        table = None if sound is None or len(sound) < 2 else contacts(scene, sound)
        if table is not None and len(table):
            worst = {name: _worst(table[name].tolist(), table["start"].tolist()) for name in RESIDUALS}
            rows.append({"engine": engine, "contacts": str(len(table)), **worst})
    return rows


def _worst(values: list[float], times: list[float]) -> str:
    """The largest value, with its time [s] if it is not 0; – if a value is undefined, such as the cone excess with infinite friction."""
    if any(map(math.isnan, values)):
        return "–"
    largest = max(values)
    return "0" if largest == 0.0 else f"{formatted(largest)} at {times[values.index(largest)]:.4g} s"
