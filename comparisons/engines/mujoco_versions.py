"""MuJoCo's features and integrators by version; a version is a tuple of numbers, such as (3, 8, 1).

Source: MuJoCo's changelog, under the versions named here. Also measured in each minor version from 3.2.4 to 4.0.0, with MuJoCo's own
free-body test (a box of half extents .1 .2 .3 m, ω = (1, 2, 3) rad/s, 500 steps of 10 ms): the final E/E₀ is 1.0868946 with the gyroscopic
term explicit, .9260083 with it implicit, and 1 - 7e-15 with the midpoint rule.
"""

import re
from collections.abc import Mapping

from dropspin.comparisons.engines.base import EXPLICIT_GYROSCOPIC, IMPLICIT_GYROSCOPIC, MIDPOINT_GYROSCOPIC

Version = tuple[int, ...]

OLDEST: Version = (3, 2, 4)
"""The first version in which Python can set the options of a specification."""
BATCHES: Version = (3, 2, 7)
"""The first version whose rollouts step many bodies in threads."""
EXACT_DIAGONAL: Version = (3, 9)
"""The first version with the flag diagexact."""
FOUR_POINTS: Version = (4, 0)
"""A version that gives a mesh four contact points with a plane; some between 3.9.0 and it may do so too."""

SOLVER = {"cone": "elliptic", "jacobian": "dense", "diagexact": "enable", "island": "disable", "autoreset": "disable"}
"""The solver settings of calibrated contacts, by their names in MJCF."""
FLAGS_SINCE: Mapping[str, Version] = {"diagexact": EXACT_DIAGONAL, "island": (3, 3, 6)}  # earlier versions look for islands on request only

GYROSCOPIC_SINCE: Mapping[str, Mapping[Version, str]] = {
    "euler": {OLDEST: EXPLICIT_GYROSCOPIC},
    "implicit": {OLDEST: IMPLICIT_GYROSCOPIC, (3, 7): MIDPOINT_GYROSCOPIC, (3, 8, 1): IMPLICIT_GYROSCOPIC},
    "implicitfast": {OLDEST: EXPLICIT_GYROSCOPIC, (3, 7): MIDPOINT_GYROSCOPIC, (3, 11): IMPLICIT_GYROSCOPIC},
}
RUNGE_KUTTA_SINCE: Mapping[Version, str] = {
    OLDEST: "classical Runge-Kutta with rotations of second order",  # it averaged its stages' angular velocities as if rotations commuted
    (4, 0): "classical Runge-Kutta",
}


def numbers_of(text: str) -> Version:
    """The first three numbers of a version string; a suffix such as .dev1 comes after them."""
    return tuple(map(int, re.findall(r"\d+", text)[:3]))


def formatted(version: Version) -> str:
    """The version as a string, such as 3.8.1."""
    return ".".join(map(str, version))


def solver(version: Version) -> dict[str, str]:
    """The settings of `SOLVER` that a version has."""
    return {name: value for name, value in SOLVER.items() if version >= FLAGS_SINCE.get(name, OLDEST)}


def flight_of(integrator: str, version: Version) -> str:
    """The name of an integrator's discretisation of a tumbling body."""
    since = RUNGE_KUTTA_SINCE if integrator == "rk4" else GYROSCOPIC_SINCE[integrator]
    return since[max(first for first in since if first <= version)]


def refusal(version: Version) -> str | None:
    """Why the adapter declines every scene in a version; None if it does not."""
    if version >= OLDEST:
        return None
    return f"MuJoCo {formatted(version)} is installed, whose options Python cannot set; update mujoco to {formatted(OLDEST)} or later"


def refusal_of_meshes(version: Version) -> str | None:
    """Why the adapter declines calibrated bodies of vertices, which are meshes, on a floor in a version; None if it does not.

    Earlier versions give a mesh at most three contact points with a plane, so that one end of an edge may be without any. Measured with
    3.2.4, 3.3.7 and 3.9.0 at 1 ms.
    """
    if version >= FOUR_POINTS:
        return None
    return (
        f"MuJoCo {formatted(version)} is installed, which gives a mesh at most three contact points with a plane, so that a prism that "
        f"rolls over its edges leaves its course by 6 to 8 mm in 1.8 m; versions from {formatted(FOUR_POINTS)} on give it four: update "
        "mujoco, or use profile=default"
    )


def refusal_of_boxes(version: Version) -> str | None:
    """Why the adapter declines calibrated boxes on a floor in a version; None if it does not.

    Without the flag, MuJoCo assumes that each contact is in line with the centre of mass. That holds for a ball, whose motion is the same
    to the last bit. For a box that lands flat or on a corner, the error of restitution does not vanish as dt → 0: it tends to 1.1e-4 or
    3e-5 (e = 0.5, steps of 4, 2 and 1 ms).
    """
    if version >= EXACT_DIAGONAL:
        return None
    return (
        f"MuJoCo {formatted(version)} is installed, which gives boxes a coefficient of restitution that is wrong by about 1e-4 at every "
        f"time step; versions from {formatted(EXACT_DIAGONAL)} on have the flag diagexact, which corrects this: update mujoco, or use "
        "profile=default"
    )
