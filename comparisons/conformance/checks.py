"""The table of conformance checks, and `conform`, which runs them in the engine's own process."""

import tempfile
from collections.abc import Callable, Sequence
from typing import cast

from dropspin.comparisons.conformance.batches import check_batches
from dropspin.comparisons.conformance.clock import check_time, check_velocity_lag
from dropspin.comparisons.conformance.compilation import check_compilation
from dropspin.comparisons.conformance.exceptions import described, whole_traceback
from dropspin.comparisons.conformance.isolation import check_files, check_repeats
from dropspin.comparisons.conformance.motion import check_motion
from dropspin.comparisons.conformance.outcomes import CheckFailed, CheckOutcome, CheckResult, Declined
from dropspin.comparisons.conformance.probes import PROBES
from dropspin.comparisons.conformance.protocol import check_builds, check_claims, check_record, check_refusals, check_settings, check_states
from dropspin.comparisons.conformance.symmetries import check_symmetries
from dropspin.comparisons.conformance.waiting import check_waiting
from dropspin.comparisons.engines.base import Diverged, Engine
from dropspin.comparisons.running.engine_process import Failed
from dropspin.comparisons.running.entries import present_entry
from dropspin.comparisons.running.inputs import EngineEntry
from dropspin.comparisons.running.processes import EngineProcesses, ResourceLimits
from dropspin.comparisons.running.verification import BuildMismatch
from dropspin.scenarios.errors import UnknownName

CHECKS: dict[str, Callable[[Engine, str], CheckResult]] = {
    "compilation": check_compilation,
    "claims": check_claims,
    "declines": check_refusals,
    "builds what is meant": check_builds,
    "record and advance": check_record,
    "time": check_time,
    "waiting": check_waiting,
    "velocity lag": check_velocity_lag,
    "repeats": check_repeats,
    "symmetries": check_symmetries,
    "batches": check_batches,
    "states": check_states,
    "settings": check_settings,
    "files": check_files,
    **{probe.name: check_motion for probe in PROBES},
}


def conform(
    engine: Engine | str,
    checks: Sequence[str] = (),
    *,
    resources: ResourceLimits = ResourceLimits(processor_time=60.0),  # noqa: B008 - it is immutable
    on_result: Callable[[CheckResult], None] | None = None,
) -> list[CheckResult]:
    """Check an adapter against the protocol, and its motions against reference motions.

    Args:
        engine: The engine, or its name.
        checks: Names of the checks to run; by default all.
        resources: The processor time [s] and memory [bytes] that each check may use.
        on_result: Called with the outcome of each check as soon as it is known.

    Returns:
        The outcome of each check, in order; an engine that crashes or hangs fails the check alone.

    Raises:
        UnknownName: There is no such check.
        EngineMissing: The engine is not installed.
        EngineBroken: It cannot be imported or constructed.
    """
    for unknown in set(checks) - CHECKS.keys():
        raise UnknownName("check", unknown, CHECKS)
    entry = present_entry(engine)
    found = []
    with tempfile.TemporaryDirectory() as folder, EngineProcesses(resources) as processes:
        for check in checks or CHECKS:
            try:
                found.append(processes.call(entry, _run_check, check, folder))
            except Failed as failure:
                found.append(CheckResult(check, cast(CheckOutcome, failure.verdict), failure.reason))
            if on_result is not None:
                on_result(found[-1])
    return found


def _run_check(entry: EngineEntry, check: str, folder: str) -> CheckResult:
    """Run one check in the engine's process; temporary files go to a folder of the parent, because the engine may end this process."""
    tempfile.tempdir = folder
    return run_check(entry, check)


def run_check(entry: EngineEntry, check: str) -> CheckResult:
    """Run one check in this process."""
    try:
        return CHECKS[check](entry.adapter, check)
    except (CheckFailed, BuildMismatch) as failure:
        return CheckResult(check, "failed", str(failure), whole_traceback(failure) if failure.__cause__ else "")
    except Declined as declined:
        return CheckResult(check, "declined", str(declined))
    except Diverged as diverged:
        return CheckResult(check, "failed", f"the engine diverged: {diverged}")
    except Exception as error:  # an adapter is somebody else's code
        return CheckResult(check, "crashed", described(error, entry.adapter), whole_traceback(error))
