"""The summary of a run on a terminal: the findings, a matrix of scenes and engines, the failures, and the verdict."""

import math
from collections.abc import Mapping

from rich.cells import cell_len
from rich.console import Console

from dropspin.comparisons.judging.verdicts import BREAKDOWNS, FAILURES
from dropspin.comparisons.results.results import Results, Status
from dropspin.reports.document import Document, Paragraph, Sentences
from dropspin.reports.stories.failures import failure_parts
from dropspin.reports.stories.matrix import leading_errors, legend_of_marks, shown_scenes
from dropspin.reports.stories.numbers import formatted, in_ms, quantity, unit
from dropspin.reports.stories.run import overview
from dropspin.reports.terminal.rows import aligned, print_document, print_sentence
from dropspin.reports.terminal.safe import styled
from dropspin.scenarios.text import counted


def print_summary(results: Results, console: Console | None = None) -> None:
    """Print the findings, a matrix of scenes and engines, the failures, and the verdict."""
    out, summary = console or Console(), overview(results)
    print_document(Document("Findings", [Sentences(summary.findings)]), out)
    _print_matrix(results, summary.statuses, out)
    parts = failure_parts(results, [failure for failure in summary.failures if not failure.accepted])
    if summary.laws:
        differing = counted(len({row["scene"] for row in summary.laws}), "scene")
        others = "the report lists each engine's distances to the other laws, which are not errors."
        parts.insert(0, Paragraph(f"Impact laws differ in {differing}: {others}", style="dim"))
    print_document(Document("Failures", parts, [Paragraph(summary.verdict, style="bold")]), out)


def _print_matrix(results: Results, statuses: Mapping[str, Mapping[str, Status]], out: Console) -> None:
    """Print a row for each scene with the mark of the status and the leading error of each engine.

    The matrix is as wide as the terminal. If it does not fit, engines are numbered instead of named, and then errors are left out.
    """
    scenes, left_out = shown_scenes(statuses)
    leading, rows, marks, styles = leading_errors(results), [], [], ["bold"]
    for scene in scenes:
        errors, by_engine = leading.get(scene), statuses[scene]
        sizes = {engine: formatted(size) for engine, size in errors.sizes.items() if not math.isnan(size)} if errors else {}
        values = [f"{status.mark} {sizes.get(engine, '')}" for engine, status in by_engine.items()]
        rows.append([scene, quantity(errors.metric) + unit(errors.unit) if errors else "", *values])
        marks.append([scene, *(status.mark for status in by_engine.values())])
        styles.append("red" if any(status.verdict in FAILURES | BREAKDOWNS for status in by_engine.values()) else "")
    steps = sorted({in_ms(errors.dt) for errors in leading.values()})
    title = f"error at dt = {' or '.join(steps)}" if steps else ""
    numbers = [str(number) for number in range(1, len(results.engines) + 1)]
    keys = list(map(" ".join, zip(numbers, results.engines, strict=True)))
    forms = [
        ([], aligned([["scene", title, *results.engines], *rows])),
        (keys, aligned([["scene", title, *numbers], *rows])),
        (["Errors are not shown at this width; use a wider terminal.", *keys], aligned([["scene", *numbers], *marks])),
    ]
    notes, lines = next((form for form in forms if not out.is_terminal or max(map(cell_len, form[1])) <= out.width), forms[-1])
    for line, style in zip(lines, styles, strict=True):
        out.print(styled(line, style=style), soft_wrap=True)
    for note in filter(None, [*notes, legend_of_marks({scene: statuses[scene] for scene in scenes}), left_out]):
        print_sentence(note, out, "dim")
