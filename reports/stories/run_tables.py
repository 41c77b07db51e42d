"""The tables of `dropspin run --verbose`: for each scene every metric, with a column for each engine, and sentences below the table."""

from collections.abc import Iterator

from dropspin.comparisons.judging.verdicts import COMBINED, MARKS
from dropspin.comparisons.results.ensembles import QUICK_MEMBERS
from dropspin.comparisons.results.results import Results
from dropspin.reports.document import Heading, Part, Sentences, Table
from dropspin.reports.stories.findings import orders
from dropspin.reports.stories.impact_laws import law_rows
from dropspin.reports.stories.numbers import formatted, in_ms, outcome, trend, unit, with_unit


def scene_parts(results: Results) -> list[Part]:
    """For each scene: the metrics at the finest time step, orders and asymptotic errors, and why there are no results."""
    parts: list[Part] = []
    for name, of_scene in results.by_scene.items():
        remarks = of_scene.table[of_scene.table["metric"] == ""].drop_duplicates(["engine", "verdict", "reason"]).to_dict("records")
        parts += [
            Heading(": ".join(filter(None, [name, results.scenes[name].summary])), on_terminal=True),
            Table(list(_rows(of_scene)), ["spread", *reversed(results.engines)]),
            Sentences([*_trends(of_scene, name), *_uncertainties(of_scene), *_ensemble(of_scene, name)], style="dim"),
            Table(law_rows(of_scene)),
            Sentences([f"{row['engine']}: {outcome(row['verdict'])}. {row['reason']}" for row in remarks]),
        ]
    return parts


def _rows(results: Results) -> Iterator[dict[str, str]]:
    """The metrics of a scene at the finest time step, and the largest difference between independent engines."""
    frame, pairs, dt = results.table, results.agreements, results.table["dt"].min()
    own = frame[(frame["dt"] == dt) & frame["kind"].isin(["truth", "invariant"])]
    independent = pairs[(pairs["dt"] == dt) & (pairs["basis"] != "same_method")]
    spreads = independent["value"].abs().groupby(independent["metric"]).max().dropna().map(formatted)
    cells = {(row["metric"], row["engine"]): f"{formatted(row['value'])} {MARKS[row['verdict']]}" for row in own.to_dict("records")}
    for metric, of in own.drop_duplicates("metric")[["metric", "unit"]].itertuples(index=False):
        row = {f"at dt = {in_ms(dt)}": metric.replace("_", " ") + unit(of)}
        row |= {engine: cells.get((metric, engine), "–") for engine in results.engines}
        yield row | ({"spread": spreads.get(metric, "")} if len(independent) else {})


def _trends(results: Results, name: str) -> Iterator[str]:
    """For each engine, a sentence with the observed orders and the errors that do not vanish as dt → 0."""
    frame = results.table
    wrong = frame[(frame["kind"] == "asymptotic_error") & frame["cause"].isin(["model", "setting", COMBINED])]
    for engine in results.engines:
        errors = wrong[wrong["engine"] == engine].to_dict("records")
        remain = [f"{row['metric'].replace('_', ' ')} {trend(row['value'], row['cause'])}" for row in errors]
        if trends := [*filter(None, [orders(results, name, engine)]), *remain]:
            yield f"as dt → 0, {engine}: {', '.join(trends)}"


def _uncertainties(results: Results) -> Iterator[str]:
    """The uncertainty of the scene's recording in each metric at the finest time step."""
    frame = results.table[results.table["kind"] == "uncertainty"]
    for metric, rows in frame[frame["dt"] == frame["dt"].min()].groupby("metric", sort=False):
        values = [f"{row['engine']} {with_unit(formatted(row['value']), row['unit'])}" for row in rows.to_dict("records")]
        yield f"uncertainty of the recording, {str(metric).replace('_', ' ')}: {', '.join(values)}"


def _ensemble(results: Results, name: str) -> Iterator[str]:
    """The means over the initial states of the ensemble at the finest time step, each with the half-width of its confidence interval."""
    frame, spread = results.table[results.table["kind"] == "ensemble"], results.scenes[name].ensemble
    for metric, rows in frame[frame["dt"] == frame["dt"].min()].groupby("metric", sort=False):
        values = [with_unit(f"{row['value']:.3g} ± {row['upper'] - row['value']:.1g}", row["unit"]) for row in rows.to_dict("records")]
        means = map(" ".join, zip(rows["engine"], values, strict=True))
        assert spread is not None
        starts = min(spread.size, QUICK_MEMBERS) if results.is_quick else spread.size
        yield f"over {starts} starts, {str(metric).replace('_', ' ')}: {', '.join(means)}"
