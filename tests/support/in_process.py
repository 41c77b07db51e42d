"""Engines in the process of the tests: most tests are about results, and a process for each engine costs more than its steps.

Engines of one's own, whose code a command imports anew, keep their processes; an engine that is to have a new process has one from then on;
and so has every engine in tests that use the fixture `engine_processes`: crashes, hangs, leaks, limits, and what else depends on isolation.
"""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock
from unittest import mock

from dropspin.comparisons.engines.stand_in import StandIn
from dropspin.comparisons.running.arguments import ignore
from dropspin.comparisons.running.driving import Breakdown, classify
from dropspin.comparisons.running.engine_run import motions_from, run_engine
from dropspin.comparisons.running.processes import Closed, EngineProcesses

REAL = {name: getattr(EngineProcesses, name) for name in ("start", "call", "renew")}
_one_at_a_time = RLock()


def needs_process(processes, entry):
    """Whether an engine's code must stay out of this process, or it was given a new process before."""
    is_foreign = not entry.absence and (entry.engine is None or isinstance(entry.engine, StandIn))
    return is_foreign or entry.label in processes._pools


def start(self, entries):
    REAL["start"](self, [entry for entry in entries if needs_process(self, entry)])


def renew(self, entry):
    if needs_process(self, entry):
        REAL["renew"](self, entry)
    REAL["start"](self, [entry])


def call(self, entry, work, *given, on_simulations=ignore):
    """As `EngineProcesses.call`; one piece of work at a time, for not all that engines do is safe in threads."""
    if needs_process(self, entry):
        return REAL["call"](self, entry, work, *given, on_simulations=on_simulations)
    if entry.absence:
        return Breakdown(entry.absence, entry.reason)
    if self._closed:
        raise Closed
    on_simulations(0, 0)
    with _one_at_a_time, mock.patch.object(tempfile, "tempdir", tempfile.tempdir):
        try:
            return work(entry, *given, *([on_simulations] if work in (run_engine, motions_from) else []))
        except Exception as error:
            return classify(error)


@contextmanager
def engines_in_process() -> Iterator[None]:
    """Let engines work in this process, one at a time."""
    with mock.patch.multiple(EngineProcesses, start=start, call=call, renew=renew):
        yield


@contextmanager
def engines_in_processes() -> Iterator[None]:
    """Let each engine work in a process of its own, as it does outside tests."""
    with mock.patch.multiple(EngineProcesses, **REAL):
        yield
