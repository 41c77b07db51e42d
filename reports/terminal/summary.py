"""The summary of a run on a terminal: the findings, a matrix of scenes and engines, the failures, and the verdict."""

from collections.abc import Sequence

from rich.cells import cell_len
from rich.console import Console

from dropspin.comparisons.results.results import Results
from dropspin.reports.terminal.rows import aligned, print_sentence
from dropspin.reports.terminal.safe import styled
from dropspin.reports.views.failures import FailureGroup, grouped
from dropspin.reports.views.matrix import Matrix, matrix
from dropspin.reports.views.run import overview
from dropspin.scenarios.text import counted

MOST_SENTENCES = 6
"""Largest number of sentences on the failures of one engine; JUnit, JSON and the report have all failures."""


def print_summary(results: Results, console: Console | None = None) -> None:
    """Print the findings, a matrix of scenes and engines, the failures, and the verdict."""
    out, summary = console or Console(), overview(results)
    for sentence in summary.findings:
        print_sentence(sentence, out)
    _print_matrix(matrix(results, summary.statuses), results.engines, out)
    if summary.laws:
        differing = counted(len({row["scene"] for row in summary.laws}), "scene")
        print_sentence(
            f"Impact laws differ in {differing}: the report lists each engine's distances to the other laws, which are not errors.",
            out,
            "dim",
        )
    print_failures(grouped(results, [one for one in summary.failures if not one.accepted]), out)
    print_sentence(summary.verdict, out, "bold")


def print_failures(groups: Sequence[FailureGroup], console: Console | None = None) -> None:
    """Print the failures of each engine, what explains them first, with one command that reproduces them."""
    out = console or Console()
    for group in groups:
        if group.consistent_with:
            print_sentence(group.consistent_with, out, "red")
        for sentence in group.sentences[:MOST_SENTENCES]:
            print_sentence(f"✗ {sentence}", out, "red")
        if len(group.sentences) > MOST_SENTENCES:
            print_sentence(f"✗ {group.engine} has {counted(len(group.sentences) - MOST_SENTENCES, 'more failure')}.", out, "red")
        out.print(styled(f"Reproduce: {group.reproduce}"), soft_wrap=True)  # a command is one line


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
