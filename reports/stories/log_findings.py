"""Sentences on the findings of a recording: the error, its possible causes, how to distinguish the causes, and the remedy."""

import math
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from dropspin.comparisons.logs.log import Cause, Finding
from dropspin.reports.stories.numbers import capitalized

WORDS: dict[str, dict[str, dict[str, str]]] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
KINDS, CAUSES = WORDS["kinds"], WORDS["causes"]
"""The words for each kind of finding, and for each cause; a cause without words is stated by the keys of its remedy."""


def sentence(finding: Finding) -> str:
    """The error, its possible causes, the evidence for them or how to distinguish them, and the remedy."""
    words, values, several = KINDS[finding.kind], _values(finding), len(finding.causes) > 1
    is_shown = finding.value < finding.expected if finding.kind == "quaternion" else math.isfinite(finding.rests)
    by = "distinguish" if several else "evidence" if is_shown else ""
    parts = {
        ": either " if several else ": ": ", or ".join(filter(None, map(_words, finding.causes))),
        ". To distinguish: " if several else ". Evidence: ": words.get(by, "").format_map(values),
        ". Remedy: ": remedy(finding),
    }
    rest = "".join(name + text for name, text in parts.items() if text)
    return capitalized(f"{words['says'].format_map(values)}{rest}.")


def remedy(finding: Finding) -> str:
    """What removes a finding, for each of its causes; empty if it needs no remedy."""
    values = _values(finding)
    remedies = [_remedy(cause, values) for cause in finding.causes] or [KINDS[finding.kind].get("remedy", "")]
    return ", or ".join(filter(None, remedies))


def _values(finding: Finding) -> dict[str, Any]:
    """The columns of a finding, with its numbers in other units."""
    value, expected = finding.value, finding.expected
    numbers: dict[str, Any] = {"mm": 1e3 * value, "ms": 1e3 * value, "expected_ms": 1e3 * expected, "rests_mm": 1e3 * finding.rests}
    numbers |= {"mm_off": abs(1e3 * value), "side": "below" if value < 0.0 else "above"}
    numbers |= {"size": abs(value), "decays": "grows" if value < 0.0 else "decays"}
    numbers |= {"degrees": math.degrees(value), "percent": 100.0 * value, "expected_percent": 100.0 * expected}
    return vars(finding) | numbers


def corrections(recording: str, findings: Iterable[Finding]) -> list[str]:
    """What to correct before engines are compared with a recording: in its header, or in its frames."""
    findings = list(findings)
    sentences = [sentence(finding) for finding in findings if any(cause.keys for cause in finding.causes)]
    if sentences:
        sentences.append(
            f"Correct the header first: dropspin log check {recording} writes corrected.toml, with each remedy that is the only one."
        )
    cut = [finding for finding in findings if finding.kind in ("moved again", "frame dropped", "bad frame", "leap", "mid-air")]
    if cut:
        tosses = len({finding.toss for finding in cut})
        sentences.append(f"Tosses of which a part is used, as frames are of another throw, missing or wrong: {tosses}. {sentence(cut[0])}")
    return sentences


def _words(cause: Cause) -> str:
    """A cause in words; empty if its keys state it."""
    words, says = CAUSES.get(cause.name, {}), "says"
    if "low" in words and abs(cause.share) <= 0.5:
        says = "high" if cause.share > 0.0 else "low"
    key = next((_toml(value).strip('"') for value in cause.keys.values()), "")
    return words.get(says, "").format(key=key, ratio=1.0 + cause.share, percent=100.0 * abs(cause.share))


def _remedy(cause: Cause, values: dict[str, Any]) -> str:
    """The keys of the header that remove a cause, or a remedy in words."""
    if not cause.keys:
        return CAUSES.get(cause.name, {}).get("remedy", "").format_map(values | {"ratio": 1.0 + cause.share})
    names = {key: f"[body] {key.removeprefix('body.')}" if key.startswith("body.") else key for key in cause.keys}
    return " and ".join(f"{name} = {_toml(cause.keys[key])}" for key, name in names.items())


def _toml(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    return f'"{value}"' if isinstance(value, str) else f"{value:.5g}"
