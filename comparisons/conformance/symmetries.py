"""The check of symmetries, and of batches: peculiarities of an engine that exact solutions may not show, and batches that leak."""

from comparisons.conformance.outcomes import CheckFailed, CheckResult
from comparisons.conformance.probes import DT
from comparisons.conformance.short_runs import A_FEW_STEPS, accepted_scene
from comparisons.engines.base import Engine
from comparisons.measuring.symmetries import BATCH, SYMMETRIES
from comparisons.running.inputs import EngineEntry
from comparisons.running.recording import record
from comparisons.symmetries.findings import Finding
from comparisons.symmetries.study import findings_of
from scenarios.transformations import whole_steps


def check_symmetries(engine: Engine, check: str) -> CheckResult:
    """Scenes seen from elsewhere and in other units have the same motion, and a batch gives the motions of single simulations."""
    found = _found(engine, "tumbling", "turning", "falling straight", "coasting") + _found(engine)
    for one in found:
        if one.symmetry == BATCH and one.status not in ("kept", "rounding"):
            why = one.reason or f"it gives other states than single simulations, from step {one.step} on"
            raise CheckFailed(f"a batch of three: {why}")
    lost = {one.symmetry: one for one in sorted(found, key=lambda one: one.difference) if one.status == "lost"}
    if lost:
        named = "; ".join(f"{name}: by {one.difference:.2g} from step {one.step} on" for name, one in lost.items())
        return CheckResult(check, "noted", f"the motion differs if the scene is transformed; {named} (dropspin symmetries shows more)")
    compared = {one.symmetry for one in found if one.status != "not run"} & set(SYMMETRIES)
    scenes = " and ".join(dict.fromkeys(one.scene for one in found))
    same = "motions, to rounding" if engine.compiles else "bits"
    batch = f"a batch gives the same {same}" if _has_batches(engine) else "no batch is tested, because prepare_batch returns None"
    return CheckResult(check, "passed", f"{len(compared)} symmetries are kept in {scenes}; {batch}")


def _has_batches(engine: Engine) -> bool:
    batch = engine.prepare_batch([accepted_scene(engine)] * 3, DT)
    if batch is not None:
        batch.close()
    return batch is not None


def _found(engine: Engine, *preferred: str) -> list[Finding]:
    """The findings in a short run of the first scene that the engine accepts."""
    scene = whole_steps(accepted_scene(engine, *preferred), DT, A_FEW_STEPS)
    record(engine, scene, DT)  # an exception of the adapter ends the check
    return findings_of(EngineEntry(engine.label, engine), scene, DT, (*SYMMETRIES, BATCH))[1]
