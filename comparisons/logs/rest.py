"""What the frames at rest show: heights on known faces, which give the scale of lengths and where the tracked point is.

    height = s (h - mean_k (R (r_k - p))_y) + R_y · δ,    k the lowest vertices

s is the scale of the recorded lengths, h the height of the floor, r_k the vertices and p the tracked point in the frame of the shape, δ
the error of p.
"""

import math
from typing import NamedTuple

import numpy as np

from dropspin.comparisons.logs.log import Log, Toss
from dropspin.scenarios.bodies.surface import depth_below_centre
from dropspin.scenarios.rotations import length, rotate, rotation_vector, unrotate
from dropspin.scenarios.state import UP, Array

STILL = 0.005
"""Largest movement from some frames at rest to the next ones beside noise, as a share of the body's size, and largest turn [rad]."""
MOST_NOISE = 4.0
"""Multiple of it that the noise of frames at rest may be."""
FEWEST_FRAMES = 5
"""Frames at rest that a toss needs."""
FEWEST_RESTS = 6
"""Rests that the scale and three components of δ need."""
OTHER_FACE = 0.05
"""Difference of the expected heights, as a share of the size of the body, from which on it rests on several faces."""
UNEXPLAINED = 0.3
"""Share of a large range of heights from which on a wrong scale of the lengths does not explain it."""
LEVEL = 0.04
"""Heights of vertices, as a share of the size of the body, that count as equal: a turn of 2 degrees."""


class Rests(NamedTuple):
    """Tosses that end at rest.

    Attributes:
        orientations: At rest, shape (k, 4).
        heights: Of the tracked point in the recording [m], shape (k,).
        expected: The same by the shape and the floor of the header [m], shape (k,).
    """

    orientations: Array
    heights: Array
    expected: Array

    def scale(self) -> tuple[float, float, Array, Array]:
        """The scale and its standard error, δ [m] and its own, shape (3,): NaN along axes of which not both faces were seen."""
        values, errors = np.full(4, np.nan), np.full(4, np.nan)
        if len(self.heights) < FEWEST_RESTS:
            return np.nan, np.nan, values[1:], errors[1:]
        up = unrotate(self.orientations, np.broadcast_to(UP, (len(self.heights), 3)))
        seen = [0, *(axis + 1 for axis in range(3) if up[:, axis].min() < -0.9 and up[:, axis].max() > 0.9)]
        columns = np.column_stack([self.expected, up])[:, seen]
        values[seen] = np.linalg.lstsq(columns, self.heights, rcond=None)[0]
        left = self.heights - columns @ values[seen]
        errors[seen] = np.sqrt(float(left @ left) / (len(left) - len(seen)) * np.diag(np.linalg.inv(columns.T @ columns)))
        return float(values[0]), float(errors[0]), values[1:], errors[1:]

    def stretch(self, size: float) -> tuple[float, float]:
        """Differences of heights between faces over the expected ones, wherever the floor is, and the standard error; NaN of one face.

        `size` is that of the body [m].
        """
        if len(self.heights) < FEWEST_RESTS or np.ptp(self.expected) < OTHER_FACE * size:
            return np.nan, np.nan
        (slope, _), covariance = np.polyfit(self.expected, self.heights, 1, cov=True)
        return float(slope), math.sqrt(covariance[0, 0])

    @property
    def scatter(self) -> float:
        """The standard deviation of the heights from the expected ones [m]; NaN with fewer than `FEWEST_RESTS`."""
        above = self.heights - self.expected
        return float(np.std(above, ddof=1)) if len(above) >= FEWEST_RESTS else np.nan

    def are_apart(self, size: float) -> bool:
        """Whether they are on no common floor, but in a hand or on a table; wrong lengths spread heights as the expected ones.

        `size` is that of the body [m].
        """
        slope, _ = self.stretch(size)
        left = self.heights if math.isnan(slope) else self.heights - slope * self.expected
        if len(left) < FEWEST_RESTS:
            return False
        # Half of them, so that a few that rest on something else do not count.
        spread, unexplained = (float(np.ptp(np.quantile(values, [0.25, 0.75]))) for values in (self.heights - self.expected, left))
        return spread > size and unexplained > UNEXPLAINED * spread

    def above(self) -> tuple[float, float]:
        """The median height of the lowest points above the floor [m], and its standard error; NaN with fewer than `FEWEST_RESTS`."""
        above = self.heights - self.expected
        return (float(np.median(above)), self.scatter / math.sqrt(len(above))) if len(above) >= FEWEST_RESTS else (np.nan, np.nan)


def rests(log: Log) -> Rests:
    """The tosses of a recording whose last frames do not move."""
    body, found = log.header.body, [toss for toss in log.tosses if _is_still(toss, log.header.body.size)]
    orientations = np.array([toss.orientation[-1] for toss in found]).reshape(-1, 4)
    floor = log.header.floor_height
    heights = floor + np.array([toss.position[-FEWEST_FRAMES:, 1].mean() for toss in found])
    offsets = rotate(orientations[:, np.newaxis], body.vertices - log.header.tracked_from_centre)[..., 1]
    lowest = offsets.min(axis=1, keepdims=True)
    # A face that is not quite level in the record rests as the mean of its corners does.
    level = np.mean(offsets, axis=1, where=offsets < lowest + LEVEL * body.size)
    return Rests(orientations, heights, floor + depth_below_centre(orientations, body.semi_axes) - level)


def level_share(log: Log) -> tuple[float, int]:
    """The share of the rests in which at least three vertices are the lowest ones, and how many rests there are; NaN of round bodies."""
    body, orientations = log.header.body, rests(log).orientations
    if body.semi_axes.any() or not len(orientations):
        return np.nan, len(orientations)
    heights = np.sort(rotate(orientations[:, np.newaxis], body.vertices)[..., 1], axis=1)
    return float(np.mean(heights[:, 2] - heights[:, 0] < LEVEL * body.size)), len(orientations)


def _is_still(toss: Toss, size: float) -> bool:
    """Whether the mean pose of the last frames is that of the frames before them, but for noise, which is not large."""
    if len(toss) < 2 * FEWEST_FRAMES:
        return False
    last = slice(-2 * FEWEST_FRAMES, None)
    turns = rotation_vector(np.broadcast_to(toss.orientation[-1], (2 * FEWEST_FRAMES, 4)), toss.orientation[last])
    poses = np.stack([toss.position[last] / size, turns]).reshape(2, 2, FEWEST_FRAMES, 3)
    means = poses.mean(axis=2)
    spread = np.sqrt(np.mean(length(poses - means[:, :, np.newaxis]) ** 2, axis=(1, 2)))
    moved = length(means[:, 1] - means[:, 0])
    # Uniform motion moves the mean by 3.5 times the spread, and noise by 0.6 times.
    return bool((spread < MOST_NOISE * STILL).all() and (moved < STILL + spread).all())
