"""The output of `dropspin symmetries`: the worst finding for each engine and symmetry, and a sentence on each symmetry that is lost."""

import math
from collections.abc import Sequence
from itertools import groupby
from typing import Any

from dropspin.comparisons.measuring.symmetries import NAMES
from dropspin.comparisons.symmetries.findings import STATUSES, Finding, Status

COLUMNS = ("scene", "engine", "symmetry", "status", "difference", "step", "time", "reason")
MARKS: dict[Status, str] = {"kept": "✓", "rounding": "≈", "nearly kept": "~", "lost": "✗", "not run": "–"}
MEANINGS: dict[Status, str] = {
    "kept": "kept up to rounding",
    "rounding": "above 1e-5, but rounding explains it",
    "nearly kept": "up to 1e-5, but more than rounding explains",
    "lost": "lost",
    "not run": "not run",
}


def rows(findings: Sequence[Finding]) -> list[dict[str, Any]]:
    """Every finding, with all digits; numbers that are not finite are None."""
    return [{name: None if _is_undefined(value := getattr(one, name)) else value for name in COLUMNS} for one in findings]


def _is_undefined(value: object) -> bool:
    return isinstance(value, float) and not math.isfinite(value)


def worst_rows(findings: Sequence[Finding]) -> list[dict[str, str]]:
    """The worst finding of all scenes for each symmetry, with a column for each engine."""
    engines = dict.fromkeys(one.engine for one in findings)
    found = {one.symmetry for one in findings}
    named = [name for name in dict.fromkeys([*NAMES, *(one.symmetry for one in findings)]) if name in found]
    return [{"the scene": name, **{engine: _cell(_of(findings, engine, name)) for engine in engines}} for name in named]


def _of(findings: Sequence[Finding], engine: str, symmetry: str) -> list[Finding]:
    """The findings for an engine and a symmetry, the worst first; those that were not run come last."""
    mine = [one for one in findings if (one.engine, one.symmetry) == (engine, symmetry)]
    return sorted(mine, key=lambda one: (one.status != "not run", STATUSES.index(one.status), one.difference), reverse=True)


def _cell(findings: Sequence[Finding]) -> str:
    if not findings or findings[0].status == "not run":
        return MARKS["not run"]
    return f"{MARKS[findings[0].status]} {_number(findings[0].difference)}"


def _number(difference: float) -> str:
    return "0" if difference == 0.0 else f"{difference:.0e}"


def worst_lost(findings: Sequence[Finding]) -> list[Finding]:
    """For each engine that loses a symmetry, the finding with the largest difference."""
    lost = sorted((one for one in findings if one.motions is not None), key=lambda one: -one.difference)
    return [next(one for one in lost if one.engine == engine) for engine in dict.fromkeys(one.engine for one in lost)]


def legend(findings: Sequence[Finding]) -> str:
    """The meaning of the numbers, and of each mark that occurs."""
    marks = ", ".join(f"{MARKS[status]} {MEANINGS[status]}" for status in STATUSES if any(one.status == status for one in findings))
    return f"Each number is the largest difference of two motions of any scene, in radians or relative to sizes and speeds. {marks}."


def sentences(findings: Sequence[Finding]) -> list[str]:
    """A sentence for each symmetry that an engine does not keep, the largest differences first, and one for each reason not to run."""
    broken = [one for one in findings if one.status in ("lost", "nearly kept")]
    pairs = list(dict.fromkeys((one.engine, one.symmetry) for one in broken))
    said = [_of(broken, engine, symmetry) for engine, symmetry in pairs]
    said.sort(key=lambda some: (list(dict.fromkeys(one.engine for one in findings)).index(some[0].engine), -some[0].difference))
    return [*map(_broken, said), *_not_run(findings)]


def _broken(findings: Sequence[Finding]) -> str:
    worst, others = findings[0], findings[1:]
    more = f"; in {len(others)} other scene{'s' if len(others) > 1 else ''} too" if others else ""
    since = f"from step {worst.step} on (t = {worst.time:.4g} s)"
    size = f"{worst.difference:.2g}" if math.isfinite(worst.difference) else "infinite"
    return f"{worst.engine}, {worst.symmetry}: another motion in {worst.scene}, {since}; the largest difference is {size}{more}."


def _not_run(findings: Sequence[Finding]) -> list[str]:
    """The engines, symmetries and scenes that were not run, by reason."""
    left_out = sorted((one for one in findings if one.status == "not run"), key=lambda one: (one.engine, one.reason))
    sentences = []
    for (engine, reason), group in groupby(left_out, key=lambda one: (one.engine, one.reason)):
        some = list(group)
        scenes = ", ".join(dict.fromkeys(one.scene for one in some))
        names = dict.fromkeys(one.symmetry for one in some)
        ways = f" ({', '.join(names)})" if len(names) < len(NAMES) // 2 else ""
        options = " (options --time-limit and --dt)" if some[0].verdict == "timed_out" else ""
        sentences.append(f"Not run: {engine} in {scenes}{ways}: {reason.removesuffix('.')}{options}.")
    return sentences
