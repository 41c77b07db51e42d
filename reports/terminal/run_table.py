"""A run on a terminal: for each scene a table with a column for each engine, and the summary."""

from typing import TYPE_CHECKING

from dropspin.comparisons.results.results import Results
from dropspin.reports.stories.run import document, overview, unexpected_failures
from dropspin.reports.stories.run_tables import scene_parts
from dropspin.reports.terminal.rows import print_document

if TYPE_CHECKING:
    from rich.console import Console


def print_table(results: Results, console: "Console | None" = None, *, summary_only: bool = False) -> None:
    """Print every metric of every engine at the smallest time step, the largest difference between independent engines, and the summary.

    Args:
        results: The run.
        console: The Rich console to print to; None for standard output.
        summary_only: Whether to print only the summary.
    """
    summary, tables = overview(results), [] if summary_only else scene_parts(results)
    print_document(document(results, summary, tables, unexpected_failures(results, summary)), console)
