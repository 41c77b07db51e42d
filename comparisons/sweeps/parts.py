"""The parts of a sweep, and how a part is run: in the engines' own processes, so that a job that breaks one costs its own row only."""

import hashlib
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from dropspin.comparisons.engines.base import EngineBroken
from dropspin.comparisons.engines.stand_in import code_of
from dropspin.comparisons.engines.wang import Wang
from dropspin.comparisons.results.provenance import code, provenance, versions
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import AnotherAdapter, Breakdown
from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.sweeps.arrays import run_side_by_side
from dropspin.comparisons.sweeps.jobs import Jobs, Sweep
from dropspin.comparisons.sweeps.outcomes import STANDARD_METRICS, Outcomes, concatenated, not_run, run_scenes, set_breakdown
from dropspin.reference_impl import sources
from dropspin.scenarios.state import STATE_COLUMNS

LARGEST_PART = 4000  # jobs
PART_TIME = 2.0
"""Duration of a part [s]: about the work that a killed sweep loses for each of its workers."""
STEP_TIME, JOB_TIME = (1e-7, 5e-5), (1e-5, 5e-3)
"""Rough costs of a step and of a job [s]: of the reference implementation, of any other engine."""
METRICS_TIME = 0.1
"""Rough cost of added metrics [s], for which a job has an exact solution of its own."""
MEASURING = Path(__file__).parents[1] / "measuring"


@dataclass(frozen=True)
class Work:
    """A sweep with everything that its results depend on.

    Attributes:
        sweep: The sweep.
        resources: What an engine may use for one job.
        versions: The versions of everything that the results depend on.
    """

    sweep: Sweep
    resources: ResourceLimits
    versions: dict[str, str | None]

    @classmethod
    def of(cls, sweep: Sweep, resources: ResourceLimits) -> "Work":
        """With the versions that are installed on this machine, and hashes of the adapters' code."""
        adapters = {f"the adapter of {engine.label}": code_of(engine) for engine in sweep.engines if type(engine) is not Wang}
        return cls(sweep, resources, installed_versions() | adapters)

    @cached_property
    def identity(self) -> str:
        """A short hash of the sweep and of the versions; parts with another identity do not belong to its table."""
        content = json.dumps([self.asked, self.versions, self.part_size], sort_keys=True, default=str)
        return hashlib.sha256(content.encode()).hexdigest()[:12]

    @property
    def asked(self) -> dict[str, Any]:
        """The sweep and the time limit, which decides which jobs time out, as a mapping for JSON."""
        sweep = self.sweep
        return {
            "scenes": {
                scene.name: scene.model_dump(mode="json", exclude={"name", "origin"}, exclude_defaults=True) for scene in sweep.scenes
            },
            "engines": [engine.label for engine in sweep.engines],
            "dts": list(sweep.dts),
            "seeds": None if sweep.seeds is None else repr(sweep.seeds),
            "axes": [{"kind": type(axis).__name__.lower(), **vars(axis)} for axis in sweep.axes],
            "draws": sweep.draws,
            "metrics": list(sweep.metrics),
            "time_limit": self.resources.processor_time,
        }

    @property
    def description(self) -> dict[str, Any]:
        """The content of `sweep.json`."""
        return {"jobs": self.sweep.size, "part_size": self.part_size, "provenance": provenance(self.asked) | {"versions": self.versions}}

    @cached_property
    def part_size(self) -> int:
        """The number of jobs of a part: as many as take about `PART_TIME`, by the estimated cost of the most expensive job."""
        swept = {axis.name: axis.values for axis in self.sweep.axes}
        longest = max(swept.get("duration", [scene.duration for scene in self.sweep.scenes]))
        steps = longest / min([*self.sweep.dts, *swept.get("dt", [])])
        slow, has_metrics = any(type(engine) is not Wang for engine in self.sweep.engines), bool(self.sweep.metrics)
        job_time = JOB_TIME[slow or has_metrics] + STEP_TIME[slow or has_metrics] * steps + METRICS_TIME * has_metrics
        return int(min(max(PART_TIME / job_time, 1), LARGEST_PART))

    @property
    def parts(self) -> Iterator[range]:
        """The numbers of the jobs of each part, in order."""
        return (range(first, min(first + self.part_size, self.sweep.size)) for first in range(0, self.sweep.size, self.part_size))

    def table(self, part: range, processes: EngineProcesses, verify_running: Callable[[], None] = lambda: None) -> pa.Table:
        """Run a part.

        Args:
            part: The numbers of its jobs.
            processes: The engines' processes.
            verify_running: Called before each job or group of jobs, and after one that failed; raises if the worker of a cluster closes.
        """
        groups = self.sweep.jobs(part.start, part.stop)
        return pa.concat_tables([_as_table(self.sweep, jobs, self._outcomes(jobs, processes, verify_running)) for jobs in groups])

    def _outcomes(self, jobs: Jobs, processes: EngineProcesses, verify_running: Callable[[], None]) -> Outcomes:
        """Run jobs of one engine in its process; if they break it, repeat them one by one, to find the job that does."""
        entry = EngineEntry(jobs.engine.label, jobs.engine)
        first, last = int(jobs.numbers[0]), int(jobs.numbers[-1]) + 1

        def called(first: int, last: int) -> Outcomes | Breakdown:
            verify_running()
            result = processes.call(entry, _run_in_process, self.sweep, first, last)
            if isinstance(result, AnotherAdapter):  # not what these jobs do: their results would be kept for good
                raise EngineBroken(f"{entry.label} cannot be used any more: {result.reason.removesuffix('.')}.")
            return result

        def outcome(number: int) -> Outcomes:
            result = called(number, number + 1)
            if not isinstance(result, Breakdown):
                return result
            verify_running()  # a process that ended with the sweep has not failed
            broken = not_run(1, self.sweep.metrics)
            set_breakdown(broken[0], result)
            return broken

        outcomes = called(first, last)
        if isinstance(outcomes, Breakdown):
            return concatenated([outcome(number) for number in range(first, last)])
        # An exception may be due to earlier jobs, for example to a leak. It counts if the job raises it in a new process as well.
        for index in np.flatnonzero(outcomes.verdict == "crashed").tolist():
            processes.renew(entry)
            outcomes[index] = outcome(first + index)[0]
        return outcomes


def installed_versions() -> dict[str, str | None]:
    """The versions of everything that results depend on; for the reference implementation and the metrics, hashes of their code."""
    return versions() | {"reference_impl": sources.HASH[:12], "metrics": code(MEASURING)}


def _run_in_process(entry: EngineEntry, sweep: Sweep, first: int, last: int) -> Outcomes:
    """In the engine's process, where it is in place of its stand-in."""
    engines = tuple(entry.adapter if engine.label == entry.label else engine for engine in sweep.engines)
    return run_jobs(replace(sweep, engines=engines), first, last)


def run_jobs(sweep: Sweep, first: int, last: int) -> Outcomes:
    """Run the jobs from number `first` up to, not including, `last`; the result of each is independent of the others.

    If an engine compiles, rounding may depend on how many of the jobs it simulates in a batch.
    """
    parts = []
    for jobs in sweep.jobs(first, last):
        is_reference = type(jobs.engine) is Wang  # a subclass may simulate otherwise
        parts.append(run_side_by_side(jobs, sweep.metrics) if is_reference else not_run(len(jobs), sweep.metrics))
        run_scenes(jobs, parts[-1], sweep.metrics, in_batches=jobs.engine.steps_batches and not is_reference)
    return concatenated(parts)


def _as_table(sweep: Sweep, jobs: Jobs, outcomes: Outcomes) -> pa.Table:
    """One row for each job."""
    identified = {"job": jobs.numbers, "key": jobs.hashes(), "scene": [jobs.scene.name] * len(jobs), "engine": jobs.labels()}
    columns: dict[str, Any] = identified | {"dt": jobs.dts, "seed": pa.array(jobs.starts(), pa.int64())}
    for axis in sweep.axes:
        if axis.name != "dt":
            values = jobs.values[axis.name]
            columns[axis.name] = values if axis.is_numeric else [value if isinstance(value, str) else json.dumps(value) for value in values]
    columns |= {"verdict": outcomes.verdict, "reason": outcomes.reason}
    for names, array in ((STATE_COLUMNS, outcomes.state), (STANDARD_METRICS, outcomes.standard_metrics), (sweep.metrics, outcomes.metrics)):
        columns |= dict(zip(names, array.T, strict=True))
    return pa.table(columns | {"steps": outcomes.steps, "time_per_step": outcomes.time_per_step})
