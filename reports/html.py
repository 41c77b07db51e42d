"""The report: one HTML file that needs no network."""

import re
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup

from comparisons import ENSEMBLE_METRICS, METRICS, Results
from comparisons.provenance import first_settings
from comparisons.studies import STUDIES
from reports import numbers
from reports.apart import taken_apart
from reports.colours import engine_colours
from reports.failing import failing
from reports.findings import (
    NEGLIGIBLE,
    counts,
    finding_sentences,
    lasting_errors,
    profile_comparisons,
    verdict_sentence,
    verdicts,
)
from reports.methods import leading_errors, step_costs
from reports.plots import bounce_figure, convergence_figure, ensemble_figure, flight_figure, time_figure
from reports.plots.spins import wobbles_freely
from reports.replay import as_data, replay_of
from reports.section import Section
from reports.svg import with_ids_of, with_shared_styles
from scenarios import Scenario, truth_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURES: dict[str, Callable[[Results, str], "Figure | None"]] = {
    "time": time_figure,
    "flight": flight_figure,
    "bounces": bounce_figure,
    "convergence": convergence_figure,
    "ensemble": ensemble_figure,
}
"""What is drawn of a scene, where it has it."""
STUCK = {"model": "model error", "setting": "setting"}
"""Why an error stays as the step goes to 0, and the words for it."""


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("reports"),
        autoescape=select_autoescape(enabled_extensions=("html",), disabled_extensions=("md",), default=True),
        keep_trailing_newline=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {name: getattr(numbers, name) for name in ("in_ms", "unit", "word", "written")}
    environment.filters |= {"cell": _markdown_cell, "code": _markdown_code, "ids_of": with_ids_of}
    environment.globals |= {"bound": numbers.bound, "subject": numbers.subject, "marks": numbers.MARKS}
    return environment


def html_report(results: Results, plots: dict[str, str], sections: Sequence[Section] = ()) -> str:
    """The whole page.

    Args:
        results: The run.
        plots: SVG elements, by the names of `figures`.
        sections: What other studies have to tell.
    """
    styles, drawn = with_shared_styles(plots)
    overview = _overview(results)
    found = verdicts(results)
    kinds = {
        (scene, engine): {*mine, *found.get((scene, engine), ())} - {"measured"}
        for scene, by_engine in overview["chips"].items()
        for engine, mine in by_engine.items()
    }
    words = sorted({word for mine in kinds.values() for word in mine})
    return page("report.html", **overview, **_details(results, drawn), kinds=kinds, words=words, sections=sections, styles=Markup(styles))


def markdown_report(results: Results) -> str:
    """The same in short, for a pull request."""
    return page("report.md", **_overview(results))


def page(template: str, **content: Any) -> str:
    """An HTML or Markdown page of ours."""
    return _environment().get_template(template).render(content)


def figures(results: Results) -> "Iterator[tuple[str, Figure]]":
    """Name and figure of each plot of the report."""
    for number, scene in enumerate(results.scenes):
        for kind, draw in FIGURES.items():
            figure = draw(results, scene)
            if figure is not None:
                yield f"{number:02d}-{kind}", figure


def _markdown_cell(text: str) -> str:
    """Text that stays within its cell of a Markdown table and means nothing else there."""
    return re.sub(r"([\\|`*_\[\]<>#])", r"\\\1", " ".join(str(text).split()))


def _markdown_code(text: str) -> str:
    """Text as code, whatever backticks it has."""
    fence = "`" * (1 + max((len(found) for found in re.findall("`+", text)), default=0))
    room = " " if len(fence) > 1 else ""
    return f"{fence}{room}{text}{room}{fence}"


def _overview(results: Results) -> dict[str, Any]:
    return {
        "verdict": verdict_sentence(results),
        "findings": finding_sentences(results),
        "engines": results.engines,
        "chips": _chips(results),
        "failures": failing(results),
        "provenance": results.provenance,
    }


def _details(results: Results, plots: dict[str, str]) -> dict[str, Any]:
    return {
        "held": counts(results).failed == 0 and counts(results).broken == 0,
        "colours": engine_colours(results.engines),
        "stuck": list(STUCK.values()),
        "negligible": NEGLIGIBLE,
        "leading": leading_errors(results),
        "costs": step_costs(results),
        "profiles": profile_comparisons(results),
        "scenes": [_scene(results, number, name, plots) for number, name in enumerate(results.scenes)],
        "metrics": METRICS,
        "ensemble_metrics": ENSEMBLE_METRICS,
        "settings": first_settings(results.provenance),
    }


def _chips(results: Results) -> dict[str, dict[str, list[str]]]:
    """By scene and engine: the verdict that counts, and why an error stays, if one does."""
    found, stuck = verdicts(results), {words: lasting_errors(results, cause) for cause, words in STUCK.items()}
    return {
        scene: {
            engine: [found.get((scene, engine), ["missing"])[0], *(words for words, where in stuck.items() if scene in where[engine])]
            for engine in results.engines
        }
        for scene in results.scenes
    }


def _scene(results: Results, number: int, name: str, plots: dict[str, str]) -> dict[str, Any]:
    scene = results.scenes[name]
    truth = truth_for(scene)
    frame = results.frame[results.frame["scene"] == name]
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
        "apart": taken_apart(results, name),
        "figures": _figures(pd.concat([own, studies])),
        "replay": None if motions is None else as_data(motions),
        "remarks": [_row(row) for row in frame[frame["metric"] == ""].drop_duplicates(["engine", "reason"]).itertuples()],
        "agreement": _agreement(frame, min(dts)),
        "ensemble": _ensemble(frame, min(dts)),
        "wobbles": wobbles_freely(scene),
        # Our own SVG; its text is escaped by matplotlib.
        **{f"{kind}_plot": Markup(plots.get(f"{number:02d}-{kind}", "")) for kind in FIGURES},
    }


def modelled(scene: Scenario) -> list[str]:
    """What of a scene is simulated, in words."""
    parts = [f"a {scene.body.shape} of {scene.body.mass:g} kg" if scene.body.shape != "vertices" else "a set of vertices"]
    if scene.gravity is not None:
        parts.append("gravity")
    if scene.floor is not None:
        friction = scene.floor.friction
        grip = {"none": "no friction", "infinite": "infinite friction"}.get(str(friction), f"friction {friction}")
        parts.append(f"a floor of restitution {scene.floor.restitution:g} and {grip}")
    if scene.damping is not None:
        parts.append(f"damping of {scene.damping.linear:g} and {scene.damping.angular:g} per second")
    if scene.ensemble is not None:
        parts.append(f"{scene.ensemble.size} starts drawn around the scene's own")
    return parts


def left_out(scene: Scenario) -> list[str]:
    """What a scene does not model, so that no engine pays for it."""
    return [part for part in ("gravity", "floor", "damping") if getattr(scene, part) is None]


def _trends(studies: pd.DataFrame) -> dict[tuple[str, str], dict[str, Any]]:
    """What becomes of each metric of each engine as the step goes to 0: a word, the worse of two verdicts, and the reasons."""
    trends = {}
    for (metric, engine), rows in studies.groupby(["metric", "engine"]):
        order, limit = (rows[rows["kind"] == kind] for kind in STUDIES)
        p, m = (float(part["value"].iloc[0]) if len(part) else float("nan") for part in (order, limit))
        reasons = [f"order {p:.3f}, {reason}" for reason in order["reason"]]
        reasons += [f"limit {m:.3g} ± {upper:.1g}, {reason}" for upper, reason in zip(limit["upper"], limit["reason"], strict=True)]
        cause = str(rows["cause"].iloc[0])
        verdict = "failed" if (rows["verdict"] == "failed").any() else str(rows["verdict"].iloc[-1])
        trends[str(metric), str(engine)] = {
            "text": numbers.trend(p, m, cause),
            "cause": cause,
            "verdict": verdict,
            "reason": "; ".join(reasons),
        }
    return trends


def _figures(rows: pd.DataFrame) -> list[dict[str, Any]]:
    """What was measured, metric by metric, then engine by engine, the limit last."""
    metrics = {metric: number for number, metric in enumerate(dict.fromkeys(rows["metric"]))}
    return [_row(row) for row in rows.assign(place=rows["metric"].map(metrics)).sort_values(["place", "engine", "dt"]).itertuples()]


def _agreement(frame: pd.DataFrame, dt: float) -> list[dict[str, Any]]:
    pairs = frame[(frame["kind"] == "agreement") & (frame["dt"] == dt) & ~frame["metric"].isin(list(ENSEMBLE_METRICS))]
    return [_row(row) for row in pairs.itertuples()]


def _ensemble(frame: pd.DataFrame, dt: float) -> list[dict[str, Any]]:
    """The means over the ensemble, then the differences between engines, metric by metric."""
    rows = frame[(frame["dt"] == dt) & frame["metric"].isin(list(ENSEMBLE_METRICS))]
    return [_row(row) for metric in ENSEMBLE_METRICS for row in rows[rows["metric"] == metric].itertuples()]


def _row(row: Any) -> dict[str, Any]:
    return {str(key): value for key, value in row._asdict().items()}
