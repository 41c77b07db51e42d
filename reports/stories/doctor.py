"""The output of `dropspin doctor`: versions, processor, and whether each engine can take a time step."""

import sys
from collections.abc import Sequence

from dropspin.comparisons.results.provenance import processor, versions
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import Breakdown, simulate
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.comparisons.running.process_limits import ONE_MINUTE
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.reports.document import Rows
from dropspin.scenarios import DropspinError, load


def rows(engines: Sequence[str]) -> Rows:
    """Versions, processor, and whether each engine can take a time step."""
    facts = [{"what": package, "found": version or "not installed"} for package, version in versions().items()]
    facts += [{"what": "python", "found": sys.version.split()[0]}, {"what": "processor", "found": processor()}]
    with EngineProcesses(ONE_MINUTE) as processes:
        facts += [{"what": f"engine {name}", "found": _health(name, processes)} for name in engines]
    return facts


def _health(name: str, processes: EngineProcesses) -> str:
    """Whether an engine can take a time step, tried in a separate process."""
    try:
        entry = engine_entry(name)
        answer = processes.call(entry, _fall)
    except DropspinError as error:
        return f"broken: {error}"
    return f"{entry.absence or 'broken'}: {answer}" if isinstance(answer, Breakdown) else answer


def _fall(entry: EngineEntry) -> str:
    motion = simulate(load("fall-spin"), entry.adapter, 4e-3)
    return f"works: box at {motion.position[-1, 1]:.4f} m after {motion.t[-1]:g} s"
