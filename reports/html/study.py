"""The page of a study as one HTML file."""

from dropspin.reports.document import Document
from dropspin.reports.pages import page


def study_page(document: Document) -> str:
    """The page of a document that has no run beside it."""
    return page("study.html", section=document)
