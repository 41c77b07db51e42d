"""The report: one HTML file that needs no network."""

from collections.abc import Mapping, Sequence
from operator import itemgetter
from typing import Any, get_args

import pandas as pd

from dropspin.comparisons.judging.convergence import STUDIES
from dropspin.comparisons.judging.verdicts import BREAKDOWNS, FAILURES, MARKS, Outcome
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.tolerances import scale
from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS
from dropspin.comparisons.results.provenance import first_settings
from dropspin.comparisons.results.results import SMALLEST_STATED, Results
from dropspin.comparisons.results.table import OF_SYMMETRIES
from dropspin.comparisons.running.start_phases import QUICK_START_PHASES, START_PHASES
from dropspin.reports.document import Document
from dropspin.reports.html.film_strip import strip_of
from dropspin.reports.pages import page, with_minus
from dropspin.reports.plots.chart import Chart
from dropspin.reports.plots.chart_data import chart_data
from dropspin.reports.plots.colours import engine_styles, human_label
from dropspin.reports.plots.convergence import PREDICTED
from dropspin.reports.plots.run_charts import CHARTS
from dropspin.reports.replay import as_data, replay_of
from dropspin.reports.stories import numbers
from dropspin.reports.stories.contacts import worst_contacts
from dropspin.reports.stories.error_budget import error_budgets
from dropspin.reports.stories.matrix import CHOICE, explanations, legend_of_marks, step_times
from dropspin.reports.stories.run import Overview
from dropspin.reports.stories.words import WORDS


def html_report(
    results: Results, summary: Overview, charts: Mapping[str, Mapping[str, Sequence[Chart]]], sections: Sequence[Document] = ()
) -> str:
    """The page.

    Args:
        results: The run.
        summary: Its overview.
        charts: Its charts, from `report_charts`.
        sections: Studies to include.
    """
    finest = results.table.groupby("scene")["dt"].min().dropna().unique()
    scenes = [_scene(of_scene, number, charts.get(name, {})) for number, (name, of_scene) in enumerate(results.by_scene.items())]
    return page(
        "report.html",
        **summary._asdict(),
        engines=results.engines,
        references=_references(results),
        provenance=results.provenance,
        passed=not results.table["verdict"].isin(FAILURES | BREAKDOWNS).any(),
        styles=engine_styles(results.engines),
        negligible=SMALLEST_STATED,
        steps=numbers.in_ms(float(finest[0])) if len(finest) == 1 else "",
        times=step_times(results),
        legend=legend_of_marks(summary.statuses),
        explanations=explanations(results, summary.statuses),
        choice=CHOICE,
        outcomes=get_args(Outcome),
        plotted=len(charts),
        scenes=scenes,
        hero=_hero(results, scenes),
        sections=sections,
        metrics=METRICS,
        ensemble_metrics=ENSEMBLE_METRICS,
        start_phases=QUICK_START_PHASES if results.is_quick else START_PHASES,
        settings=first_settings(results.provenance),
        note_on_laws=WORDS["impact_laws"]["legend"],
    )


def _hero(results: Results, scenes: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The scene of the picture at the top, with its film strip at the time step of the matrix; empty without motions."""
    strips = {scene["strip"]: scene for scene in scenes if scene["strip"]}
    if not strips:
        return {}
    scene = strips[max(strips, key=lambda strip: (strip.shows_impact, len(strip.rows), strip.difference))]
    dt = min(dt for name, _, dt in results.trajectories if name == scene["name"])
    motions = replay_of(results, scene["name"], dt)
    return {**scene, "dt": dt, "strip": scene["strip"] if motions is None else strip_of(motions)}


def _references(results: Results) -> str:
    """What the engines of a run are compared with."""
    exact, recorded = len(results.recorded) < len(results.scenes), bool(results.recorded)
    return " and ".join(["exact solutions"] * exact + ["recordings"] * recorded)


def _scene(results: Results, number: int, charts: Mapping[str, Sequence[Chart]]) -> dict[str, Any]:
    [(name, scene)] = results.scenes.items()
    frame, own, order = results.table, results.measurements, list(ENSEMBLE_METRICS)
    dts = sorted(frame["dt"].dropna().unique(), reverse=True)
    pairs = results.agreements[results.agreements["dt"] == min(dts)]
    finest = pd.concat([frame[frame["dt"] == min(dts)], pairs])
    ensemble = finest[finest["metric"].isin(order)]  # the means, followed by the differences between engines
    studies, uncertain = frame[frame["kind"].isin(STUDIES)], frame[frame["kind"] == "uncertainty"]
    motions = replay_of(results, name)
    budgets = error_budgets(results)
    convergence = [line for chart in charts.get("convergence", ()) for line in chart.lines]
    return {
        "id": f"scene-{number:02d}",
        "name": name,
        "scene": scene,
        "dts": dts,
        "metrics": list(own["metric"].unique()),
        "cells": {(row["metric"], row["engine"], row["dt"]): row for row in own.to_dict("records")},
        "uncertainties": uncertain.set_index(["metric", "engine", "dt"])["value"].to_dict(),
        "trends": _trends(studies),
        "budgets": [budget for budget in budgets if budget["cause"] != "discretisation"],
        "converging": sum(budget["cause"] == "discretisation" for budget in budgets),
        "rows": _all_results(results, name, pd.concat([own, uncertain, studies, frame[frame["kind"].isin(OF_SYMMETRIES)]])),
        "replay": None if motions is None else as_data(motions),
        "strip": None if motions is None else strip_of(motions),
        "remarks": frame[frame["metric"] == ""].drop_duplicates(["engine", "reason"]).to_dict("records"),
        "agreement": pairs[~pairs["metric"].isin(order)].to_dict("records"),
        "contacts": worst_contacts(results, name),
        "ensemble": ensemble.sort_values("metric", key=lambda metrics: metrics.map(order.index), kind="stable").to_dict("records"),
        "scales": [f"{scale(scene, unit):.3g} {unit}" for unit in dict.fromkeys(own["unit"]) if unit not in ("1", "rad")],
        "has_intervals": any(line.is_fill for line in convergence),
        "has_predictions": any(line.label == PREDICTED for line in convergence),
        "charts": {kind: [chart_data(chart) for chart in charts.get(kind, ())] for kind in CHARTS},
    }


def _trends(studies: pd.DataFrame) -> dict[Any, dict[str, str]]:
    """For each metric and engine, the behaviour of the error as dt → 0, its cause, and the worse of the verdicts of its two checks."""
    trends: dict[Any, dict[str, str]] = {}
    for pair, rows in numbers.grouped(studies.to_dict("records"), itemgetter("metric", "engine")).items():
        order, asymptotic = (next((row for row in rows if row["kind"] == kind), None) for kind in STUDIES)
        m = asymptotic["value"] if asymptotic else float("nan")
        p = numbers.observed_order(order["value"], order["lower"], order["upper"]) if order else ""
        cause, verdict = rows[0]["cause"], "failed" if any(row["verdict"] == "failed" for row in rows) else rows[-1]["verdict"]
        trends[pair] = {"text": numbers.trend(m, cause, p), "cause": cause, "verdict": verdict}
    return trends


def _all_results(results: Results, scene_name: str, rows: pd.DataFrame) -> dict[str, Any]:
    """All results by metric, engine and time step, dt → 0 last: number of the engine, whether the result failed, indices of texts."""
    texts: dict[str, int] = {}
    found = []
    for row in rows.assign(place=pd.factorize(rows["metric"])[0]).sort_values(["place", "engine", "dt"]).to_dict("records"):
        name = numbers.subject(row["metric"], row["kind"]) + numbers.unit(row["unit"])
        shown = map(with_minus, (numbers.formatted(row["value"]), numbers.bound(row["lower"], row["upper"])))
        values = [human_label(row["engine"]), numbers.in_ms(row["dt"]), *shown]
        judged = [f"{MARKS[row['verdict']]} {numbers.outcome(row['verdict'])}", row["cause"], row["reason"]]
        listed = (texts.setdefault(text, len(texts)) for text in [name, *values, *judged])
        found.append([results.engines.index(row["engine"]), int(row["verdict"] == "failed"), *listed])
    return {"scene": scene_name, "rows": found, "texts": list(texts)}
