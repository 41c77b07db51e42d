"""The site of a record: a page with the newest releases, a page for each engine and for each scene, and badges."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dropspin.comparisons.engines.options import calibrated_label
from dropspin.comparisons.judging.verdicts import BREAKDOWNS
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.tolerances import scale
from dropspin.comparisons.record import findings
from dropspin.comparisons.record.findings import Case, Change, Other, Release, leading, problem, relative_error
from dropspin.reports.pages import page
from dropspin.reports.plots.chart import Chart, Line
from dropspin.reports.plots.chart_data import chart_data
from dropspin.reports.plots.colours import engine_styles, human_label
from dropspin.reports.stories import numbers
from dropspin.reports.stories import record as view
from dropspin.scenarios import truth_for
from dropspin.scenarios.problems import identifier

GENERATOR = '<meta name="generator" content="dropspin record publish">'
INDEX = "index.html"
LEAST = 1e-16
"""Relative error at which an exact zero is drawn."""
NO_CASE = Case("not measured", "", "", {})


class Site:
    """The pages of a record; the templates read the attributes.

    Args:
        releases: The releases of each engine, oldest first.
        others: What others measured of each engine.
        docs: Where the documentation is, relative to the pages, such as `../`; empty for nowhere.
    """

    def __init__(self, releases: Mapping[str, list[Release]], others: Mapping[str, list[Other]], docs: str = "") -> None:
        self.releases, self.others, self.docs = releases, others, docs
        self.measured = {engine: found for engine, own in releases.items() if (found := [one for one in own if one.cases])}
        self.newest = {engine: own[-1] for engine, own in self.measured.items()}
        self.changes: dict[str, list[Change]] = {engine: findings.changes(engine, own) for engine, own in self.measured.items()}
        keys = [key for one in self.newest.values() for key in one.cases]
        self.scenes = {name: problem(name) for name in sorted({key[1] for key in keys}, key=lambda name: identifier(problem(name)))}
        self.dts = sorted({dt for _, _, dt in keys}, reverse=True)
        self.labels = {engine: self.labels_of(one) for engine, one in self.newest.items()}
        self.engines = {label: engine for engine, labels in self.labels.items() for label in labels}
        self.styles = engine_styles(list(self.engines))
        divisions = numbers.grouped(self.engines, lambda label: "calibrated" if calibrated_label(label) is None else "default")
        self.divisions = dict(sorted(divisions.items()))
        self.view = view

    def write(self, folder: Path) -> None:
        """Write all pages and badges into an empty folder."""
        statuses = {self.cell(label, scene).status for label in self.engines for scene in self.scenes}
        self._write(folder / INDEX, "record.html", statuses=sorted(statuses))
        (folder / "badges").mkdir()
        for engine, newest in self.newest.items():
            about = {"changed": view.change_sentences(self.changes[engine]), "differing": findings.successive(self.measured[engine])}
            self._write(folder / f"engine-{engine}.html", "record_engine.html", engine=engine, newest=newest, **about)
            for release in self.measured[engine]:
                self._write(folder / self.page_of(engine, release.name), "record_release.html", engine=engine, release=release, **about)
            badge = view.badge(engine, newest, self.labels[engine][0], self.dts[-1])
            (folder / "badges" / f"{engine}.json").write_text(json.dumps(badge) + "\n", encoding="utf-8")
        for name, scene in self.scenes.items():
            known = {"truth": truth_for(scene), "definition": METRICS[leading(name)].definition}
            self._write(folder / f"scene-{name}.html", "record_scene.html", scene=scene, **known)

    def _write(self, file: Path, template: str, **content: Any) -> None:
        file.write_text(page(template, site=self, step=numbers.in_ms(self.dts[-1]), **content), encoding="utf-8")

    def page_of(self, engine: str, release: str) -> str:
        """The address of the page of a release, by its name."""
        return f"release-{engine}-{release}.html"

    def labels_of(self, release: Release) -> list[str]:
        """The engine with each set of options that a release was measured with."""
        return list(dict.fromkeys(label for label, _, _ in release.cases))

    def with_results(self, engine: str) -> int:
        """The number of releases of an engine that have a result."""
        return sum(any(case.verdict == "measured" for case in one.cases.values()) for one in self.measured[engine])

    def remarks(self, scene: str) -> list[str]:
        """The limitations of engines in a scene, and why engines have no result, at the finest time step."""
        return view.remarks({label: self.case(label, scene, self.dts[-1]) for label in self.engines})

    def link(self, label: str) -> str:
        """The address of the table of a label."""
        engine = self.engines[label]
        return f"engine-{engine}.html#options-{self.labels[engine].index(label) + 1}"

    def cell(self, label: str, scene: str, dt: float = 0.0, release: Release | None = None) -> view.Cell:
        """A cell of a table; by default of the newest release at the finest time step."""
        engine = self.engines[label]
        return view.cell(release or self.newest[engine], label, scene, dt or self.dts[-1])

    def periods(self, label: str) -> list[list[Release]]:
        """Successive releases between which nothing changed."""
        engine = self.engines[label]
        return findings.periods(label, self.releases[engine], self.changes[engine])

    def since(self, label: str, scene: str) -> str:
        """The release since which nothing changed in a scene."""
        engine = self.engines[label]
        moved = [change.release for change in self.changes[engine] if (change.label, change.scene) == (label, scene)]
        first = (release.name for release in self.measured[engine] if any(key[:2] == (label, scene) for key in release.cases))
        return moved[-1] if moved else f"{next(first)}, the oldest"

    def quantity(self, scene: str) -> str:
        """The leading error of a scene, with its unit and, for one with a scale, the scale."""
        metric, unit = leading(scene), METRICS[leading(scene)].unit
        of = "" if unit in ("1", "rad") else f", scale {scale(problem(scene), unit):.3g} {unit}"
        return f"{metric.replace('_', ' ')}{numbers.unit(unit)}{of}"

    def case(self, label: str, scene: str, dt: float) -> Case:
        """The newest release in a scene."""
        return self.newest[self.engines[label]].cases.get((label, scene, dt), NO_CASE)

    def has_starts(self, scene: str) -> bool:
        """Whether some engine was measured from several starts."""
        return any(self.view.sizes(self.case(label, scene, dt)) for label in self.engines for dt in self.dts)

    def work_precision(self, scene: str) -> dict[str, Any]:
        """The plot of the leading error of all engines over the cost of their steps, with ranges over starts and over timings."""
        metric, lines = leading(scene), []
        least = LEAST * scale(problem(scene), METRICS[metric].unit)
        for label in self.engines:
            cases = [case for dt in self.dts if not np.isnan((case := self.case(label, scene, dt)).cost)]
            if not cases:
                continue
            x, median = np.array([(case.cost, case.median_cost) for case in cases]).T
            y, low, high = np.maximum(np.abs([(case.values.get(metric, np.nan), case.low, case.high) for case in cases]), least).T
            style = self.styles[label]
            gap = np.full(len(x), np.nan)
            across, along = np.array([x, x, x, x, median, x]).T.ravel(), np.array([low, high, gap, y, y, gap]).T.ravel()
            lines += [Line(label, x, y, **style._asdict()), Line(label, across, along, style.colour, 1.0)]
        error = self.quantity(scene).partition(",")[0]
        return chart_data(Chart("wall time per simulated second [s]", error, lines, x_log=True, y_log=True))

    def profiles(self, labels: Sequence[str]) -> dict[str, Any]:
        """The plot of performance profiles at the finest time step."""
        cases = {label: self.newest[self.engines[label]].at(label, self.dts[-1]) for label in labels}

        def error(case: Case | None, scene: str) -> float:
            return np.inf if case and case.verdict in BREAKDOWNS else relative_error(case, scene)

        errors = {label: [error(of_label.get(scene), scene) for scene in self.scenes] for label, of_label in cases.items()}
        profiles = findings.profile(errors)
        end = 2.0 * max(float(ratios[-1]) for ratios, _ in profiles.values())
        lines = []
        for label, (ratios, shares) in profiles.items():
            style = self.styles[label]._asdict()
            lines.append(Line(label, np.append(ratios, end), np.append(shares, shares[-1]), **style, is_sparse=True, is_step=True))
        counts = ", ".join(f"{human_label(label)} {np.count_nonzero(~np.isnan(errors[label]))}" for label in profiles)
        remark = f"Scenes that count for each engine: {counts}."
        return chart_data(
            Chart("τ: error over the smallest error of the scene", "share of scenes within τ", lines, x_log=True, remark=remark)
        )


def files_of_site(folder: Path) -> set[str]:
    """The files that `dropspin record publish` wrote to a folder; empty if it did not write the folder."""
    index = folder / INDEX
    if not index.is_file() or GENERATOR not in index.read_text(encoding="utf-8", errors="replace"):
        return set()
    patterns = (INDEX, "engine-*.html", "release-*.html", "scene-*.html", "badges", "badges/*.json")
    return {str(path.relative_to(folder)) for pattern in patterns for path in folder.glob(pattern)}
