"""`dropspin list` in words: the scenes, the engines, the metrics."""

from comparisons.engines.registry import engine, engine_names
from comparisons.measuring.metrics import METRICS
from comparisons.results.ensembles import ENSEMBLE_METRICS
from scenarios import DropspinError, load, names, truth_for

Rows = list[dict[str, str]]


def scene_rows() -> Rows:
    """The catalogue."""
    rows = []
    for name in names():
        scene = load(name)
        truth = truth_for(scene)
        rows.append({"scene": name, "truth": truth.name if truth else "", "tags": ", ".join(scene.tags), "summary": scene.summary})
    return rows


def engine_rows() -> Rows:
    """The engines that can be named."""
    rows = []
    for name in engine_names():
        try:
            found = engine(name)
        except DropspinError as error:
            rows.append({"engine": name, "options": "", "summary": str(error)})
            continue
        choices = [f"{key} = {' | '.join(values)}" for key, values in found.choices.items()]
        numbers = [f"{key} = {allowed.least:g} … {allowed.most:g}" for key, allowed in found.numbers.items()]
        options = "; ".join(choices + numbers)
        rows.append({"engine": name, "options": options, "summary": (type(found).__doc__ or "").strip().splitlines()[0]})
    return rows


def metric_rows() -> Rows:
    """The metrics."""
    of_one = [
        {"metric": metric.name, "unit": metric.unit, "needs": metric.needs, "definition": metric.definition} for metric in METRICS.values()
    ]
    of_many = [
        {"metric": name, "unit": metric.unit, "needs": "an ensemble", "definition": f"Mean. {metric.definition}"}
        for name, metric in ENSEMBLE_METRICS.items()
    ]
    return of_one + of_many
