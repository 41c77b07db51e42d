"""`dropspin check` and `dropspin accept`."""

from typing import TYPE_CHECKING

import click

from reports.verbs.options import as_json, baseline_option, summary_option, write_text

if TYPE_CHECKING:
    from comparisons.regressions.checking import Checked
    from reports.failing import Failing
    from reports.gate import Held

BASELINE = "dropspin-baseline.toml"


@click.command()
@click.argument("run", metavar="RUN")
@baseline_option
@click.option("--junit", metavar="FILE", help="Write all that was judged as JUnit XML, which CI servers read.")
@summary_option
@as_json
def check(run: str, baseline: str | None, junit: str | None, summary: str | None, json_output: bool) -> int:
    """Judge a run: by what its scenes expect, and by accepted figures.

    RUN is the folder that dropspin run -o wrote.

    Exit code: 0 nothing failed, 1 a check failed or an accepted figure is worse, 2 bad input, 3 an engine broke down or is missing.
    """
    from pathlib import Path

    from comparisons.regressions.baseline import load_baseline
    from comparisons.regressions.checking import check as checked_against
    from comparisons.store import restore
    from reports import gate
    from reports.failing import failing
    from reports.junit import junit_xml
    from reports.terminal import json_rows

    results = restore(Path(run), arrays=False)
    held = None if baseline is None else gate.Held(load_baseline(baseline), baseline, run)
    checked = checked_against(results, None if held is None else held.baseline)
    found = failing(checked.results, baseline)
    if junit is not None:
        write_text(junit, junit_xml(checked.results, baseline).decode())
    if summary is not None:
        write_text(summary, gate.summary(checked, held, found), append=True)
    if json_output:
        click.echo(json_rows(checked.results.frame))
    else:
        tell(checked, held, found)
    return checked.results.exit_code()


def tell(checked: "Checked", held: "Held | None", found: "list[Failing]") -> None:
    """Print what failed, then what came of the check; in GitHub's runners annotations too."""
    from reports import gate
    from reports.tables import print_failing

    print_failing(found, gate.AT_MOST)
    for sentence in gate.sentences(checked, held):
        click.echo(sentence)
    for command in gate.annotations(found):
        click.echo(command)


@click.command()
@click.argument("runs", metavar="RUN...", nargs=-1, required=True)
@click.option("--reason", required=True, metavar="TEXT", help="Why these are the figures from now on; it stands in the file.")
@click.option(
    "--baseline", default=BASELINE, show_default=True, metavar="FILE", help="The file of accepted figures; made if there is none."
)
@click.option(
    "--known-failures", is_flag=True, help="Accept failing checks as known: they do not fail as long as their figures get no worse."
)
@as_json
def accept(runs: tuple[str, ...], reason: str, baseline: str, known_failures: bool, json_output: bool) -> None:
    """Accept a run's figures as what figures should be: move the baseline, on purpose.

    Figures that have not moved beyond their tolerance stay as they are in the file, as do those that RUN is not of.
    """
    import datetime
    import os
    from pathlib import Path

    import pandas as pd

    from comparisons.regressions.baseline import Baseline, load_baseline, write_baseline
    from comparisons.regressions.baseline import accept as accepted_with
    from comparisons.store import restore
    from reports.gate import accepted_sentences
    from reports.terminal import json_rows
    from scenarios import DropspinError

    if not reason.strip():
        raise click.UsageError("--reason is empty; say why these are the figures from now on.")
    if not reason.isprintable():
        raise click.UsageError("--reason: has signs that are no text, or more than one line; say it in one line of text.")
    held = load_baseline(baseline) if os.path.exists(baseline) else Baseline()
    changes, told = [], []
    for run in runs:
        results = restore(Path(run), arrays=False)
        held, found = accepted_with(results, held, reason.strip(), datetime.date.today(), known_failures=known_failures)
        changes.append(found)
        told += accepted_sentences(results, found, known_failures)
    if held.figures.empty:
        raise DropspinError(f"{', '.join(runs)}: nothing to accept: no engine measured a figure; {baseline} is not written.")
    write_baseline(held, baseline)
    if json_output:
        click.echo(json_rows(pd.concat(changes)))
        return
    for sentence in told:
        click.echo(sentence)
    click.echo(f"Written: {baseline}, {len(held.figures):,} figures. Look at its difference, and commit it.")
