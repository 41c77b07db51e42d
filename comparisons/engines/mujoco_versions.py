"""What MuJoCo has and does by version; a version is its numbers, such as (3, 8, 1).

Source: MuJoCo's changelog, under the versions named here. Measured besides in each minor version from 3.2.4 to 4.0.0, by MuJoCo's own
free-body test (a box of half extents .1 .2 .3 m, ω = (1, 2, 3) rad/s, 500 steps of 10 ms): E/E₀ ends at 1.0868946 where the gyroscopic term
is explicit, at .9260083 where it is implicit, and at 1 - 7e-15 at the midpoint.
"""

import re
from collections.abc import Mapping

from comparisons.engines.base import EXPLICIT_GYROSCOPIC, IMPLICIT_GYROSCOPIC, MIDPOINT_GYROSCOPIC

Version = tuple[int, ...]

OLDEST: Version = (3, 2, 4)
"""From here on Python can set the options of a specification."""
SIDE_BY_SIDE: Version = (3, 2, 7)
"""From here on rollouts take many bodies in threads."""
EXACT_DIAGONAL: Version = (3, 9)
"""From here on there is the flag diagexact."""

SOLVER = {"cone": "elliptic", "jacobian": "dense", "diagexact": "enable", "island": "disable", "autoreset": "disable"}
"""What calibration sets of the solver where there is a contact, by the names that MJCF has for it."""
FLAGS_SINCE: Mapping[str, Version] = {"diagexact": EXACT_DIAGONAL, "island": (3, 3, 6)}  # before, islands are looked for on request only

GYROSCOPIC_SINCE: Mapping[str, Mapping[Version, str]] = {
    "euler": {OLDEST: EXPLICIT_GYROSCOPIC},
    "implicit": {OLDEST: IMPLICIT_GYROSCOPIC, (3, 7): MIDPOINT_GYROSCOPIC, (3, 8, 1): IMPLICIT_GYROSCOPIC},
    "implicitfast": {OLDEST: EXPLICIT_GYROSCOPIC, (3, 7): MIDPOINT_GYROSCOPIC, (3, 11): IMPLICIT_GYROSCOPIC},
}
RUNGE_KUTTA_SINCE: Mapping[Version, str] = {
    OLDEST: "classical Runge-Kutta with turns of second order",  # its stages' angular velocities were averaged as if turns commuted
    (4, 0): "classical Runge-Kutta",
}


def numbers_of(written: str) -> Version:
    """The numbers of a version as it is written; what else is in it, such as .dev1, comes after three of them."""
    return tuple(map(int, re.findall(r"\d+", written)[:3]))


def written(version: Version) -> str:
    """A version as it is written."""
    return ".".join(map(str, version))


def solver(version: Version) -> dict[str, str]:
    """`SOLVER`, as far as a version has it."""
    return {name: value for name, value in SOLVER.items() if version >= FLAGS_SINCE.get(name, OLDEST)}


def flight_of(integrator: str, version: Version) -> str:
    """The name of the discretisation by which an integrator lets a body tumble."""
    since = RUNGE_KUTTA_SINCE if integrator == "rk4" else GYROSCOPIC_SINCE[integrator]
    return since[max(first for first in since if first <= version)]


def refusal(version: Version) -> str | None:
    """Why no scene runs in a version, or None: they do."""
    if version >= OLDEST:
        return None
    return f"MuJoCo {written(version)} is installed, whose options Python cannot set; from {written(OLDEST)} on it can: update mujoco"


def refusal_of_boxes(version: Version) -> str | None:
    """Why no calibrated box runs on a floor in a version, or None: they do.

    Without the flag, MuJoCo takes each contact to be in line with the centre of mass. A ball's is, and it moves by the same bits; of a box
    that lands flat or on a corner the restitution's error has a limit of 1.1e-4 or 3e-5 (e = 0.5, steps of 4, 2 and 1 ms).
    """
    if version >= EXACT_DIAGONAL:
        return None
    return (
        f"MuJoCo {written(version)} is installed, in which a box's restitution is about 1e-4 off at any step; "
        f"from {written(EXACT_DIAGONAL)} on its flag diagexact mends that: update mujoco, or take profile=default"
    )
