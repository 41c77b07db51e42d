"""The check of symmetries: peculiarities of an engine that exact solutions may not show."""

from dropspin.comparisons.conformance.outcomes import CheckResult, Declined
from dropspin.comparisons.conformance.probes import DT
from dropspin.comparisons.conformance.short_runs import A_FEW_STEPS, FLIGHTS, accepted_scene
from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.measuring.symmetries import SYMMETRIES
from dropspin.comparisons.running.inputs import EngineEntry
from dropspin.comparisons.running.recording import record
from dropspin.comparisons.symmetries.findings import Finding
from dropspin.comparisons.symmetries.study import findings_of
from dropspin.scenarios.text import counted
from dropspin.scenarios.variations import whole_steps


def check_symmetries(engine: Engine, check: str) -> CheckResult:
    """Scenes seen from elsewhere and in other units have the same motion."""
    found = _found(engine, *FLIGHTS) + _found(engine)
    lost = {one.symmetry: one for one in sorted(found, key=lambda one: one.difference) if one.status == "lost"}
    if lost:
        named = "; ".join(f"{name}: by {one.difference:.2g} from step {one.step} on" for name, one in lost.items())
        return CheckResult(check, "noted", f"the motion differs if the scene is transformed; {named} (dropspin symmetries shows more)")
    compared = {one.symmetry for one in found if one.status != "not run"}
    if not compared:
        raise Declined(f"no symmetry could be compared: {found[0].reason if found else 'the motion is not finite'}")
    scenes = " and ".join(dict.fromkeys(one.scene for one in found))
    return CheckResult(check, "passed", f"{counted(len(compared), 'symmetry is', 'symmetries are')} kept in {scenes}")


def _found(engine: Engine, *preferred: str) -> list[Finding]:
    """The findings in a short run of the first scene that the engine accepts."""
    scene = whole_steps(accepted_scene(engine, *preferred), DT, A_FEW_STEPS)
    record(engine, scene, DT)  # an exception of the adapter ends the check
    return findings_of(EngineEntry(engine.label, engine), scene, DT, SYMMETRIES)[1]
