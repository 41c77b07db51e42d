"""The study of the command `dropspin reproduce`: run what a source describes, and compare the digits."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial

from dropspin.comparisons.engines.packages import numbers_of
from dropspin.comparisons.published.formulas import FORMULAS
from dropspin.comparisons.published.quantities import quantity
from dropspin.comparisons.published.results import Result, with_value
from dropspin.comparisons.published.sources import Case, Group, Source, sources
from dropspin.comparisons.published.tosses import acosta_cube
from dropspin.comparisons.running.arguments import EngineEntry, ignore
from dropspin.comparisons.running.driving import Breakdown, finite, try_record
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.comparisons.running.process_limits import ONE_MINUTE, ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.scenarios import DropspinError, Scenario


def reproduce(
    names: Iterable[str] = (),
    *,
    data: str | None = None,
    on_progress: Callable[[str, float], None] | None = None,
    resources: ResourceLimits = ONE_MINUTE,
) -> list[Result]:
    """Run what published sources describe, and compare the values with the digits that they print.

    Args:
        names: Names of sources; by default all that need no data.
        data: The folder of the measured tosses that a source needs.
        on_progress: Called with a description of the current work and the fraction of the whole study that is done, from 0 to 1.
        resources: The processor time [s] and memory [bytes] that an engine may use for one run.

    Returns:
        The results, source by source.

    Raises:
        UnknownName: There is no source of a name.
        DropspinError: A source needs data that are not given, or that are not its own.
    """
    chosen, callback = sources(names), on_progress or ignore
    for source in chosen:
        if source.data and data is None:
            raise DropspinError(f"{source.name}: needs {source.data}; give the folder: dropspin reproduce {source.name} DIR.")
    results: list[Result] = []
    with EngineProcesses(resources) as processes:
        pieces = [piece for source in chosen for piece in _pieces(source, data, processes)]
        for number, (what, work) in enumerate(pieces):
            callback(what, number / len(pieces))
            results += work()
    return results


def _pieces(source: Source, data: str | None, processes: EngineProcesses) -> Iterator[tuple[str, Callable[[], Iterable[Result]]]]:
    """The pieces of work of a source, each with its name: its formula, each run of the tosses, and each case of an engine."""
    if source.formula:
        yield source.name, partial(FORMULAS[source.formula], source)
    if source.data and data is not None:
        yield from ((source.name, work) for work in acosta_cube(source, data, processes))
    for group in source.groups:
        entry = engine_entry(group.by) if group.by else EngineEntry("", None, "missing", group.why_not)
        for case in group.cases:
            yield f"{source.name}, {entry.label}", partial(_of_case, source, group, case, entry, processes)


def _measured(entry: EngineEntry, scene: Scenario, dt: float, names: Sequence[str], since: str) -> list[float]:
    if since:
        with entry.adapter.prepare(scene, dt) as simulation:
            version = str(simulation.settings["version"])
        if numbers_of(version) < numbers_of(since):
            raise Breakdown("declined", f"it needs version {since} or later; {version} is installed")
    motion = finite(try_record(entry.adapter, scene, dt))
    return [quantity(name)(scene, motion) for name in names]


def _of_case(source: Source, group: Group, case: Case, entry: EngineEntry, processes: EngineProcesses) -> Iterator[Result]:
    """The results of one run."""
    measured = processes.call(entry, _measured, source.scene(group.scene), case.dt, group.quantities, group.since)
    values: Sequence[float | Breakdown] = [measured] * len(case.printed) if isinstance(measured, Breakdown) else measured
    for name, printed, value in zip(group.quantities, case.printed, values, strict=True):
        result = Result(source.name, group.tool, f"{case.case}: {name}" if case.case else name, printed, "", group.by, "not run")
        yield with_value(result, value, group.why_not, source.significant)
