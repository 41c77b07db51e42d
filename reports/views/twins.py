"""The output of `dropspin symmetries twins`: a row for each scene and pair of engines."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from dropspin.comparisons.symmetries.twins import LEVELS, TwinFinding

LEGEND = (
    "Steps are the first after which the motions differ at all, and by more than each size, of angles in radians, and relative to sizes "
    "and speeds; 0 is the start. Rounding explains a difference if the initial state perturbed by 16 eps changes the motion of one of the "
    "two engines as much."
)


def table(findings: Sequence[TwinFinding]) -> list[dict[str, str]]:
    """A row for each finding; – means never, or that there is no such difference."""
    return [_row(one) for one in findings]


def _row(one: TwinFinding) -> dict[str, str]:
    ran = one.status != "not run"
    explained = "yes" if one.unexplained is None else f"not from step {one.unexplained:,} on"
    return {
        "scene": one.scene,
        "engines": f"{one.engine}, {one.twin}",
        "differ from step": _step(one.first),
        "before contact": _number(one.before_contact),
        "after contact": _number(one.after_contact),
        **{f"> {level:g}": _step(one.beyond.get(level)) for level in LEVELS},
        "rounding explains it": explained if ran else "not run",
    }


def _step(step: int | None) -> str:
    return "–" if step is None else f"{step:,}"


def _number(difference: float) -> str:
    if math.isnan(difference):
        return "–"
    return "0" if difference == 0.0 else f"{difference:.1e}"


def sentences(findings: Sequence[TwinFinding]) -> list[str]:
    """What the columns mean, and each reason not to run."""
    reasons = [f"Not run: {one.engine} and {one.twin} in {one.scene}: {one.reason}." for one in findings if one.status == "not run"]
    return [LEGEND, *reasons]


def as_data(findings: Sequence[TwinFinding]) -> list[dict[str, Any]]:
    """Every finding with all digits, for JSON; numbers that are not finite are None."""
    return [{key: _defined(value) for key, value in asdict(one).items()} for one in findings]


def _defined(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value
