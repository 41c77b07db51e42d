"""The tables of a run on a terminal: for each scene, a table with a column for each engine."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from dropspin.comparisons.judging.verdicts import MARKS
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.results.ensembles import QUICK_MEMBERS
from dropspin.comparisons.results.results import Results
from dropspin.reports.stories.findings import orders
from dropspin.reports.stories.impact_laws import law_rows
from dropspin.reports.stories.numbers import formatted, trend, unit, with_unit, word
from dropspin.reports.terminal.safe import styled
from dropspin.reports.terminal.summary import print_summary

NUMBER_WIDTH = 9  # of -1.23e-04; a narrow terminal folds names and splits the table, but never cuts a number
NAME_WIDTH, GAP = 20, 3
STYLES = {"passed": "green", "failed": "bold red", "crashed": "bold red", "diverged": "bold red", "timed_out": "bold red"}


def print_table(results: Results, console: Console | None = None) -> None:
    """Print every metric of every engine at the finest time step, the spread between independent engines, and the summary.

    Args:
        results: The run.
        console: Rich's console to print to; None means standard output.
    """
    out = console or Console()
    laws = law_rows(results)
    at_once = max(1, (out.width - NAME_WIDTH - NUMBER_WIDTH - GAP) // (NUMBER_WIDTH + 2 + GAP))
    for name, scene in results.scenes.items():
        out.print(styled(name, style="bold").append(f"  {scene.summary}" if scene.summary else "", style="not bold"))
        for first in range(0, len(results.engines), at_once):
            out.print(_scene_table(results, name, results.engines[first : first + at_once]))
        for sentence in (*_trends(results, name), *_ensemble(results, name), *_laws(row for row in laws if row["scene"] == name)):
            out.print(styled(sentence, style="dim"))
        remarks = results.table[(results.table["scene"] == name) & (results.table["metric"] == "")]
        for row in remarks.drop_duplicates(["engine", "verdict", "reason"]).to_dict("records"):
            out.print(styled(f"{row['engine']}: {word(row['verdict'])}. {row['reason']}", style=STYLES.get(row["verdict"], "")))
        out.print()
    print_summary(results, out)


def _scene_table(results: Results, name: str, engines: Sequence[str]) -> Table:
    frame = results.table[results.table["scene"] == name]
    finest = frame[frame["dt"] == frame["dt"].min()]
    own = finest[finest["kind"].isin(["truth", "invariant"])]
    agreements = results.agreements[(results.agreements["scene"] == name) & (results.agreements["dt"] == frame["dt"].min())]
    pairs = agreements[~(agreements["basis"] == "same_method")]
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column(f"at dt = {1e3 * frame['dt'].min():g} ms", min_width=NAME_WIDTH)
    for engine in engines:
        table.add_column(styled(engine), overflow="fold", justify="right", width=NUMBER_WIDTH + 2)
    if not pairs.empty:
        table.add_column("spread", justify="right", width=NUMBER_WIDTH)
    found = {
        (row["metric"], row["engine"]): styled(f"{formatted(row['value'])} {MARKS[row['verdict']]}", STYLES.get(row["verdict"], ""))
        for row in own.to_dict("records")
    }
    for metric in own["metric"].unique():
        cells = [styled(metric.replace("_", " ") + unit(METRICS[metric].unit))]
        cells += [found.get((metric, engine), styled("–")) for engine in engines]
        if not pairs.empty:
            spread = float(pairs.loc[pairs["metric"] == metric, "value"].abs().max())
            cells.append(styled("" if math.isnan(spread) else formatted(spread)))
        table.add_row(*cells)
    return table


def _trends(results: Results, name: str) -> Iterator[str]:
    """For each engine, a sentence with the observed orders and the errors that do not vanish as dt → 0."""
    frame = results.table[results.table["scene"] == name]
    for engine in results.engines:
        mine = frame[frame["engine"] == engine]
        found = orders(results, name, engine)
        trends = [found] if found else []
        wrong = mine[(mine["kind"] == "asymptotic_error") & mine["cause"].isin(["model", "setting"])]
        trends += [
            f"{metric.replace('_', ' ')} {trend(value, cause)}"
            for metric, value, cause in zip(wrong["metric"], wrong["value"], wrong["cause"], strict=True)
        ]
        if trends:
            yield f"as dt → 0, {engine}: {', '.join(trends)}"


def _ensemble(results: Results, name: str) -> Iterator[str]:
    """The means over the initial states of the ensemble at the finest time step, each with the half-width of its confidence interval."""
    frame = results.table[(results.table["scene"] == name) & (results.table["kind"] == "ensemble")]
    finest = frame[frame["dt"] == frame["dt"].min()]
    for metric, rows in finest.groupby("metric", sort=False):
        values = [with_unit(f"{row['value']:.3g} ± {row['upper'] - row['value']:.1g}", row["unit"]) for row in rows.to_dict("records")]
        means = map(" ".join, zip(rows["engine"], values, strict=True))
        spread = results.scenes[name].ensemble
        assert spread is not None
        starts = min(spread.size, QUICK_MEMBERS) if results.is_quick else spread.size
        yield f"over {starts} starts, {str(metric).replace('_', ' ')}: {', '.join(means)}"


def _laws(rows: Iterable[Mapping[str, str]]) -> Iterator[str]:
    """The distances of each engine to the exact solutions under the impact laws; that of the scene is marked."""
    for row in rows:
        _, engine, distance, *laws = row.items()
        listed = ", ".join(f"{law} {value}" for law, value in laws if value != "–")
        yield f"by impact law, {distance[1]}, {engine[1]}: {listed}"
