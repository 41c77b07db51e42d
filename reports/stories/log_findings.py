"""Sentences on what is wrong with a recording: what was found, the causes, what shows or separates them, and the remedy."""

import math
from collections.abc import Iterable
from typing import Any

from dropspin.comparisons.logs.log import Cause, Finding
from dropspin.reports.stories.numbers import capitalized

KINDS = {
    "up": "bodies fall along another axis than the header says",
    "unit": "gravity is {value:.4g} m/s² instead of {expected:.4g}",
    "scale": "gravity is {value:.4g} m/s² instead of {expected:.4g}",
    "tilt": "gravity is {degrees:.2g}° from the upward axis",
    "centre of mass": "the tracked point turns about a point {mm:.2g} mm from the centre of mass given",
    "inertia, x": "I_x / I_y is {value:.3g} times that of the header",
    "inertia, z": "I_z / I_y is {value:.3g} times that of the header",
    "drag": "the speed decays at {value:.2g} 1/s",
    "quaternion": "the quaternions are in another order or of the inverse rotation",
    "spin": "the recorded spin differs by {percent:.0f} % from that of the quaternions",
    "no flight": "toss {toss}: no free flight of {expected:.0f} frames",
    "frame dropped": "toss {toss}: {value:.0f} missing before frame {frame}",
    "late": "toss {toss}: its flight begins at frame {frame}",
    "repeated": "toss {toss}, frame {frame}: rows that repeat the one before while the body moves: {value:.0f}",
    "gap": "toss {toss}, frame {frame}: frames that are missing before it, by the times: {value:.0f}",
    "jitter": "toss {toss}, frame {frame}: the times are uneven: a step of {ms:.4g} ms, the usual one is {expected_ms:.4g} ms",
    "rate": "the times have {value:.5g} frames per second, the header has {expected:.5g}",
}
CAUSES = {
    "length unit": "lengths are in {key}",
    "time unit": "times are in {key}",
    "length scale": "lengths are {ratio:.4g} times the true ones",
    "rate": "the rate is {ratio:.4g} times the true one",
    "centre of mass": "the centre of mass is at {key} m",
    "tracked point": "the tracked point is at {key} m",
    "axes": "the axes are tilted",
    "push": "something pushes sideways",
    "spin frame": "it is in the {key} frame",
    "degrees": "it is in degrees per second",
    "sign of the spin": "its sign is the opposite one",
    "held": "it is held until then",
    "earlier impact": "the recording begins after an impact",
    "times": "the column t is wrong",
    "rate of the header": "the key rate is wrong",
}
"""The words for causes; one that only has keys needs none."""
LESS_OR_MORE = {
    "length scale": ("lengths are {percent:.1f} % short", "lengths are {percent:.1f} % long"),
    "rate": ("the rate is {percent:.1f} % low", "the rate is {percent:.1f} % high"),
}
"""The same for shares of up to a half."""
REMEDIES = {
    "drag": "engines have no air; shorter falls or a denser body make its effect small",
    "no flight": "record from the release on",
    "frame dropped": "give the times in a column t",
    "repeated": "leave out rows that were not measured",
    "jitter": "give the exact time of each frame; or, if the frames are evenly spaced, leave out the column t and give rate in the header",
    "rate": "multiply the times t by {ratio:.4g}",
    "axes": "turn the axes by a level tag on the floor",
    "push": "film without wind and strings",
    "degrees": "multiply wx, wy, wz by π/180",
    "sign of the spin": "change the sign of wx, wy, wz",
    "held": "leave out the rows before frame {frame}",
    "earlier impact": "record from the release on",
    "times": "no column t",
}
"""What removes a finding or a cause without keys."""
SHOWN_BY = {
    "scale": "heights at rest are {rests:.4g} of the expected ones",
    "centre of mass": "heights at rest on opposite faces differ by {rests_mm:.2g} mm",
    "quaternion": "{percent:.0f} % of the tosses rest on a face as given, {expected_percent:.0f} % so",
}
SEPARATED_BY = {
    "unit": "the height at rest on a known face, or a length in the record",
    "scale": "a resting height on a known face, or the rate of the camera by a clock in the picture",
    "centre of mass": "heights at rest on opposite faces",
}


def sentence(finding: Finding) -> str:
    """What was found, its causes, what shows or separates them, and the remedy."""
    values, several = _values(finding), len(finding.causes) > 1
    is_shown = math.isfinite(finding.value if finding.kind == "quaternion" else finding.rests)
    by = SEPARATED_BY if several else SHOWN_BY if is_shown else {}
    parts = {
        ": either " if several else ": ": ", or ".join(filter(None, map(_words, finding.causes))),
        ". Separated by: " if several else ". Shown by: ": by.get(finding.kind, "").format_map(values),
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
    numbers = {"mm": 1e3 * value, "ms": 1e3 * value, "expected_ms": 1e3 * expected, "rests_mm": 1e3 * finding.rests}
    numbers |= {"degrees": math.degrees(value), "percent": 100.0 * value, "expected_percent": 100.0 * expected}
    return vars(finding) | numbers


def corrections(recording: str, findings: Iterable[Finding]) -> list[str]:
    """What to correct in the header before engines are compared with a recording."""
    sentences = [sentence(finding) for finding in findings if any(cause.keys for cause in finding.causes)]
    if sentences:
        sentences.append(
            f"Correct the header first: dropspin log check {recording} writes corrected.toml, with each remedy that has no alternative."
        )
    return sentences


def _words(cause: Cause) -> str:
    """A cause in words; empty if its keys state it."""
    text = CAUSES.get(cause.name, "")
    if abs(cause.share) <= 0.5:
        text = LESS_OR_MORE[cause.name][cause.share > 0.0]
    key = next((_toml(value).strip('"') for value in cause.keys.values()), "")
    return text.format(key=key, ratio=1.0 + cause.share, percent=100.0 * abs(cause.share))


def _remedy(cause: Cause, values: dict[str, Any]) -> str:
    """The keys of the header that remove a cause, or what else does."""
    if not cause.keys:
        return REMEDIES.get(cause.name, "").format_map(values | {"ratio": 1.0 + cause.share})
    names = {key: f"[body] {key.removeprefix('body.')}" if key.startswith("body.") else key for key in cause.keys}
    return ", ".join(f"{name} = {_toml(cause.keys[key])}" for key, name in names.items())


def _toml(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    return f'"{value}"' if isinstance(value, str) else f"{value:.5g}"
