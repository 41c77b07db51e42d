"""The files that a study writes: tables as CSV and JSON, a Markdown page, pictures, and `section.json`, from which a report reads it."""

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from dropspin.comparisons.regressions.history import History
from dropspin.comparisons.results.complete_folders import SECTION, file_name, read_stored, study_folder
from dropspin.reports.document import Charts, Document
from dropspin.reports.markdown import markdown
from dropspin.reports.output import write_table
from dropspin.reports.pages import page
from dropspin.reports.plots.chart_data import chart_data
from dropspin.reports.plots.figure import figure_of, save_figure
from dropspin.reports.stories.history import document as history_document
from dropspin.reports.stories.study import Study
from dropspin.reports.terminal.rows import print_json_or
from dropspin.scenarios import DropspinError, Scenario

TOSSES = "tosses.json"
"""The file with the tosses of the scenes beside it."""


@contextmanager
def written_study(output: str, json_output: bool, *, has_report: bool = False) -> Iterator[Callable[[Study], Path]]:
    """A function that writes a study into the folder `output`, and returns the unfinished folder for other files; then it is printed.

    Args:
        output: The folder.
        json_output: Whether to print the rows as JSON, or the page.
        has_report: Whether to write the rows as Parquet too, and `report.html`.
    """
    kept: list[tuple[Study, Document]] = []
    with study_folder(output) as folder:

        def keep(study: Study) -> Path:
            kept.append((study, write_study(study, folder, has_report=has_report)))
            return folder

        yield keep
    for study, document in kept:
        name = "report.html" if has_report else f"{study.study}.md"
        print_json_or(json_output, study.rows(), document, os.path.join(output, name))


def write_study(study: Study, folder: Path, *, has_report: bool = False) -> Document:
    """Write the files of a study, as `written_study` does, and return its page."""
    document = study.document()
    write_table(folder, study.study, study.rows())
    write_page(document, folder, study.study)
    (folder / SECTION).write_text(study.model_dump_json(indent=1), encoding="utf-8")
    if has_report:
        import pyarrow as pa
        import pyarrow.parquet as pq

        pq.write_table(pa.Table.from_pylist(study.rows()), folder / f"{study.study}.parquet")
        (folder / "report.html").write_text(page("study.html", section=document), encoding="utf-8")
    return document


def write_scenes(scene: Scenario, folder: Path) -> None:
    """Write the scene of all tosses of a recording and that of each toss as TOML files, with the tosses as JSON, into a new folder."""
    assert scene.recording is not None
    folder.mkdir()
    (folder / TOSSES).write_text(scene.recording.model_dump_json(), encoding="utf-8")
    values = scene.model_dump(mode="json", exclude_none=True, include={"body", "gravity", "floor"})
    write_toml({"duration": scene.duration, **values, "recording": {"file": TOSSES}}, folder / "tosses.toml")
    for toss in scene.recording.tosses:
        content = values | {"recording": {"file": TOSSES, "toss": toss.name}}
        write_toml(content, folder / f"{file_name(f'toss-{toss.name}')}.toml")


def write_toml(content: Mapping[str, Any], file: Path) -> None:
    """Write a scene or a header as TOML."""
    import tomlkit

    file.write_text(tomlkit.dumps(content), encoding="utf-8")


def write_history(history: History, folder: Path) -> Document:
    """Write every result of every run as `history.csv` and `history.json`, `history.md` with a plot per scene, and return the page."""
    results = history.results.drop(columns="verdict").assign(run=[history.names[number] for number in history.results["run"]])
    write_table(folder, "history", results.merge(history.stamps, on="run").to_dict("records"))
    document = history_document(history)
    write_page(document, folder, "history")
    return document


def write_page(document: Document, folder: Path, stem: str) -> None:
    """Write a Markdown page and its pictures."""
    for part in document.parts:
        if isinstance(part, Charts):
            save_figure(figure_of(part.charts), folder / f"{file_name(part.name)}.svg")
    (folder / f"{stem}.md").write_text(markdown(document), encoding="utf-8")


def read_study(folder: str) -> Document:
    """The page of a study, made from what its folder keeps; somebody else may have written it.

    Raises:
        DropspinError: The folder has no study, or one from which no page can be made.
    """
    from dropspin.reports.stories.diagnose import Diagnosed
    from dropspin.reports.stories.limits import Limits
    from dropspin.reports.stories.log_check import CheckedLog
    from dropspin.reports.stories.log_compare import ComparedLog
    from dropspin.reports.stories.log_fit import FittedLog
    from dropspin.reports.stories.reproduce import Reproduction
    from dropspin.reports.stories.symmetries import Symmetries
    from dropspin.reports.stories.tradeoff import TradeOffs

    kinds = CheckedLog | ComparedLog | Diagnosed | FittedLog | Limits | Reproduction | Symmetries | TradeOffs
    studies: TypeAdapter[Study] = TypeAdapter(Annotated[kinds, Field(discriminator="study")])
    try:
        document = studies.validate_json(read_stored(Path(folder), SECTION)).document()
        charts = [chart_data(chart) for part in document.parts if isinstance(part, Charts) for chart in part.charts]
        json.dumps(charts, allow_nan=False)
    except (OSError, ValueError, ArithmeticError, LookupError, StopIteration) as error:
        raise DropspinError(
            f"{folder}: has no study, or a damaged one ({SECTION}: {_detail(error)}); "
            "give a folder that dropspin diagnose, limits, log, reproduce, symmetries or tradeoff wrote with -o."
        ) from None
    return document


def _detail(error: Exception) -> str:
    if isinstance(error, ValidationError):
        problem = error.errors(include_url=False)[0]
        return ".".join(map(str, [*problem["loc"], problem["msg"]]))
    return str(getattr(error, "strerror", None) or error or type(error).__name__).removesuffix(".")
