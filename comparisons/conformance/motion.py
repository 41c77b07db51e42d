"""The check of a probe: the engine's motion equals the exact solution; if not, which fault or symptom explains the difference."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from comparisons.conformance.explanations import explain_motion
from comparisons.conformance.outcomes import CheckResult, Declined
from comparisons.conformance.probes import DT, PROBES, Probe, differences
from comparisons.engines.base import Engine, KnownLimitation
from comparisons.running.recording import record
from scenarios import truth_for
from scenarios.state import RATES, SPIN, VELOCITY
from scenarios.truths import LAWS, Law

Array = NDArray[np.float64]

HEIGHT, UPWARD = 1, 8
"""The vertical position and velocity in a state."""


def check_motion(engine: Engine, check: str) -> CheckResult:
    """The motion of the probe that the check is named for."""
    probe = next(probe for probe in PROBES if probe.name == check)
    scene = probe.scene
    refusal = engine.declines(scene)
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
    fault = explain_motion(probe, found)
    if fault is not None:
        return CheckResult(check, "noted" if fault.is_peculiarity else "failed", fault.message)
    return CheckResult(check, "failed", "; ".join([*_symptoms(probe, rows, exact), _errors(found, exact)]))


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
    if not np.isfinite(found).all():
        return "the state is not finite"
    position, attitude, velocity, spin = differences(found, exact)
    return f"errors: {position:.2g} m, {attitude:.2g} rad, {velocity:.2g} m/s, {spin:.2g} rad/s"


def _symptoms(probe: Probe, rows: Array, exact: Array) -> Iterator[str]:
    """Symptoms of a motion that no known fault explains."""
    scene, end = probe.scene, rows[-1]
    if not np.any(end[RATES]) and np.any(exact[-1, RATES]):
        yield "the body stops: the engine puts it to sleep"
        return
    if scene.floor is None and scene.gravity is None:
        for what, unit, part in (("speed", "m/s", VELOCITY), ("angular velocity", "rad/s", SPIN)):
            final, expected = (float(np.linalg.norm(state[part])) for state in (end, exact[-1]))
            if abs(final - expected) > 1e-3 * expected:
                too_fast, too_slow = "", "damping or a clamp that the scene does not have: "
                if scene.damping is not None:
                    too_fast, too_slow = "damping is missing or too weak: ", "damping is too strong, or a clamp: "
                cause = too_slow if final < expected else too_fast
                yield f"{cause}the final {what} is {final:.4g} {unit}, expected {expected:.4g}"
    rises = np.flatnonzero((rows[1:, UPWARD] > 0.0) & (rows[:-1, UPWARD] <= 0.0))
    truth = truth_for(scene)
    assert truth is not None
    if scene.floor is not None and truth.events and len(rises):
        first = int(rises[0])
        rebound = float(rows[first:, UPWARD].max() / -rows[: first + 1, UPWARD].min())
        yield f"the rebound begins at a height of {rows[first, HEIGHT]:.4g} m, expected {truth.events[0].before[HEIGHT]:.4g} m"
        yield f"the rebound speed is {rebound:.3g} of the impact speed; the scene's restitution is {scene.floor.restitution:g}"
