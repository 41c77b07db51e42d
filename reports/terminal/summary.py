"""The summary of a run on a terminal: the findings, a matrix of scenes and engines, the failures, and the verdict."""

from collections.abc import Sequence

from rich.cells import cell_len
from rich.console import Console

from dropspin.comparisons.results.results import Results
from dropspin.reports.document import Document, Paragraph, Sentences
from dropspin.reports.stories.check import MOST_PRINTED
from dropspin.reports.stories.failures import failure_parts, grouped
from dropspin.reports.stories.matrix import Matrix, matrix
from dropspin.reports.stories.run import overview
from dropspin.reports.terminal.rows import aligned, print_document, print_sentence
from dropspin.reports.terminal.safe import styled
from dropspin.scenarios.text import counted


def print_summary(results: Results, console: Console | None = None) -> None:
    """Print the findings, a matrix of scenes and engines, the failures, and the verdict."""
    out, summary = console or Console(), overview(results)
    print_document(Document("Findings", [Sentences(summary.findings)]), out)
    _print_matrix(matrix(results, summary.statuses), results.engines, out)
    parts = failure_parts(grouped(results, [failure for failure in summary.failures if not failure.accepted]), MOST_PRINTED)
    if summary.laws:
        differing = counted(len({row["scene"] for row in summary.laws}), "scene")
        others = "the report lists each engine's distances to the other laws, which are not errors."
        parts.insert(0, Paragraph(f"Impact laws differ in {differing}: {others}", style="dim"))
    print_document(Document("Failures", parts, [Paragraph(summary.verdict, style="bold")]), out)


def _print_matrix(found: Matrix, engines: Sequence[str], out: Console) -> None:
    """Print a matrix as wide as the terminal. If it does not fit, engines are numbered instead of named, and then errors are left out."""
    numbers = [str(number + 1) for number in range(len(engines))]
    complete = [[row.scene, row.quantity, *(f"{mark} {value}" for mark, value in row.cells)] for row in found.rows]
    marks = [[row.scene, *(mark for mark, _ in row.cells)] for row in found.rows]
    keys = [f"{number} {engine}" for number, engine in zip(numbers, engines, strict=True)]
    forms = [
        ([], aligned([["scene", found.title, *engines], *complete])),
        (keys, aligned([["scene", found.title, *numbers], *complete])),
        (["Errors are not shown at this width; use a wider terminal.", *keys], aligned([["scene", *numbers], *marks])),
    ]
    notes, lines = next((form for form in forms if not out.is_terminal or max(map(cell_len, form[1])) <= out.width), forms[-1])
    for line, style in zip(lines, ["bold", *("red" if row.fails else "" for row in found.rows)], strict=True):
        out.print(styled(line, style=style), soft_wrap=True)
    for note in filter(None, [*notes, found.legend, found.left_out]):
        print_sentence(note, out, "dim")
