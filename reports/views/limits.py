"""`dropspin limits` in words: the largest time steps, and the range in which each engine is sound."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from comparisons.robustness.scan import AxisScan, ScanPoint
from comparisons.robustness.study import RobustnessStudy

COLUMNS = ("scene", "engine", "axis", "value", "unit", "failure_mode", "criterion", "size", "message")


def rows(found: RobustnessStudy) -> list[dict[str, Any]]:
    """Every point of every scan."""
    return [_row(scan, point) for scan in found.scans for point in scan.points]


def _row(scan: AxisScan, point: ScanPoint) -> dict[str, Any]:
    diagnosis = point.diagnosis
    return {
        "scene": scan.scene.name,
        "engine": scan.engine,
        "axis": scan.axis.name,
        "value": point.value,
        "unit": scan.axis.unit,
        "failure_mode": diagnosis.mode,
        "criterion": diagnosis.criterion,
        "size": diagnosis.size if math.isfinite(diagnosis.size) else None,
        "message": diagnosis.message,
    }


def step_rows(found: Sequence[RobustnessStudy]) -> list[dict[str, str]]:
    """The largest time steps, by scene and engine."""
    table = []
    for one in found:
        spin = float(np.linalg.norm(one.scene.start.angular_velocity)) if one.scene.floor is None else 0.0
        for engine in dict.fromkeys(scan.engine for scan in one.scans if scan.axis.name == "step"):
            accurate, stable = one.largest_steps(engine)
            table.append(
                {"scene": one.scene.name, "engine": engine, "accurate up to": _step(accurate, spin), "stable up to": _step(stable, spin)}
            )
    return table


def _step(dt: float | None, spin: float) -> str:
    if dt is None:
        return "none tested"
    return (f"{1e3 * dt:.3g} ms" if dt < 1.0 else f"{dt:.3g} s") + (f", {spin * dt:.2g} rad" if spin else "")


def range_rows(found: Sequence[RobustnessStudy]) -> list[dict[str, str]]:
    """The range in which each engine is sound along each axis, and the failure modes beyond."""
    return [
        {
            "scene": scan.scene.name,
            "axis": scan.axis.label,
            "engine": scan.engine,
            **_range(scan),
        }
        for one in found
        for scan in one.scans
    ]


def _range(scan: AxisScan) -> dict[str, str]:
    points, sound = scan.points, scan.sound_range
    if sound is None:
        own = scan.at(scan.base)
        return {"sound from": "–", "to": "–", "beyond": f"{own.mode.replace('_', ' ')} at the nominal value: {own.diagnosis.message}"}
    first, last = sound
    outside = [points[number] for number in (first - 1, last + 1) if 0 <= number < len(points)]
    beyond = "; ".join(f"{point.mode.replace('_', ' ')} at {point.value:.4g}" for point in outside)
    return {
        "sound from": f"{points[first].value:.4g}",
        "to": f"{points[last].value:.4g}",
        "beyond": beyond or "not within the range tested",
    }
