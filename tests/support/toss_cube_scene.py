"""Writes `scenarios/catalogue/toss-cube.json`, the tosses of the scene `toss-cube`: every fifth toss of the recording of that name.

    PYTHONPATH=tests python -m support.toss_cube_scene

The header is corrected by what `dropspin log check toss-cube` finds: lengths that are 2.2 % short, and a centre of mass beside the centre.
"""

from dataclasses import replace

from dropspin.comparisons.logs.continued_tosses import flights_in, measured_scene
from dropspin.comparisons.logs.log import load_log
from dropspin.scenarios.loading import CATALOGUE
from dropspin.scenarios.recording import Recording

LENGTH_SCALE = 0.978
CENTRE_OF_MASS = (0.0, 0.0, 0.0062)
EVERY = 5


def chosen(log):
    """The tosses of the scene, of the recording as it was published."""
    header = log.header
    body = type(header.body).model_validate(header.body.model_dump() | {"center_of_mass": CENTRE_OF_MASS})
    tosses = [replace(toss, position=toss.position / LENGTH_SCALE) for toss in log.tosses]
    corrected = replace(log, header=header.model_copy(update={"body": body}), tosses=tuple(tosses))
    recording = measured_scene(flights_in(corrected)).recording
    return Recording(name=recording.name, noise=recording.noise, tosses=recording.tosses[::EVERY])


if __name__ == "__main__":
    (CATALOGUE / "toss-cube.json").write_text(chosen(load_log("toss-cube")).model_dump_json(), encoding="utf-8")
