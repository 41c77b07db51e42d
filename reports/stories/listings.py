"""The output of `dropspin list`: the scenes, the engines or the metrics."""

from dropspin.reports.document import Rows
from dropspin.scenarios.loading import load, names
from dropspin.scenarios.problems import problems

LEFT_OUT_FIRST = {"scenes": ("tags", "truth"), "engines": (), "metrics": ("needs", "unit")}
"""The columns of each list that are left out on a narrow terminal."""


def scene_rows() -> Rows:
    """The scenes of the catalogue."""
    known = {problem.scene: problem for problem in problems().values()}
    return [
        {
            "scene": scene.name,
            "problem": known[scene.name].identifier,
            "truth": known[scene.name].truth,
            "tags": ", ".join(scene.tags),
            "summary": scene.summary,
        }
        for scene in map(load, names())
    ]


def engine_rows() -> Rows:
    """The engines that can be chosen by name: whether they are installed, what they are or how to install them, and their options."""
    from dropspin.comparisons.engines.registry import absence, engine_names
    from dropspin.comparisons.engines.stand_in import StandIn
    from dropspin.comparisons.running.engine_entries import engine_entry

    rows = []
    for name in engine_names():
        entry = engine_entry(name)
        if entry.engine is None:
            installed = "no" if entry.absence == "missing" else entry.absence
            rows.append({"engine": name, "installed": installed, "summary": absence(name) or entry.reason, "options": ""})
            continue
        adapter = entry.adapter
        choices = [f"{key} = {' | '.join(values)}" for key, values in adapter.choices.items()]
        numbers = [f"{key} = {allowed.least:g} … {allowed.most:g}" for key, allowed in adapter.numbers.items()]
        settings = [f"{len(adapter.settings)} settings: dropspin show {name}"] if adapter.settings else []
        options = "; ".join(choices + numbers + settings)
        summary = adapter.traits.summary if isinstance(adapter, StandIn) else (type(adapter).__doc__ or "").strip().partition("\n")[0]
        rows.append({"engine": name, "installed": "yes", "summary": summary, "options": options})
    return rows


def metric_rows() -> Rows:
    """The metrics of one motion, then those of an ensemble."""
    from dropspin.comparisons.measuring.metrics import METRICS
    from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS

    rows = [(name, metric.unit, metric.needs, metric.definition) for name, metric in METRICS.items()]
    rows += [(name, metric.unit, "an ensemble", f"Mean. {metric.definition}") for name, metric in ENSEMBLE_METRICS.items()]
    return [dict(zip(("metric", "unit", "needs", "definition"), row, strict=True)) for row in rows]
