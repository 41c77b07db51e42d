"""Sentences on the findings of a recording: the error, its possible causes, how to distinguish the causes, and the remedy."""

import math
from collections.abc import Iterable
from typing import Any

from dropspin.comparisons.logs.log import Cause, Finding
from dropspin.reports.stories.numbers import capitalized

KINDS = {
    "up": "the body does not fall opposite to the upward axis of the header",
    "unit": "gravity is {value:.4g} m/s² instead of {expected:.4g}",
    "scale": "gravity is {value:.4g} m/s² instead of {expected:.4g}",
    "tilt": "the measured gravity is tilted by {degrees:.2g}° from the vertical axis of the header",
    "centre of mass": "the body turns about a point {mm:.2g} mm from the centre of mass in the header",
    "inertia, x": "I_x / I_y is {value:.3g} times the ratio in the header",
    "inertia, z": "I_z / I_y is {value:.3g} times the ratio in the header",
    "drag": "the speed decays at a rate of {value:.2g} 1/s",
    "quaternion": "the body does not turn, or rest, as that of the header does",
    "body axes": "the body does not turn as that of the header does",
    "lengths": "heights at rest differ by {mm:.2g} mm from those of the header's lengths, less their mean difference",
    "rotation": "the orientations differ by {value:.1f} rad from those of a free body",
    "spin": "the recorded angular velocity differs by {percent:.0f} % from that of the quaternions",
    "velocity": "the recorded velocity differs by {percent:.0f} % from that of the positions",
    "floor": "bodies at rest are {mm_off:.4g} mm {side} the floor of the header",
    "below": "toss {toss}: the body is at least {mm:.4g} mm below the floor of the header during all of its flight",
    "no flight": "toss {toss}: no free flight of at least {expected:.0f} frames",
    "frame dropped": "toss {toss}: number of frames missing before frame {frame}: {value:.0f}",
    "bad frame": "toss {toss}, frame {frame}: number of frames that are off the flight that continues after them: {value:.0f}",
    "misread": "toss {toss}, frame {frame}: the orientation is not between those of the frames beside it",
    "late": "toss {toss}: the free flight begins only at frame {frame}",
    "repeated": "toss {toss}, frame {frame}: number of rows that repeat the previous row while the body moves: {value:.0f}",
    "gap": "toss {toss}, frame {frame}: number of frames missing before it, according to the times: {value:.0f}",
    "jitter": "toss {toss}, frame {frame}: the times are uneven: a step takes {ms:.4g} ms, the usual step {expected_ms:.4g} ms",
    "rate": "the times have {value:.5g} frames per second, the header says {expected:.5g}",
}
CAUSES = {
    "order of the quaternions": "the quaternions have another order than the header says",
    "direction of the quaternions": "the quaternions describe the inverse rotation",
    "order and direction of the quaternions": "the quaternions have another order than the header says, and describe the inverse rotation",
    "length unit": "lengths are in {key}",
    "time unit": "times are in {key}",
    "length scale": "lengths are {ratio:.4g} times the true ones",
    "rate": "the rate is {ratio:.4g} times the true one",
    "local gravity": "gravity there differs from that of the header",
    "centre of mass": "the centre of mass is at {key} m",
    "tracked point": "the tracked point is at {key} m",
    "axes": "the axes are tilted",
    "push": "a horizontal force acts on the body",
    "body axes": "its axes are in another order",
    "order of the moments": "its moments of inertia are in another order",
    "other moments": "its moments of inertia are not those in the header",
    "order of the lengths": "its lengths are in another order",
    "spin frame": "it is in the {key} frame",
    "degrees": "it is in degrees per second",
    "sign of the spin": "its sign is reversed",
    "velocity frame": "it is in the body frame",
    "sign of the velocity": "its sign is reversed",
    "unit of the spin": "it is {ratio:.4g} times the true one",
    "unit of the velocity": "it is {ratio:.4g} times the true one",
    "held": "the body is held until then",
    "earlier impact": "the flight follows an impact",
    "times": "the column t is wrong",
    "rate of the header": "the key rate is wrong",
}
"""The words for causes; a cause without words is stated by the keys of its remedy."""
LESS_OR_MORE = {
    "length scale": ("lengths are {percent:.1f} % short", "lengths are {percent:.1f} % long"),
    "rate": ("the rate is {percent:.1f} % low", "the rate is {percent:.1f} % high"),
}
"""The words for lengths and rates that are wrong by at most a half, too small and too large."""
REMEDIES = {
    "below": "correct floor_height, up, tracked_point or the size of the body",
    "rotation": "record more frames per second, or spin the body less: it has to turn by much less than half a turn between two frames",
    "drag": "engines simulate no air; shorter falls or a denser body reduce the effect of drag",
    "no flight": "begin the recording when the body is released",
    "frame dropped": "give the exact time of each frame in a column t",
    "bad frame": "leave out these rows",
    "misread": "leave out this row",
    "repeated": "leave out rows that were not measured",
    "jitter": "give the exact time of each frame; or, if the frames are evenly spaced, leave out the column t and give rate in the header",
    "rate": "multiply the times t by {ratio:.4g}",
    "axes": "align the axes with a tag that lies level on the floor",
    "push": "film without wind and without strings on the body",
    "body axes": "record orientations of axes that the shape has in dropspin: y along a capsule or a cylinder",
    "degrees": "multiply wx, wy, wz by π/180",
    "unit of the spin": "divide wx, wy, wz by {ratio:.4g}",
    "sign of the spin": "change the sign of wx, wy, wz",
    "velocity frame": "rotate vx, vy, vz into the frame of the positions",
    "sign of the velocity": "change the sign of vx, vy, vz",
    "unit of the velocity": "divide vx, vy, vz by {ratio:.4g}",
    "held": "leave out the rows before frame {frame}",
    "earlier impact": "begin the recording when the body is released",
    "times": "leave out the column t",
}
"""The remedies of findings, and of causes that no key of the header removes."""
SHOWN_BY = {
    "unit": "heights at rest are {rests:.4g} times the expected ones",
    "scale": "heights at rest are {rests:.4g} times the expected ones",
    "centre of mass": "heights at rest on opposite faces differ by {rests_mm:.2g} mm",
    "quaternion": "{percent:.0f} % of the tosses end at rest on a face as recorded, {expected_percent:.0f} % with the remedy",
    "lengths": "with the remedy, they differ by {rests_mm:.2g} mm",
}
SEPARATED_BY = {
    "lengths": "let the body rest on all of its faces",
    "quaternion": "look up which quaternions the software writes that made the file",
    "unit": "compare a length in the recording with the true one, and the rate with a clock in the picture",
    "scale": "measure the height at rest on a known face, or the rate of the camera with a clock in the picture",
    "centre of mass": "measure the heights at rest on opposite faces",
}


def sentence(finding: Finding) -> str:
    """The error, its possible causes, the evidence for them or how to distinguish them, and the remedy."""
    values, several = _values(finding), len(finding.causes) > 1
    is_shown = finding.value < finding.expected if finding.kind == "quaternion" else math.isfinite(finding.rests)
    by = SEPARATED_BY if several else SHOWN_BY if is_shown else {}
    parts = {
        ": either " if several else ": ": ", or ".join(filter(None, map(_words, finding.causes))),
        ". To distinguish: " if several else ". Evidence: ": by.get(finding.kind, "").format_map(values),
        ". Remedy: ": remedy(finding),
    }
    rest = "".join(name + text for name, text in parts.items() if text)
    return capitalized(f"{KINDS[finding.kind].format_map(values)}{rest}.")


def remedy(finding: Finding) -> str:
    """What removes a finding, for each of its causes; empty if it needs no remedy."""
    values = _values(finding)
    remedies = [_remedy(cause, values) for cause in finding.causes] or [REMEDIES.get(finding.kind, "")]
    return ", or ".join(filter(None, remedies))


def _values(finding: Finding) -> dict[str, Any]:
    """The columns of a finding, with its numbers in other units."""
    value, expected = finding.value, finding.expected
    numbers: dict[str, Any] = {"mm": 1e3 * value, "ms": 1e3 * value, "expected_ms": 1e3 * expected, "rests_mm": 1e3 * finding.rests}
    numbers |= {"mm_off": abs(1e3 * value), "side": "below" if value < 0.0 else "above"}
    numbers |= {"degrees": math.degrees(value), "percent": 100.0 * value, "expected_percent": 100.0 * expected}
    return vars(finding) | numbers


def corrections(recording: str, findings: Iterable[Finding]) -> list[str]:
    """What to correct in the header before engines are compared with a recording."""
    sentences = [sentence(finding) for finding in findings if any(cause.keys for cause in finding.causes)]
    if sentences:
        sentences.append(
            f"Correct the header first: dropspin log check {recording} writes corrected.toml, with each remedy that is the only one."
        )
    return sentences


def _words(cause: Cause) -> str:
    """A cause in words; empty if its keys state it."""
    text = CAUSES.get(cause.name, "")
    if cause.name in LESS_OR_MORE and abs(cause.share) <= 0.5:
        text = LESS_OR_MORE[cause.name][cause.share > 0.0]
    key = next((_toml(value).strip('"') for value in cause.keys.values()), "")
    return text.format(key=key, ratio=1.0 + cause.share, percent=100.0 * abs(cause.share))


def _remedy(cause: Cause, values: dict[str, Any]) -> str:
    """The keys of the header that remove a cause, or a remedy in words."""
    if not cause.keys:
        return REMEDIES.get(cause.name, "").format_map(values | {"ratio": 1.0 + cause.share})
    names = {key: f"[body] {key.removeprefix('body.')}" if key.startswith("body.") else key for key in cause.keys}
    return " and ".join(f"{name} = {_toml(cause.keys[key])}" for key, name in names.items())


def _toml(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    return f'"{value}"' if isinstance(value, str) else f"{value:.5g}"
