"""The site of a record: a page with the newest releases, a page for each engine and for each scene, and badges."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.measuring.metrics import METRICS
from comparisons.measuring.tolerances import scale
from comparisons.record import findings
from comparisons.record.findings import Change, Release, leading, problem, relative_error
from reports.pages import page
from reports.plots.chart import Chart, Line
from reports.plots.chart_data import chart_data
from reports.plots.colours import engine_colours, engine_styles
from reports.views import record as view
from reports.views.numbers import in_ms
from reports.views.numbers import unit as in_brackets
from reports.views.scene import modelled
from scenarios import truth_for
from scenarios.problems import identifier

GENERATOR = '<meta name="generator" content="dropspin publish">'
INDEX = "index.html"
STEP_STYLES = (("#D55E00", "s"), ("#0072B2", "o"), ("#009E73", "D"), ("#CC79A7", "^"))
"""Colours and markers of time steps, coarsest first."""
LEAST = 1e-16
"""Relative error at which an exact zero is drawn."""


class Site:
    """The pages of a record.

    Args:
        releases: The releases of each engine, oldest first.
        docs: Where the documentation is, relative to the pages, such as `../`; empty for nowhere.
    """

    def __init__(self, releases: Mapping[str, list[Release]], docs: str = "") -> None:
        self.releases, self.docs = releases, docs
        self.newest = {engine: measured[-1] for engine, own in releases.items() if (measured := [one for one in own if one.cases])}
        self.changes: dict[str, list[Change]] = {engine: findings.changes(engine, releases[engine]) for engine in self.newest}
        keys = [key for one in self.newest.values() for key in one.cases]
        self.scenes = sorted({scene for _, scene, _ in keys}, key=lambda scene: identifier(problem(scene)))
        self.dts = sorted({dt for _, _, dt in keys}, reverse=True)
        self.labels = {engine: list(dict.fromkeys(label for label, _, _ in one.cases)) for engine, one in self.newest.items()}
        self.engine_of = {label: engine for engine, labels in self.labels.items() for label in labels}
        self.links = {label: f"engine-{engine}.html#{_id(labels, label)}" for engine, labels in self.labels.items() for label in labels}

    def write(self, folder: Path) -> None:
        """Write all pages and badges into an empty folder."""
        (folder / "badges").mkdir()
        self._page(folder, INDEX, "record.html", **self._index())
        for engine in self.newest:
            self._page(folder, f"engine-{engine}.html", "record_engine.html", **self._engine(engine))
            badge = view.badge(engine, self.newest[engine], self.labels[engine][0], self.dts[-1])
            (folder / "badges" / f"{engine}.json").write_text(json.dumps(badge) + "\n", encoding="utf-8")
        for scene in self.scenes:
            self._page(folder, f"scene-{scene}.html", "record_scene.html", **self._scene(scene))

    def _page(self, folder: Path, name: str, template: str, **content: Any) -> None:
        common = {"generator": GENERATOR, "docs": self.docs, "dt": in_ms(self.dts[-1]), "links": self.links}
        (folder / name).write_text(page(template, **common, **content), encoding="utf-8")

    def _index(self) -> dict[str, Any]:
        divisions: list[dict[str, Any]] = []
        for title, is_default in (("calibrated settings", False), ("default settings", True)):
            labels = [label for label in self.engine_of if ("profile=default" in label) == is_default]
            if labels:
                rows = {scene: [self._cell(label, scene, self.dts[-1]) for label in labels] for scene in self.scenes}
                divisions.append({"title": title, "labels": labels, "rows": rows, "charts": [chart_data(self._profiles(labels))]})
        statuses = {cell.status for one in divisions for cells in one["rows"].values() for cell in cells}
        return {
            "divisions": divisions,
            "numbers": {label: number for number, label in enumerate(self.engine_of)},
            "releases": {label: self.newest[engine].name for label, engine in self.engine_of.items()},
            "colours": engine_colours(list(self.engine_of)),
            "statuses": sorted(statuses),
            "quantities": {scene: self._quantity(scene) for scene in self.scenes},
            "engines": {engine: self._overview(engine) for engine in self.newest},
            "unmeasured": [engine for engine in self.releases if engine not in self.newest],
            "summaries": {scene: (identifier(problem(scene)), problem(scene).summary) for scene in self.scenes},
        }

    def _cell(self, label: str, scene: str, dt: float) -> view.Cell:
        engine = self.engine_of[label]
        return view.cell(engine, self.newest[engine], label, scene, dt)

    def _cases(self, label: str) -> Mapping[tuple[str, str, float], findings.Case]:
        return self.newest[self.engine_of[label]].cases

    def _quantity(self, scene: str) -> str:
        """The leading error of a scene, with its unit and, for one with a scale, the scale."""
        metric = leading(scene)
        unit = METRICS[metric].unit
        of = "" if unit in ("1", "rad") else f", scale {scale(problem(scene), unit):.3g} {unit}"
        return f"{metric.replace('_', ' ')}{in_brackets(unit)}{of}"

    def _overview(self, engine: str) -> dict[str, Any]:
        measured = [one.name for one in self.releases[engine] if one.cases]
        return {
            "newest": measured[-1],
            "measured": len(measured),
            "oldest": measured[0],
            "missing": len(self.releases[engine]) - len(measured),
            "changed": list(dict.fromkeys(change.release for change in self.changes[engine])),
        }

    def _engine(self, engine: str) -> dict[str, Any]:
        own, changed = self.releases[engine], self.changes[engine]
        counts = {release: sum(one.release == release for one in changed) for release in view.told(changed)}
        return {
            "engine": engine,
            "overview": self._overview(engine),
            "first": self.newest[engine].first,
            "tables": [self._table(engine, label) for label in self.labels[engine]],
            "told": view.told(changed),
            "before": {change.release: change.before for change in changed},
            "counts": counts,
            "differing": findings.successive(own),
            "missing": [one for one in own if not one.cases],
            "rerun": view.rerun(engine, "RELEASE"),
        }

    def _table(self, engine: str, label: str) -> dict[str, Any]:
        own, changed, dt = self.releases[engine], self.changes[engine], self.dts[-1]
        periods = findings.periods(label, own, changed)
        scenes = [scene for scene in self.scenes if any((label, scene, dt) in one.cases for one in own)]
        return {
            "label": label,
            "id": _id(self.labels[engine], label),
            "summary": view.summary(self.newest[engine], label, dt),
            "periods": [f"{of[0].name} – {of[-1].name}" if len(of) > 1 else of[0].name for of in periods],
            "rows": {scene: [view.cell(engine, of[-1], label, scene, dt) for of in periods] for scene in scenes},
            "since": {scene: view.since(label, scene, own, changed) for scene in scenes},
        }

    def _scene(self, name: str) -> dict[str, Any]:
        scene = problem(name)
        truth = truth_for(scene)
        assert truth is not None
        return {
            "scene": scene,
            "number": identifier(scene),
            "modelled": modelled(scene),
            "truth": truth.statement,
            "quantity": self._quantity(name),
            "definition": METRICS[leading(name)].definition,
            "steps": [in_ms(dt) for dt in self.dts],
            "rows": [
                (label, self.newest[engine].name, list(self._values(label, name)), [self._cell(label, name, dt) for dt in self.dts])
                for label, engine in self.engine_of.items()
            ],
            "plots": [chart_data(self._errors(name))],
        }

    def _values(self, label: str, scene: str) -> Iterator[float]:
        """The leading error of the newest release at each time step; NaN where there is none."""
        for dt in self.dts:
            case = self._cases(label).get((label, scene, dt))
            yield float("nan") if case is None else case.values.get(leading(scene), float("nan"))

    def _errors(self, scene: str) -> Chart:
        """The leading error of all engines, a row for each: markers for the time steps."""
        values = {label: np.abs(list(self._values(label, scene))) for label in self.engine_of}
        shown = [label for label, own in values.items() if np.isfinite(own).any()]
        least = LEAST * scale(problem(scene), METRICS[leading(scene)].unit)
        rows = np.arange(len(shown), dtype=float)
        lines = []
        for place, (dt, (colour, marker)) in enumerate(zip(self.dts, STEP_STYLES, strict=False)):
            errors = np.array([max(values[label][place], least) for label in shown])
            lines.append(Line(f"dt = {in_ms(dt)}", errors, rows, colour, 0.0, marker=marker))
        return Chart(self._quantity(scene).partition(",")[0], "", lines, x_log=True, rows=shown)

    def _profiles(self, labels: Sequence[str]) -> Chart:
        """The performance profiles of a division, at the finest time step."""
        errors = {
            label: [relative_error(self._cases(label).get((label, scene, self.dts[-1])), scene) for scene in self.scenes]
            for label in labels
        }
        found = findings.profile(errors)
        end = 2.0 * max(float(ratios[-1]) for ratios, _ in found.values())
        lines = []
        for label, (colour, marker) in engine_styles(list(self.engine_of)).items():
            if label not in found:
                continue
            ratios, shares = found[label]
            lines.append(Line(label, np.append(ratios, end), np.append(shares, shares[-1]), colour, marker=marker, is_step=True))
        return Chart("τ: error over the smallest error of the scene", "share of scenes within τ", lines, x_log=True)


def _id(labels: Sequence[str], label: str) -> str:
    """The id of the table of an engine with some options, on the engine's page."""
    return f"options-{labels.index(label) + 1}"


def files_of_site(folder: Path) -> set[str]:
    """The files that `dropspin publish` wrote to a folder; empty if it did not write the folder."""
    index = folder / INDEX
    if not index.is_file() or GENERATOR not in index.read_text(encoding="utf-8", errors="replace"):
        return set()
    patterns = (INDEX, "engine-*.html", "scene-*.html", "badges", "badges/*.json")
    return {str(path.relative_to(folder)) for pattern in patterns for path in folder.glob(pattern)}
