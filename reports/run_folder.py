"""The folder of a run. It is written completely or not at all, and replaces only an earlier run."""

import os
import shutil
from collections.abc import Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from pathlib import Path

from dropspin.comparisons.results.complete_folders import read_stored, replaced_folder
from dropspin.comparisons.results.results import Results
from dropspin.comparisons.results.run_file import ARRAY_FILE, FILE, parsed
from dropspin.comparisons.results.store import load_results, save
from dropspin.reports.document import Document
from dropspin.reports.html.report import html_report
from dropspin.reports.junit import junit_xml
from dropspin.reports.markdown import markdown
from dropspin.reports.plots.figure import save_charts
from dropspin.reports.plots.run_charts import CHARTS, report_charts
from dropspin.reports.stories.run import document, overview

OURS = frozenset(
    {"run.json", "results.parquet", "results.csv", "report.html", "report.md", "replay.html", "junit.xml", "plots"}
    | {"trajectories", "ensembles"}
)

PLOT_FILES = ("svg", "png", "pdf", "csv")
"""The formats of plots as files; CSV for their data."""


def write_report(results: Results, folder: str | Path, sections: Sequence[Document] = ()) -> Path:
    """Write the data and the reports of a run to a folder. An earlier run in the same folder is replaced.

    Args:
        results: The run.
        folder: The folder; it is created if it does not exist.
        sections: Studies to include in the report.

    Returns:
        The path of report.html.

    Raises:
        DropspinError: The folder has files that do not belong to a run, or cannot be written.
    """
    with run_folder(folder) as unfinished:
        fill(results, unfinished, sections)
    return Path(folder) / "report.html"


def fill(results: Results, folder: Path, sections: Sequence[Document] = (), plots: Collection[str] = ()) -> None:
    """Write the data and the reports of a run into an empty folder, and its plots as files of some `PLOT_FILES`."""
    summary = overview(results)
    with ThreadPoolExecutor(1) as writer:  # the page is written while the motions are compressed
        saved = writer.submit(save, results, folder, summary.conclusion)
        charts_of = report_charts(results)
        (folder / "report.html").write_text(html_report(results, summary, charts_of, sections), encoding="utf-8")
        saved.result()
    results.table.to_csv(folder / "results.csv", index=False)
    (folder / "report.md").write_text(markdown(document(results, summary), level=2), encoding="utf-8")
    (folder / "junit.xml").write_bytes(junit_xml(results))
    if plots:
        (folder / "plots").mkdir()
    for kind in plots:
        for number, scene in enumerate(results.scenes):
            for name, charts in charts_of.get(scene, {}).items():
                save_charts(charts, folder / "plots" / f"{number:02d}-{name}.{kind}")


def run_folder(folder: str | Path) -> AbstractContextManager[Path]:
    """`replaced_folder` for a run."""
    return replaced_folder(folder, _files_of_run, "run")


PARTS = "[0-9]*"


class MeasuredScenes:
    """The results of the scenes that were already measured, stored beside the folder of the run.

    If a run is interrupted or killed, they stay there for `--resume`; a run that succeeds removes them.
    """

    def __init__(self, folder: str | Path) -> None:
        target = Path(os.path.realpath(folder))
        self._path = target.parent / f".{target.name[:100]}-measured"

    def keep(self, part: Results) -> None:
        """Write the results of a scene, completely or not at all."""
        [scene] = part.scenes
        with run_folder(self._path / f"{len(self):03d}-{part.scenes[scene].digest}") as folder:
            save(part, folder, compress=False)  # a run that succeeds writes all of them again

    def __len__(self) -> int:
        return len(list(self._path.glob(PARTS)))

    def parts(self) -> list[Results]:
        """The stored results, by scene."""
        return [load_results(path) for path in sorted(self._path.glob(PARTS))]

    def clear(self) -> None:
        """Remove the stored results."""
        shutil.rmtree(self._path, ignore_errors=True)


def _files_of_run(folder: Path) -> set[str]:
    """The files that a run wrote to its folder; empty if the folder has no run."""
    try:
        content = parsed(read_stored(folder, FILE))
        arrays, scenes = {*filter(ARRAY_FILE.fullmatch, [*content["trajectories"], *content["ensembles"]])}, content["scenes"]
    except (OSError, ValueError, TypeError, KeyError):
        return set()
    plots = {f"plots/{number:02d}-{kind}.{ending}" for number in range(len(scenes)) for kind in CHARTS for ending in PLOT_FILES}
    return {*OURS, *arrays, *plots}
