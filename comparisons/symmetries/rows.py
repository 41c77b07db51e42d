"""The findings on symmetries and repeated runs as rows of a run's table, so that checks, baselines and reports contain them."""

from collections.abc import Sequence
from dataclasses import replace

import pandas as pd

from dropspin.comparisons.judging.verdicts import BREAKDOWNS
from dropspin.comparisons.measuring.symmetries import BITWISE, kind_of
from dropspin.comparisons.measuring.tolerances import MATTERS
from dropspin.comparisons.results.results import Results
from dropspin.comparisons.results.table import Measurement, as_table
from dropspin.comparisons.symmetries.findings import BY_CHANCE, Finding


def with_symmetries(results: Results, findings: Sequence[Finding], dt: float) -> Results:
    """A run with a row for each finding that compares two motions.

    A repeated run passes if it gives the same bits, a symmetry if rounding explains the difference, or if it is up to 1e-5. A run that
    breaks down, for an engine that ran the scene itself, has a row with this verdict; scenes that are declined have none.

    Args:
        results: The run.
        findings: The findings for its scenes and engines.
        dt: Their time step [s], one of the run.
    """
    ran = results.measurements.groupby(["scene", "engine"]).size().index
    having = [one for one in findings if (one.scene, one.engine) in ran and (one.status != "not run" or one.verdict in BREAKDOWNS)]
    rows = as_table([_row(one, dt) for one in having])
    return replace(results, table=pd.concat([results.table, rows], ignore_index=True))


def _row(found: Finding, dt: float) -> Measurement:
    kind, bound = kind_of(found.symmetry), 0.0 if found.symmetry in BITWISE else MATTERS
    assert kind is not None
    row = Measurement(
        scene=found.scene, engine=found.engine, dt=dt, metric=found.symmetry, unit="1", kind=kind, upper=bound, verdict="passed"
    )
    if found.status == "not run":
        assert found.verdict
        return replace(row, verdict=found.verdict, reason=found.reason)
    fails = found.status == "lost" or (found.status == "nearly kept" and bound == 0.0)
    differ = "the motions differ" if bound == 0.0 else "rounding does not explain the difference"
    reason = {"kept": "", "rounding": "rounding explains the difference"}.get(
        found.status, f"{differ} from step {found.step} on, at {found.time:.4g} s"
    )
    # What perturbations explain is due to chance, and is of another size on another machine.
    tolerance = max(MATTERS, BY_CHANCE * found.difference * (found.status == "rounding"))
    return replace(row, value=found.difference, tolerance=tolerance, verdict="failed" if fails else "passed", reason=reason)
