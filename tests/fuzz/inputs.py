"""Sound inputs, which the tests change."""

from typing import Any

import tomlkit
from support.adapters import DRIFTING

from dropspin.scenarios.loading import CATALOGUE, names

CATALOGUE_FILES = {name: (CATALOGUE / f"{name}.toml").read_bytes() for name in names()}
BALL: dict[str, Any] = {
    "duration": 0.2,
    "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0},
    "floor": {"restitution": 0.5, "friction": 0.3},
    "gravity": {"acceleration": [0.0, -9.81, 0.0]},
    "start": {"position": [0.0, 0.15, 0.0], "velocity": [0.1, 0.0, 0.0], "angular_velocity": [1.0, 2.0, 3.0]},
    "damping": {"linear": 0.0, "angular": 0.0},
    "expect": [{"metric": "penetration", "dt": [0.01], "below": 0.1, "reason": "r"}],
}
ENSEMBLE = {"ensemble": {"size": 3, "seed": 1, "turn": 0.5, "velocity": [0.1, 0.1, 0.1]}}
SPEC = {
    "scenes": ["ball.toml"],
    "engines": ["wang"],
    "dts": [0.05],
    "grid": {"body.mass": [1.0, 2.0], "floor.restitution": {"from": 0.0, "to": 1.0, "count": 2}},
}
RANDOM = {key: value for key, value in SPEC.items() if key != "grid"} | {
    "random": {"count": 2, "seed": 1, "body.mass": {"from": 1.0, "to": 2.0, "log": True}, "start.velocity[0]": {"from": 0.0, "to": 1.0}}
}
RUN = ("run", "ball.toml", "-e", "wang", "-e", "mujoco", "--dt", "0.02", "--dt", "0.01", "--dt", "0.005")
ACCEPT = ("accept", "run", "--reason", "measured", "--known-failures")
ADAPTER = (
    "import os, sys, signal, subprocess, threading, types\nimport numpy as np\n"
    "from dropspin import AsBuilt, BatchSimulation, KnownLimitation, NumericOption\n"
    f"{DRIFTING}"
    '    choices = {"method": ("one", "two")}\n'
    '    numbers = {"tolerance": NumericOption(0.1, 0.0, 1.0)}\n'
)
"""An engine whose answers the tests change."""
DRIFT = {"duration": 0.2, "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0}, "start": {"velocity": [1.0, 0.0, 0.0]}}


def toml(content: Any) -> bytes:
    """The content of a TOML file; of a content that TOML cannot have, one that is not TOML."""
    try:
        return tomlkit.dumps(content).encode("utf-8", "surrogatepass")
    except (ValueError, TypeError, tomlkit.exceptions.TOMLKitError):
        return repr(content).encode("utf-8", "surrogatepass")


BALL_FILE, SPEC_FILE, DRIFT_FILE = (toml(content).decode() for content in (BALL, SPEC, DRIFT))
