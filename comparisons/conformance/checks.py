"""The table of conformance checks, and `conform`, which runs them in the engine's own process."""

import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from typing import cast

from dropspin.comparisons.conformance import impacts, protocol, symmetries, timing
from dropspin.comparisons.conformance.motions import check_motion
from dropspin.comparisons.conformance.outcomes import OUTCOMES, CheckOutcome, CheckResult, described, whole_traceback
from dropspin.comparisons.conformance.probes import PROBES
from dropspin.comparisons.engines.base import Diverged, Engine
from dropspin.comparisons.engines.exceptions import TimedOut
from dropspin.comparisons.running.arguments import EngineEntry, ignore
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.engine_entries import present_entry
from dropspin.comparisons.running.process_limits import ONE_MINUTE, ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.scenarios.errors import verify_known
from dropspin.scenarios.state import Array

CHECKS: dict[str, Callable[[Engine], str]] = {
    "compilation": timing.check_compilation,
    "claims": protocol.check_claims,
    "declines": protocol.check_refusals,
    "builds what is meant": protocol.check_builds,
    "record and advance": protocol.check_record,
    "time": timing.check_time,
    "waiting": timing.check_waiting,
    "velocity lag": timing.check_velocity_lag,
    "repeats": protocol.check_repeats,
    "symmetries": symmetries.check_symmetries,
    "batches": symmetries.check_batches,
    "states": protocol.check_states,
    "settings": protocol.check_settings,
    "files": protocol.check_files,
    "impacts": impacts.check_impacts,
    "later impacts": impacts.check_later_impacts,
    **{probe.name: partial(check_motion, probe=probe) for probe in PROBES},
}
"""By name; each returns what it found, and raises one of `OUTCOMES` otherwise."""

SUSPECT = ("failed", "crashed")
"""Outcomes that state left by other checks may cause."""
MOST_TIMED_OUT = 2
"""Checks that may use up their time before the others are not run: an engine that waits forever would use up that of all of them."""
BETWEEN_PROCESSES = 1e-6
"""Relative difference that rounding may cause between two processes."""
AFTER_SIMILAR = "a scene has another motion after one that differs from it in one quantity than alone: a simulation leaves state behind"
ANOTHER_PROCESS = "the same scene has another motion in another process: the engine is random, or depends on its process"
AFTER_OTHERS = "this check fails after other checks, but not alone: a simulation leaves state behind"


def conform(
    engine: Engine | str,
    checks: Sequence[str] = (),
    *,
    resources: ResourceLimits = ONE_MINUTE,
    on_result: Callable[[CheckResult], None] | None = None,
) -> list[CheckResult]:
    """Check an adapter against the protocol, and its motions against reference motions.

    Args:
        engine: The engine, or its name.
        checks: Names of the checks to run; by default all.
        resources: The processor time [s] and memory [bytes] that each check may use.
        on_result: Called with the outcome of each check as soon as it is known.

    Returns:
        The outcome of each check, in order. If the engine crashes or hangs, only the current check fails; after two checks that use up
        their time, the others of all checks are not run.

    Raises:
        UnknownName: There is no such check.
        EngineMissing: The engine is not installed.
        EngineBroken: The engine cannot be imported or constructed.
    """
    verify_known("check", checks, CHECKS)
    entry, results = present_entry(engine), list[CheckResult]()
    with tempfile.TemporaryDirectory() as folder, EngineProcesses(resources) as processes:
        for check in checks or CHECKS:
            late = [result.check for result in results if result.outcome == "timed_out"][:MOST_TIMED_OUT]
            if len(late) == MOST_TIMED_OUT and not checks:
                result = CheckResult(check, "timed_out", f"not run, because {' and '.join(late)} used up their time; run it with --check")
            else:
                result = _result(processes, entry, check, folder)
            if result.outcome in SUSPECT and results:
                result = _alone(processes, entry, check, folder, result)
            if check == "repeats" and result.outcome == "passed" and (why := _changed_by_similar(processes, entry)):
                result = CheckResult(check, "failed", why)
            results.append(result)
            (on_result or ignore)(result)
    return results


def _result(processes: EngineProcesses, entry: EngineEntry, check: str, folder: str) -> CheckResult:
    result = processes.call(entry, run_check, check, folder)
    return CheckResult(check, cast(CheckOutcome, result.verdict), result.reason) if isinstance(result, Breakdown) else result


def _alone(processes: EngineProcesses, entry: EngineEntry, check: str, folder: str, after: CheckResult) -> CheckResult:
    """The result of a check in a new process, or that state is left if it fails only after others; a random engine may pass once."""
    processes.renew(entry)
    for _ in range(2):
        alone = _result(processes, entry, check, folder)
        if alone.outcome not in ("passed", "noted", "declined"):
            return alone
    return CheckResult(check, "failed", f"{AFTER_OTHERS} ({after.message})")


def _changed_by_similar(processes: EngineProcesses, entry: EngineEntry) -> str:
    """A message if a scene has another motion after one that differs from it in one quantity than as the first in a process, else empty.

    By more than the rounding in which two processes may differ, such as on a GPU; a quantity of another scene has a large effect.
    """

    def states(*which: int) -> list[Array | None] | Breakdown:
        processes.renew(entry)
        return processes.call(entry, protocol.states_of_variants, which)

    def differ(alone: list[Array | None] | Breakdown, after: Array | None) -> bool:
        if isinstance(alone, Breakdown) or alone[0] is None:  # which other checks state
            return False
        return after is None or not (protocol.same(alone[0], after) or protocol.relative_difference(alone[0], after) <= BETWEEN_PROCESSES)

    after = states()
    if isinstance(after, Breakdown):
        return ""
    if differ(states(0), after[0]):
        return ANOTHER_PROCESS
    return AFTER_SIMILAR if any(differ(states(number), after[number]) for number in range(1, len(after))) else ""


def run_check(entry: EngineEntry, check: str, folder: str | None = None) -> CheckResult:
    """Run one check in this process; temporary files go to a folder of the caller, because the engine may end this process."""
    tempfile.tempdir = folder
    try:
        return CheckResult(check, "passed", CHECKS[check](entry.adapter))
    except tuple(OUTCOMES) as ended:
        return CheckResult(check, OUTCOMES[type(ended)], str(ended), whole_traceback(ended) if ended.__cause__ else "")
    except TimedOut as late:
        return CheckResult(check, "timed_out", str(late))
    except Diverged as diverged:
        return CheckResult(check, "failed", f"the engine diverged: {diverged}")
    except Exception as error:  # an adapter is somebody else's code
        if wrong := protocol.wrong_answer(entry.adapter):
            return CheckResult(check, "failed", wrong, whole_traceback(error))
        return CheckResult(check, "crashed", described(error, entry.adapter), whole_traceback(error))
