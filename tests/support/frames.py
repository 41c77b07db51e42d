"""Motions between the frames of a replay, as the viewer of the page draws them."""

import numpy as np

from dropspin.reports.replay.motions import axis_and_angle
from dropspin.scenarios.rotations import about, conjugate, multiply


def a_quarter_later(motion, frame):
    """The orientation a quarter of the way from a frame to the next: a uniform rotation with the whole turns of the motion."""
    first, after = motion.frames.orientation[frame : frame + 2]
    axis, angle = axis_and_angle(multiply(after, conjugate(first))[None])
    return multiply(about(axis[0], 0.25 * (angle[0] + 2.0 * np.pi * motion.turns[frame])), first)
