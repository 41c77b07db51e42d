"""The findings on symmetries and repeated runs as rows of a run's table, so that checks, baselines and reports contain them."""

from collections.abc import Sequence
from dataclasses import replace

import pandas as pd

from comparisons.judging.verdicts import Verdict
from comparisons.measuring.tolerances import MATTERS
from comparisons.results.measurement import Kind, Measurement, as_table
from comparisons.results.results import Results
from comparisons.symmetries.study import BITWISE, BY_CHANCE, REPEATS, Finding


def kind_of(symmetry: str) -> Kind:
    """The kind of the rows of a symmetry, or of a repeated run."""
    return "determinism" if symmetry in REPEATS else "symmetry"


def with_symmetries(results: Results, findings: Sequence[Finding], dt: float) -> Results:
    """A run with a row for each finding that compares two motions.

    A repeated run passes if it gives the same bits, a symmetry if rounding explains the difference, or if it is up to 1e-5.

    Args:
        results: The run.
        findings: The findings for its scenes and engines.
        dt: Their time step [s], one of the run.
    """
    rows = as_table([_row(one, dt) for one in findings if one.status != "not run"])
    return replace(results, table=pd.concat([results.table, rows], ignore_index=True))


def _row(found: Finding, dt: float) -> Measurement:
    bound = 0.0 if found.symmetry in BITWISE else MATTERS
    verdict: Verdict = "failed" if found.status == "lost" or (found.status == "nearly kept" and bound == 0.0) else "passed"
    reason = {"kept": "", "rounding": "rounding explains the difference"}.get(
        found.status, f"rounding does not explain the difference from step {found.step} on, at {found.time:.4g} s"
    )
    return Measurement(
        scene=found.scene,
        engine=found.engine,
        dt=dt,
        metric=found.symmetry,
        value=found.difference,
        unit="1",
        kind=kind_of(found.symmetry),
        upper=bound,
        # What perturbations explain is due to chance, and is of another size on another machine.
        tolerance=max(MATTERS, BY_CHANCE * found.difference * (found.status == "rounding")),
        verdict=verdict,
        reason=reason,
    )
