"""A sweep cut into parts, and how a part is done: by the engines' own processes, a job that breaks one costing its own row."""

import hashlib
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import pyarrow as pa

from comparisons.engines.document import Document
from comparisons.results.provenance import provenance, versions
from comparisons.running.processes import EngineProcesses, Failed, ResourceLimits
from comparisons.running.recording import Breakdown, EngineEntry
from comparisons.sweeps.jobs import Jobs, Sweep
from comparisons.sweeps.measuring import measured
from comparisons.sweeps.outcomes import STATE, Outcomes, joined
from comparisons.sweeps.parts import TOGETHER, Folder
from reference_impl import sources
from reference_impl.summary import FIGURES

LARGEST_PART = 4000  # jobs
PART_TIME = 2.0  # s; about what a sweep that is killed loses for each of its workers
STEP_TIME, JOB_TIME = (1e-7, 5e-5), (1e-5, 5e-3)
"""Rough costs of a step and of a job [s]: of the reference implementation, of any other engine."""


class Part(NamedTuple):
    """Jobs from number `first` up to, not including, `last`."""

    number: int
    first: int
    last: int


@dataclass(frozen=True)
class Work:
    """A sweep as it is carried out.

    Attributes:
        sweep: What is asked for.
        resources: What an engine may use for one job.
        versions: Of everything that the figures depend on.
    """

    sweep: Sweep
    resources: ResourceLimits
    versions: dict[str, str | None]

    @classmethod
    def of(cls, sweep: Sweep, resources: ResourceLimits) -> "Work":
        """With the versions that are installed here."""
        return cls(sweep, resources, versions_here())

    @cached_property
    def identity(self) -> str:
        """A short hash of the sweep and of the versions: parts with another one belong to another table."""
        told = json.dumps([self.asked, self.versions, self.part_size], sort_keys=True, default=str)
        return hashlib.sha256(told.encode()).hexdigest()[:12]

    @property
    def asked(self) -> dict[str, Any]:
        """The sweep in words and numbers."""
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
    def about(self) -> dict[str, Any]:
        """What `sweep.json` says."""
        return {"jobs": self.sweep.size, "part_size": self.part_size, "provenance": provenance(self.asked) | {"versions": self.versions}}

    @cached_property
    def part_size(self) -> int:
        """How many jobs make a part: as many as take about two seconds, by what the most expensive of them may take."""
        others = [axis for axis in self.sweep.axes if axis.name in ("dt", "duration")]
        ends = {axis.name: [float(value) for value in axis.extremes] for axis in others}
        longest = max([scene.duration for scene in self.sweep.scenes] if "duration" not in ends else ends["duration"])
        steps = longest / min([*self.sweep.dts, *ends.get("dt", [])])
        slow = any(not isinstance(engine, Document) for engine in self.sweep.engines) or bool(self.sweep.metrics)
        return int(min(max(PART_TIME / (JOB_TIME[slow] + STEP_TIME[slow] * steps), 1), LARGEST_PART))

    @property
    def parts(self) -> Iterator[Part]:
        """All parts, in order."""
        for number, first in enumerate(range(0, self.sweep.size, self.part_size)):
            yield Part(number, first, min(first + self.part_size, self.sweep.size))

    def missing(self, folder: Folder) -> Iterator[Part]:
        """The parts that a folder has not."""
        present: dict[int, str] = {}
        for part in self.parts:
            if part.number % TOGETHER == 0:
                present = folder.listed(part.number // TOGETHER)
            if part.first not in present:
                yield part

    def table(self, part: Part, processes: EngineProcesses, go_on: Callable[[], None] = lambda: None) -> pa.Table:
        """Do a part.

        Args:
            part: Which.
            processes: The engines' processes.
            go_on: Called before each piece of work, and after one that failed; raises if the sweep is over.
        """
        lots = self.sweep.jobs(part.first, part.last)
        return _as_table(self.sweep, lots, joined([self._outcomes(jobs, processes, go_on) for jobs in lots]))

    def _outcomes(self, jobs: Jobs, processes: EngineProcesses, go_on: Callable[[], None]) -> Outcomes:
        """Jobs of one engine in its process; where they break it, once more one by one, to find which of them does."""
        entry = EngineEntry(jobs.engine.label, jobs.engine)
        first, last = int(jobs.numbers[0]), int(jobs.numbers[-1]) + 1
        go_on()
        try:
            found = processes.call(entry, _measured_here, self.sweep, first, last)
        except Failed:
            return joined([self._outcome(entry, number, processes, go_on) for number in range(first, last)])
        if not (found.verdict == "crashed").any():
            return found
        # What a job raises may be the fault of those before it, such as a leak: it counts if the job does it in a new process.
        lots = []
        for place, number in enumerate(range(first, last)):
            if found.verdict[place] == "crashed":
                processes.renew(entry)
                lots.append(self._outcome(entry, number, processes, go_on))
            else:
                lots.append(found[place : place + 1])
        return joined(lots)

    def _outcome(self, entry: EngineEntry, number: int, processes: EngineProcesses, go_on: Callable[[], None]) -> Outcomes:
        """A job alone; if it breaks its engine, that."""
        go_on()
        try:
            return processes.call(entry, _measured_here, self.sweep, number, number + 1)
        except Failed as failure:
            go_on()  # or it was ended with the sweep, and is to be run again
            lost = Outcomes.blank(1, len(self.sweep.metrics))
            lost.set_breakdown(0, Breakdown(failure.verdict, failure.reason))
            return lost


def versions_here() -> dict[str, str | None]:
    """Of everything that the figures depend on, as installed here; of the reference implementation, its text."""
    return versions() | {"reference_impl": sources.HASH[:12]}


def _measured_here(entry: EngineEntry, sweep: Sweep, first: int, last: int) -> Outcomes:
    return measured(sweep, first, last)


def _as_table(sweep: Sweep, lots: list[Jobs], found: Outcomes) -> pa.Table:
    """One row a job."""
    columns: dict[str, Any] = {
        "job": pa.array([number for jobs in lots for number in jobs.numbers.tolist()], pa.int64()),
        "key": pa.array([key for jobs in lots for key in jobs.hashes()], pa.string()),
        "scene": pa.array([jobs.scene.name for jobs in lots for _ in range(len(jobs))], pa.string()),
        "engine": pa.array([label for jobs in lots for label in jobs.labels()], pa.string()),
        "dt": pa.array([dt for jobs in lots for dt in jobs.dts.tolist()], pa.float64()),
        "seed": pa.array([seed for jobs in lots for seed in jobs.starts()], pa.int64()),
    }
    for axis in sweep.axes:
        if axis.name != "dt":
            values = [value for jobs in lots for value in jobs.values[axis.name].tolist()]
            columns[axis.name] = pa.array(values, pa.float64()) if axis.is_of_numbers else pa.array(map(_written, values), pa.string())
    columns["verdict"], columns["reason"] = (pa.array(words, pa.string()) for words in (found.verdict, found.reason))
    for names, numbers in ((STATE, found.state), (FIGURES, found.figures), (sweep.metrics, found.metrics)):
        columns.update({name: pa.array(column, pa.float64()) for name, column in zip(names, numbers.T, strict=True)})
    columns["steps"] = pa.array(found.steps, pa.int64())
    columns["time_per_step"] = pa.array(found.time_per_step, pa.float64())
    return pa.table(columns)


def _written(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)
