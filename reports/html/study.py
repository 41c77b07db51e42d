"""The files of a study that has no run beside it, with its page as one HTML file."""

from pathlib import Path

from dropspin.reports.document import Document
from dropspin.reports.pages import page
from dropspin.reports.stories.study import Study
from dropspin.reports.study_files import write_parquet, write_study


def write_study_and_page(study: Study, folder: Path) -> Document:
    """Write the files of a study, its rows as Parquet too, and `report.html`."""
    document = write_study(study, folder)
    write_parquet(study, folder)
    (folder / "report.html").write_text(page("study.html", section=document), encoding="utf-8")
    return document
