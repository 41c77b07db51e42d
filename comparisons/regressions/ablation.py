"""Which of an engine's settings that changed since results were accepted explain the largest change of its results."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pandas as pd

from dropspin.comparisons.engines.registry import is_foreign, parsed
from dropspin.comparisons.judging.verdicts import Judgement
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.regressions.attribution import changed_settings, common_settings
from dropspin.comparisons.regressions.baseline import Baseline
from dropspin.comparisons.regressions.changes import regressed
from dropspin.comparisons.regressions.checking import Checked
from dropspin.comparisons.results.results import Results
from dropspin.comparisons.results.table import Case, Measurement, as_table
from dropspin.comparisons.running.ablation import explaining
from dropspin.comparisons.running.arguments import ignore
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.comparisons.running.engine_study import EngineStudy
from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.start_phases import StartPhase
from dropspin.scenarios import truth_for


def with_explaining_settings(checked: Checked, baseline: Baseline | None, *, imports: bool) -> Checked:
    """A check with rows of kind `setting` for each engine of which settings changed since its results were accepted, and results fail.

    The engine simulates the scene of its largest change again, with the accepted values of these settings.

    Args:
        checked: The check.
        baseline: The accepted results.
        imports: Whether adapters outside dropspin are imported to do so. A run folder may come from anybody, and names its adapters.
    """
    if baseline is None:
        return checked
    results = checked.results
    failing = regressed(checked.changes)
    failing = failing[failing["kind"].isin(["truth", "invariant"]) & failing["value"].notna()]
    largest = failing.groupby("engine", sort=False).head(1)
    rows = [row for _, change in largest.iterrows() for row in _rows(change, results, baseline, imports)]
    if not rows:
        return checked
    return replace(checked, results=replace(results, table=pd.concat([results.table, as_table(rows)], ignore_index=True)))


def _rows(changed: "pd.Series[Any]", results: Results, baseline: Baseline, imports: bool) -> Iterator[Measurement]:
    """Rows for the settings of an engine that explain the change of a result; none if reverting all of them leaves most of it."""
    label, scene, dt, metric = changed["engine"], results.scenes[changed["scene"]], float(changed["steps"]), METRICS[changed["metric"]]
    name = results.provenance["names"].get(label)  # none of an engine that was given as an object
    engine = engine_entry(name).engine if name and (imports or not is_foreign(parsed(name)[0])) else None
    stamp = baseline.acceptances[changed["by"]].stamp_of(label)
    now, accepted = common_settings(results.provenance, label), changed_settings(stamp, results.provenance, label)
    if engine is None:
        return
    acting = [name for name in accepted if name in engine.settings and engine.unmet_need(name) is None]
    # An adapter may report other words than its options have, or none.
    back = {name: accepted[name] for name in acting if engine.allows(name, accepted[name]) and engine.allows(name, now.get(name, ""))}
    if not back:
        return
    entry = engine_entry(replace(engine, options={**engine.options, **{name: now[name] for name in back}}))
    with EngineProcesses(ResourceLimits()) as processes:
        error_of = EngineStudy(StartPhase(scene, truth_for(scene)), entry, processes, ignore).error_of(metric, dt)
        change = changed["value"] - changed["before"]
        for names, share in explaining(entry.adapter, back, error_of, change).items():
            yield Case(scene.name, label, dt).measurement(
                "setting", metric.name, "1", Judgement(share, "measured", basis="since_accepted"), names
            )
