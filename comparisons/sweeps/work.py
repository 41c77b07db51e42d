"""The parts of a sweep, and how a part is run: in the engines' own processes, so that a job that breaks one costs its own row only."""

import hashlib
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa

from dropspin.comparisons.engines.stand_in import code_of
from dropspin.comparisons.engines.wang import Wang
from dropspin.comparisons.results.provenance import code, provenance, versions
from dropspin.comparisons.running.engine_process import Failed
from dropspin.comparisons.running.inputs import EngineEntry
from dropspin.comparisons.running.processes import EngineProcesses, ResourceLimits
from dropspin.comparisons.running.recording import Breakdown
from dropspin.comparisons.sweeps.dispatch import run_jobs
from dropspin.comparisons.sweeps.folder import PARTS_PER_FOLDER, SweepFolder
from dropspin.comparisons.sweeps.jobs import Jobs, Sweep
from dropspin.comparisons.sweeps.outcomes import STANDARD_METRICS, STATE_COLUMNS, Outcomes, concatenated
from dropspin.reference_impl import sources

LARGEST_PART = 4000  # jobs
PART_TIME = 2.0
"""Duration of a part [s]: about the work that a killed sweep loses for each of its workers."""
STEP_TIME, JOB_TIME = (1e-7, 5e-5), (1e-5, 5e-3)
"""Rough costs of a step and of a job [s]: of the reference implementation, of any other engine."""
MEASURING = Path(__file__).parents[1] / "measuring"


class Part(NamedTuple):
    """The jobs from number `first` up to, not including, `last`."""

    number: int
    first: int
    last: int


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
        adapters = {f"the adapter of {engine.label}": code_of(engine) for engine in sweep.engines if not isinstance(engine, Wang)}
        return cls(sweep, resources, installed_versions() | adapters)

    @cached_property
    def identity(self) -> str:
        """A short hash of the sweep and of the versions; parts with another identity do not belong to its table."""
        content = json.dumps([self.asked, self.versions, self.part_size], sort_keys=True, default=str)
        return hashlib.sha256(content.encode()).hexdigest()[:12]

    @property
    def asked(self) -> dict[str, Any]:
        """The sweep as a mapping for JSON."""
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
        }

    @property
    def description(self) -> dict[str, Any]:
        """The content of `sweep.json`."""
        return {"jobs": self.sweep.size, "part_size": self.part_size, "provenance": provenance(self.asked) | {"versions": self.versions}}

    @cached_property
    def part_size(self) -> int:
        """The number of jobs of a part: as many as take about `PART_TIME`, by the estimated cost of the most expensive job."""
        axes = [axis for axis in self.sweep.axes if axis.name in ("dt", "duration")]
        swept = {axis.name: [float(value) for value in axis.representative_values] for axis in axes}
        longest = max(swept.get("duration", [scene.duration for scene in self.sweep.scenes]))
        steps = longest / min([*self.sweep.dts, *swept.get("dt", [])])
        slow = any(not isinstance(engine, Wang) for engine in self.sweep.engines) or bool(self.sweep.metrics)
        return int(min(max(PART_TIME / (JOB_TIME[slow] + STEP_TIME[slow] * steps), 1), LARGEST_PART))

    @property
    def parts(self) -> Iterator[Part]:
        """All parts, in order."""
        for number, first in enumerate(range(0, self.sweep.size, self.part_size)):
            yield Part(number, first, min(first + self.part_size, self.sweep.size))

    def missing(self, folder: SweepFolder) -> Iterator[Part]:
        """The parts that a folder does not have."""
        present: dict[int, str] = {}
        for part in self.parts:
            if part.number % PARTS_PER_FOLDER == 0:
                present = folder.parts(part.number // PARTS_PER_FOLDER)
            if part.first not in present:
                yield part

    def table(self, part: Part, processes: EngineProcesses, verify_running: Callable[[], None] = lambda: None) -> pa.Table:
        """Run a part.

        Args:
            part: The part.
            processes: The engines' processes.
            verify_running: Called before each job or group of jobs, and after one that failed; raises if the sweep has ended.
        """
        groups = self.sweep.jobs(part.first, part.last)
        return _as_table(self.sweep, groups, concatenated([self._outcomes(jobs, processes, verify_running) for jobs in groups]))

    def _outcomes(self, jobs: Jobs, processes: EngineProcesses, verify_running: Callable[[], None]) -> Outcomes:
        """Run jobs of one engine in its process; if they break it, repeat them one by one, to find the job that does."""
        entry = EngineEntry(jobs.engine.label, jobs.engine)
        first, last = int(jobs.numbers[0]), int(jobs.numbers[-1]) + 1
        verify_running()
        try:
            found = processes.call(entry, _run_in_process, self.sweep, first, last)
        except Failed:
            return concatenated([self._outcome(entry, number, processes, verify_running) for number in range(first, last)])
        if not (found.verdict == "crashed").any():
            return found
        # An exception may be due to earlier jobs, for example to a leak. It counts if the job raises it in a new process as well.
        repeated = []
        for index, number in enumerate(range(first, last)):
            if found.verdict[index] == "crashed":
                processes.renew(entry)
                repeated.append(self._outcome(entry, number, processes, verify_running))
            else:
                repeated.append(found[index : index + 1])
        return concatenated(repeated)

    def _outcome(self, entry: EngineEntry, number: int, processes: EngineProcesses, verify_running: Callable[[], None]) -> Outcomes:
        """Run one job; if it breaks its engine, record that."""
        verify_running()
        try:
            return processes.call(entry, _run_in_process, self.sweep, number, number + 1)
        except Failed as failure:
            verify_running()  # a process that ended with the sweep has not failed
            outcomes = Outcomes.empty(1, len(self.sweep.metrics))
            outcomes.set_breakdown(0, Breakdown(failure.verdict, failure.reason))
            return outcomes


def installed_versions() -> dict[str, str | None]:
    """The versions of everything that results depend on; for the reference implementation and the metrics, hashes of their code."""
    return versions() | {"reference_impl": sources.HASH[:12], "metrics": code(MEASURING)}


def _run_in_process(entry: EngineEntry, sweep: Sweep, first: int, last: int) -> Outcomes:
    """In the engine's process, where it is in place of its stand-in."""
    engines = tuple(entry.engine if one.label == entry.label and entry.engine is not None else one for one in sweep.engines)
    return run_jobs(replace(sweep, engines=engines), first, last)


def _as_table(sweep: Sweep, groups: list[Jobs], found: Outcomes) -> pa.Table:
    """One row for each job."""
    columns: dict[str, Any] = {
        "job": pa.array([number for jobs in groups for number in jobs.numbers.tolist()], pa.int64()),
        "key": pa.array([key for jobs in groups for key in jobs.hashes()], pa.string()),
        "scene": pa.array([jobs.scene.name for jobs in groups for _ in range(len(jobs))], pa.string()),
        "engine": pa.array([label for jobs in groups for label in jobs.labels()], pa.string()),
        "dt": pa.array([dt for jobs in groups for dt in jobs.dts.tolist()], pa.float64()),
        "seed": pa.array([seed for jobs in groups for seed in jobs.starts()], pa.int64()),
    }
    for axis in sweep.axes:
        if axis.name != "dt":
            values = [value for jobs in groups for value in jobs.values[axis.name].tolist()]
            columns[axis.name] = pa.array(values, pa.float64()) if axis.is_numeric else pa.array(map(_as_text, values), pa.string())
    columns["verdict"], columns["reason"] = (pa.array(texts, pa.string()) for texts in (found.verdict, found.reason))
    numbers = ((STATE_COLUMNS, found.state), (STANDARD_METRICS, found.standard_metrics), (sweep.metrics, found.metrics))
    for names, array in numbers:
        columns.update({name: pa.array(column, pa.float64()) for name, column in zip(names, array.T, strict=True)})
    columns["steps"] = pa.array(found.steps, pa.int64())
    columns["time_per_step"] = pa.array(found.time_per_step, pa.float64())
    return pa.table(columns)


def _as_text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)
