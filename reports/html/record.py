"""The site of a record: a page with the newest releases, a page for each engine and for each scene, and badges."""

import json
from collections.abc import Mapping, Sequence
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
from reports.plots.colours import engine_styles
from reports.views import numbers
from reports.views import record as view
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
    """The pages of a record; the templates read the attributes.

    Args:
        releases: The releases of each engine, oldest first.
        docs: Where the documentation is, relative to the pages, such as `../`; empty for nowhere.
    """

    def __init__(self, releases: Mapping[str, list[Release]], docs: str = "") -> None:
        self.releases, self.docs = releases, docs
        self.measured = {engine: found for engine, own in releases.items() if (found := [one for one in own if one.cases])}
        self.newest = {engine: own[-1] for engine, own in self.measured.items()}
        self.changes: dict[str, list[Change]] = {engine: findings.changes(engine, own) for engine, own in self.measured.items()}
        keys = [key for one in self.newest.values() for key in one.cases]
        self.scenes = {name: problem(name) for name in sorted({key[1] for key in keys}, key=lambda name: identifier(problem(name)))}
        self.dts = sorted({dt for _, _, dt in keys}, reverse=True)
        self.labels = {engine: list(dict.fromkeys(key[0] for key in one.cases)) for engine, one in self.newest.items()}
        self.engines = {label: engine for engine, labels in self.labels.items() for label in labels}
        self.styles = engine_styles(list(self.engines))
        default = [label for label in self.engines if "profile=default" in label]
        divisions = {"calibrated": [label for label in self.engines if label not in default], "default": default}
        self.divisions = {name: labels for name, labels in divisions.items() if labels}
        self.identifier, self.view = identifier, view

    def write(self, folder: Path) -> None:
        """Write all pages and badges into an empty folder."""
        statuses = {self.cell(label, scene).status for label in self.engines for scene in self.scenes}
        self._write(folder / INDEX, "record.html", statuses=sorted(statuses))
        (folder / "badges").mkdir()
        for engine, newest in self.newest.items():
            about = {"changed": view.change_sentences(self.changes[engine]), "differing": findings.successive(self.measured[engine])}
            self._write(folder / f"engine-{engine}.html", "record_engine.html", engine=engine, newest=newest, **about)
            badge = view.badge(engine, newest, self.labels[engine][0], self.dts[-1])
            (folder / "badges" / f"{engine}.json").write_text(json.dumps(badge) + "\n", encoding="utf-8")
        for name, scene in self.scenes.items():
            known = {"modelled": modelled(scene), "truth": truth_for(scene), "definition": METRICS[leading(name)].definition}
            self._write(folder / f"scene-{name}.html", "record_scene.html", scene=scene, **known)

    def _write(self, file: Path, template: str, **content: Any) -> None:
        file.write_text(page(template, site=self, step=numbers.in_ms(self.dts[-1]), **content), encoding="utf-8")

    def link(self, label: str) -> str:
        """The address of the table of a label."""
        engine = self.engines[label]
        return f"engine-{engine}.html#options-{self.labels[engine].index(label) + 1}"

    def cell(self, label: str, scene: str, dt: float = 0.0, release: Release | None = None) -> view.Cell:
        """A cell of a table; by default of the newest release at the finest time step."""
        engine = self.engines[label]
        return view.cell(engine, release or self.newest[engine], label, scene, dt or self.dts[-1])

    def value(self, label: str, scene: str, dt: float) -> float:
        """The leading error of the newest release; NaN where there is none."""
        case = self.newest[self.engines[label]].cases.get((label, scene, dt))
        return float("nan") if case is None else case.values.get(leading(scene), float("nan"))

    def periods(self, label: str) -> list[list[Release]]:
        """Successive releases between which nothing changed."""
        engine = self.engines[label]
        return findings.periods(label, self.releases[engine], self.changes[engine])

    def since(self, label: str, scene: str) -> str:
        """The release since which nothing changed in a scene."""
        engine = self.engines[label]
        return view.since(label, scene, self.measured[engine], self.changes[engine])

    def quantity(self, scene: str) -> str:
        """The leading error of a scene, with its unit and, for one with a scale, the scale."""
        metric, unit = leading(scene), METRICS[leading(scene)].unit
        of = "" if unit in ("1", "rad") else f", scale {scale(problem(scene), unit):.3g} {unit}"
        return f"{metric.replace('_', ' ')}{numbers.unit(unit)}{of}"

    def errors(self, scene: str) -> dict[str, Any]:
        """The plot of the leading error of all engines, a row for each: markers for the time steps."""
        shown = [label for label in self.engines if any(np.isfinite(self.value(label, scene, dt)) for dt in self.dts)]
        least, rows, lines = LEAST * scale(problem(scene), METRICS[leading(scene)].unit), np.arange(len(shown), dtype=float), []
        for dt, (colour, marker) in zip(self.dts, STEP_STYLES, strict=False):
            sizes = np.array([np.maximum(abs(self.value(label, scene, dt)), least) for label in shown])
            lines.append(Line(f"dt = {numbers.in_ms(dt)}", sizes, rows, colour, 0.0, marker=marker))
        return chart_data(Chart(self.quantity(scene).partition(",")[0], "", lines, x_log=True, rows=shown))

    def profiles(self, labels: Sequence[str]) -> dict[str, Any]:
        """The plot of performance profiles at the finest time step."""
        cases = {label: self.newest[self.engines[label]].at(label, self.dts[-1]) for label in labels}
        found = findings.profile({label: [relative_error(own.get(scene), scene) for scene in self.scenes] for label, own in cases.items()})
        end = 2.0 * max(float(ratios[-1]) for ratios, _ in found.values())
        lines = []
        for label, (ratios, shares) in found.items():
            colour, marker = self.styles[label]
            lines.append(Line(label, np.append(ratios, end), np.append(shares, shares[-1]), colour, marker=marker, is_step=True))
        return chart_data(Chart("τ: error over the smallest error of the scene", "share of scenes within τ", lines, x_log=True))


def files_of_site(folder: Path) -> set[str]:
    """The files that `dropspin publish` wrote to a folder; empty if it did not write the folder."""
    index = folder / INDEX
    if not index.is_file() or GENERATOR not in index.read_text(encoding="utf-8", errors="replace"):
        return set()
    patterns = (INDEX, "engine-*.html", "scene-*.html", "badges", "badges/*.json")
    return {str(path.relative_to(folder)) for pattern in patterns for path in folder.glob(pattern)}
