"""The check of a probe: the engine's motion equals the exact solution; if not, which fault or symptom explains the difference."""

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.conformance.explanations import explain_motion
from dropspin.comparisons.conformance.outcomes import CheckResult, Declined
from dropspin.comparisons.conformance.probes import DT, PROBES, Probe, differences
from dropspin.comparisons.conformance.symptoms import symptoms
from dropspin.comparisons.engines.base import Engine, KnownLimitation
from dropspin.comparisons.running.recording import Breakdown, record, try_record
from dropspin.scenarios import truth_for
from dropspin.scenarios.truths import LAWS, Law

Array = NDArray[np.float64]


def check_motion(engine: Engine, check: str) -> CheckResult:
    """The motion of the probe that the check is named for."""
    probe = next(probe for probe in PROBES if probe.name == check)
    scene = probe.scene
    refusal = engine.refusal(scene)
    if refusal is not None:
        raise Declined(refusal)
    truth = truth_for(scene)
    assert truth is not None
    recording = record(engine, scene, DT, verify=False)
    rows = recording.motion.states
    found, exact = rows[probe.rows], truth(probe.times).states
    if probe.off(found, exact) <= 1.0:
        return CheckResult(check, "passed", _errors(found, exact))
    explaining = [one.message for one in recording.limitations if _explains(one, found, exact, probe)]
    if explaining:
        return CheckResult(check, "noted", "; ".join(explaining))
    law = _own_law(engine, probe, found)
    if law is not None:
        return CheckResult(check, "noted", f"impacts follow the {law} law, as the engine states")
    fault = explain_motion(probe, found, lambda other: _states(engine, other))
    if fault is not None:
        return CheckResult(check, "noted" if fault.is_peculiarity else "failed", fault.message)
    return CheckResult(check, "failed", "; ".join(symptoms(probe, recording.motion)))


def _states(engine: Engine, probe: Probe) -> Array | None:
    """The engine's states of a probe, shape (2, 13); None if it declines the scene or breaks down, which the check of that probe states."""
    recording = try_record(engine, probe.scene, DT, verify=False)
    return None if isinstance(recording, Breakdown) else recording.motion.states[probe.rows]


def _own_law(engine: Engine, probe: Probe, found: Array) -> Law | None:
    """The impact law that an engine names in its discretisation, if its motion follows that law."""
    named = engine.discretisation(probe.scene) or ""
    for law in LAWS:
        truth = truth_for(probe.scene, law) if f"law {law}" in named else None
        if truth is not None and probe.off(found, truth(probe.times).states) <= 1.0:
            return law
    return None


def _explains(limitation: KnownLimitation, found: Array, exact: Array, probe: Probe) -> bool:
    """Whether a known limitation explains the errors of position and attitude, and with them those of the velocities."""
    position, attitude, _, _ = differences(found, exact)
    allowed = [
        max(limitation.explained_errors.get(f"{name}_error", 0.0), own)
        for name, own in zip(("position", "orientation"), probe.allowed, strict=False)
    ]
    return bool(limitation.explained_errors) and bool(position <= allowed[0] and attitude <= allowed[1])


def _errors(found: Array, exact: Array) -> str:
    position, attitude, velocity, spin = differences(found, exact)
    return f"errors: {position:.2g} m, {attitude:.2g} rad, {velocity:.2g} m/s, {spin:.2g} rad/s"
