"""The report: one HTML file that needs no network."""

from collections.abc import Sequence
from typing import Any

import pandas as pd
from markupsafe import Markup

from comparisons.judging.convergence import STUDIES
from comparisons.measuring.metrics import METRICS
from comparisons.results.ensembles import ENSEMBLE_METRICS
from comparisons.results.provenance import first_settings
from comparisons.results.results import NEGLIGIBLE, Results
from reports.pages import page
from reports.plots.colours import engine_colours
from reports.plots.figures import FIGURES
from reports.plots.spins import wobbles_freely
from reports.plots.svg import with_shared_styles
from reports.replay import as_data, replay_of
from reports.sections import Section
from reports.views import numbers
from reports.views.error_budget import error_budgets
from reports.views.findings import Counts
from reports.views.leading_errors import leading_errors, step_costs
from reports.views.run import Overview
from reports.views.scene import left_out, modelled
from scenarios import truth_for


def html_report(results: Results, summary: Overview, plots: dict[str, str], sections: Sequence[Section] = ()) -> str:
    """The page.

    Args:
        results: The run.
        summary: Its overview.
        plots: SVG elements, by the names of `report_figures`.
        sections: Sections of other studies.
    """
    styles, drawn = with_shared_styles(plots)
    words = sorted({status.words for by_engine in summary.statuses.values() for status in by_engine.values()})
    details = _details(results, summary.counts, drawn)
    return page("report.html", **vars(summary), **details, words=words, sections=sections, styles=Markup(styles))


def _details(results: Results, tally: Counts, plots: dict[str, str]) -> dict[str, Any]:
    return {
        "engines": results.engines,
        "provenance": results.provenance,
        "passed": tally.failed == 0 and tally.broken == 0,
        "colours": engine_colours(results.engines),
        "negligible": NEGLIGIBLE,
        "leading": leading_errors(results),
        "costs": step_costs(results),
        "plotted": len({name.split("-")[0] for name in plots}),
        "scenes": [_scene(results, number, name, plots) for number, name in enumerate(results.scenes)],
        "metrics": METRICS,
        "ensemble_metrics": ENSEMBLE_METRICS,
        "settings": first_settings(results.provenance),
    }


def _scene(results: Results, number: int, name: str, plots: dict[str, str]) -> dict[str, Any]:
    scene = results.scenes[name]
    truth = truth_for(scene)
    frame = results.table[results.table["scene"] == name]
    dts = sorted(frame["dt"].dropna().unique(), reverse=True)
    own = results.measurements[results.measurements["scene"] == name]
    studies = frame[frame["kind"].isin(STUDIES)]
    motions = replay_of(results, name)
    return {
        "id": f"scene-{number:02d}",
        "name": name,
        "scene": scene,
        "modelled": modelled(scene),
        "left_out": left_out(scene),
        "truth": None if truth is None else truth.statement,
        "dts": dts,
        "metrics": list(own["metric"].unique()),
        "cells": {(row.metric, row.engine, row.dt): _row(row) for row in own.itertuples()},
        "trends": _trends(studies),
        "budgets": error_budgets(results, name),
        "rows": _sorted_rows(pd.concat([own, studies])),
        "replay": None if motions is None else as_data(motions),
        "remarks": [_row(row) for row in frame[frame["metric"] == ""].drop_duplicates(["engine", "reason"]).itertuples()],
        "agreement": _agreement(frame, min(dts)),
        "ensemble": _ensemble(frame, min(dts)),
        "wobbles": wobbles_freely(scene),
        # SVG of reports.plots, whose text matplotlib has escaped.
        **{f"{kind}_plot": Markup(plots.get(f"{number:02d}-{kind}", "")) for kind in FIGURES},
    }


def _trends(studies: pd.DataFrame) -> dict[tuple[str, str], dict[str, Any]]:
    """The behaviour of each metric of each engine as dt → 0: a few words, the worse of the two verdicts, and the reasons."""
    trends = {}
    for (metric, engine), rows in studies.groupby(["metric", "engine"]):
        order, asymptotic = (rows[rows["kind"] == kind] for kind in STUDIES)
        p, m = (float(part["value"].iloc[0]) if len(part) else float("nan") for part in (order, asymptotic))
        reasons = [f"order {p:.3f}, {reason}" for reason in order["reason"]]
        reasons += [f"{m:.3g} ({row.lower:.3g} … {row.upper:.3g}) as dt → 0, {row.reason}" for row in asymptotic.itertuples()]
        cause = str(rows["cause"].iloc[0])
        verdict = "failed" if (rows["verdict"] == "failed").any() else str(rows["verdict"].iloc[-1])
        trends[str(metric), str(engine)] = {
            "text": numbers.trend(p, m, cause),
            "cause": cause,
            "verdict": verdict,
            "reason": "; ".join(reasons),
        }
    return trends


def _sorted_rows(rows: pd.DataFrame) -> list[dict[str, Any]]:
    """The rows by metric, then by engine, those for dt → 0 last."""
    metrics = {metric: number for number, metric in enumerate(dict.fromkeys(rows["metric"]))}
    return [_row(row) for row in rows.assign(place=rows["metric"].map(metrics)).sort_values(["place", "engine", "dt"]).itertuples()]


def _agreement(frame: pd.DataFrame, dt: float) -> list[dict[str, Any]]:
    pairs = frame[(frame["kind"] == "agreement") & (frame["dt"] == dt) & ~frame["metric"].isin(list(ENSEMBLE_METRICS))]
    return [_row(row) for row in pairs.itertuples()]


def _ensemble(frame: pd.DataFrame, dt: float) -> list[dict[str, Any]]:
    """The means over the ensemble, then the differences between engines, for each metric."""
    rows = frame[(frame["dt"] == dt) & frame["metric"].isin(list(ENSEMBLE_METRICS))]
    return [_row(row) for metric in ENSEMBLE_METRICS for row in rows[rows["metric"] == metric].itertuples()]


def _row(row: Any) -> dict[str, Any]:
    return {str(key): value for key, value in row._asdict().items()}
