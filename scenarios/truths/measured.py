"""The motion of a measured toss. It is not an exact solution, but the reference of engines in scenes with a recording.

The motion is known only in the frames of the recording, and errors are measured only there. For replays and plots, it is interpolated
between two frames with constant velocity and angular velocity.

Source: the recording; the estimated state at its start is that of `dropspin.comparisons.logs.flights`.
Valid for: scenes with a recording, until its last frame.
"""

import numpy as np

from dropspin.scenarios.model import Scenario
from dropspin.scenarios.recording import Recording, Toss
from dropspin.scenarios.rotations import length, rotation_vector
from dropspin.scenarios.state import ORIENTATION, POSITION, Array
from dropspin.scenarios.text import counted
from dropspin.scenarios.truths.truth import Truth

MEASURED = "measured"
"""The name of the reference, in the column `truth` of the results."""


def measured(recording: Recording, toss: Toss) -> Truth:
    """A toss of a recording, as a reference."""
    first = toss.starts[0]
    t = np.append(0.0, toss.t)
    positions, quaternions = np.vstack([first[POSITION], toss.position]), np.vstack([first[ORIENTATION], toss.orientation])
    signs = np.cumprod(np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0, -1.0, 1.0))
    quaternions[1:] *= signs[:, np.newaxis]
    poses, steps = np.hstack([positions, quaternions]), np.diff(t)[:, np.newaxis]
    rates = np.hstack([np.diff(positions, axis=0), rotation_vector(quaternions[:-1], quaternions[1:])]) / steps

    def states(times: Array) -> Array:
        pose = np.stack([np.interp(times, t, column) for column in poses.T], axis=1)
        pose[:, ORIENTATION] /= length(pose[:, ORIENTATION])[:, np.newaxis]
        return np.hstack([pose, rates[np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(rates) - 1)]])

    others = len(recording.tosses) - 1
    more = f", the first of {others + 1}" if others else ""
    statement = f"toss {toss.name} of the recording {recording.name}{more}: {counted(len(toss.t), 'frame')} of position and orientation"
    return Truth(MEASURED, statement, states, horizon=float(toss.t[-1]), ends="the record ends", frames=toss.t)


def tosses(scene: Scenario) -> list[tuple[Scenario, Truth]]:
    """For each toss of a scene's recording, the scene with the initial state of the toss, and the toss."""
    assert scene.recording is not None
    return [(scene.starting_at(toss.starts[0]), measured(scene.recording, toss)) for toss in scene.recording.tosses]
