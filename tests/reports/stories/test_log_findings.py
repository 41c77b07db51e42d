"""Sentences on findings: alternatives only where the recording leaves several causes, and a remedy that can be pasted."""

import math

import pytest

from dropspin.comparisons.logs.log import Cause, Finding
from dropspin.reports.stories.log_findings import sentence

LENGTH = Cause("length scale", -0.0222, {"length_scale": 0.978})
RATE = Cause("rate", -0.0111, {"rate": 149.7})


@pytest.mark.parametrize(
    ("finding", "expected"),
    [
        (
            Finding("scale", 9.594, 9.81, causes=(LENGTH,), rests=0.9785),
            "Gravity is 9.594 m/s² instead of 9.81: lengths are 2.2 % short. Evidence: heights at rest are 0.9785 times the expected "
            "ones. Remedy: length_scale = 0.978.",
        ),
        (
            Finding("scale", 9.594, 9.81, causes=(LENGTH, Cause("rate", -0.0111))),
            "Gravity is 9.594 m/s² instead of 9.81: either lengths are 2.2 % short, or the rate is 1.1 % low. To distinguish: compare "
            "the rate of the camera with a clock in the picture, and the height at rest on a known face with the true one. Remedy: "
            "length_scale = 0.978, or multiply the times t by 0.9889.",
        ),
        (
            Finding("unit", 386.2, 9.81, causes=(Cause("length unit", keys={"length_unit": "inch"}),)),
            'Gravity is 386.2 m/s² instead of 9.81: lengths are in inch. Remedy: length_unit = "inch".',
        ),
        (
            Finding("unit", 39.2, 9.81, causes=(Cause("length scale", 3.0, {"length_scale": 4.0}), Cause("rate", 1.0, {"rate": 74.0}))),
            "Gravity is 39.2 m/s² instead of 9.81: either lengths are 4 times the true ones, or the rate is 2 times the true one. "
            "To distinguish: compare the rate with a clock in the picture, and a length in the recording with the true one. Remedy: "
            "length_scale = 4, or rate = 74.",
        ),
        (
            Finding("quaternion", 0.43, 1.0, causes=(Cause("order of the quaternions", keys={"quaternion": "wxyz"}),)),
            "The body does not turn, or rest, as that of the header does: the quaternions have another order than the header says. "
            'Evidence: 43 % of the tosses end at rest on a face as recorded, 100 % with the remedy. Remedy: quaternion = "wxyz".',
        ),
        (
            Finding("centre of mass", 0.0062, 0.0, causes=(Cause("centre of mass", keys={"body.center_of_mass": [0.0, 0.0, 0.0062]}),)),
            "The body turns about a point 6.2 mm from the centre of mass in the header: the centre of mass is at [0, 0, 0.0062] m. "
            "Remedy: [body] center_of_mass = [0, 0, 0.0062].",
        ),
        (
            Finding("late", 5.0, 0.0, "46", 5, (Cause("held"), Cause("earlier impact"))),
            "Toss 46: the free flight begins only at frame 5: either the body is held until then, or the flight follows an impact. Remedy: "
            "leave out the rows before frame 5, or begin the recording when the body is released.",
        ),
        (Finding("gap", 2.0, 0.0, "{1}", 20), "Toss {1}, frame 20: number of frames missing before it, according to the times: 2."),
        (Finding("tilt", math.radians(2.0), 0.0), "The measured gravity is tilted by 2° from the vertical axis of the header."),
    ],
)
def test_sentence_of_a_finding(finding, expected):
    assert sentence(finding) == expected
