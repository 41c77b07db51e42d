"""The check of compilation: what the first simulation of a scene takes longer than the second."""

from dropspin.comparisons.conformance.outcomes import CheckResult
from dropspin.comparisons.conformance.probes import DT
from dropspin.comparisons.conformance.short_runs import A_FEW_STEPS, accepted_scene
from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.running.recording import time_steps
from dropspin.scenarios.text import rounded

MUCH = 10.0
"""Compilation that should be stated [s], because it counts against limits of processor time otherwise."""


def check_compilation(engine: Engine, check: str) -> CheckResult:
    """An engine that compiles for long says so, and compiles a scene once."""
    scene = accepted_scene(engine, "turning", "coasting", "falling straight")
    first, second, other = (time_steps(engine, scene, DT, steps) for steps in (A_FEW_STEPS, A_FEW_STEPS, A_FEW_STEPS + 1))
    later, compiling, again = second.whole, first.whole - second.whole, other.whole - second.whole
    if not engine.compiles:
        if compiling < MUCH:
            return CheckResult(check, "passed", "the engine does not compile for long")
        return CheckResult(check, "noted", f"the first simulation takes {compiling:.2g} s longer than the second; set compiles = True")
    found = f"a scene compiles in {max(compiling, 0.0):.2g} s; a simulation of {A_FEW_STEPS} steps then takes {rounded(1e3 * later, 2)} ms"
    if again > 0.25 * compiling and again > MUCH / 10.0:  # the first simulation may compile for two numbers of steps, 1 and others
        return CheckResult(check, "noted", f"{found}; with another number of steps it compiles again, for {again:.2g} s")
    return CheckResult(check, "passed", found)
