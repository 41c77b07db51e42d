"""`dropspin check`."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dropspin.reports.commands.options import BASELINE, as_json, summary_option, write_text
from dropspin.reports.terminal.safe import echo

if TYPE_CHECKING:
    from dropspin.comparisons.regressions.checking import Checked
    from dropspin.reports.views.check import BaselineFile
    from dropspin.reports.views.failures import Failure


@click.command("check")
@click.argument("run", metavar="RUN")
@click.option("--baseline", metavar="FILE", help=f"The baseline. [default: {BASELINE}, which dropspin accept writes, if it exists]")
@click.option("--no-baseline", is_flag=True, help=f"Check the expectations of the scenes only, even if there is a {BASELINE}.")
@click.option("--junit", metavar="FILE", help="Write a test case for every check as JUnit XML, the format that CI servers read.")
@summary_option
@as_json
def check_command(run: str, baseline: str | None, no_baseline: bool, junit: str | None, summary: str | None, json_output: bool) -> int:
    """Check a run: compare it with the expectations of its scenes, and with the accepted results of a baseline.

    RUN is the folder that dropspin run -o wrote. The output says which baseline was used.

    Exit code: 0 nothing failed, 1 a check failed or an accepted result is worse, 2 bad input, 3 an engine broke down or is missing.
    """
    from dropspin.comparisons.regressions.baseline import load_baseline
    from dropspin.comparisons.regressions.checking import check
    from dropspin.comparisons.results.store import load_results
    from dropspin.reports.junit import junit_xml
    from dropspin.reports.markdown import check_markdown
    from dropspin.reports.terminal.rows import json_rows
    from dropspin.reports.views import check as view
    from dropspin.reports.views.failures import failures
    from dropspin.scenarios import DropspinError

    if baseline is not None and no_baseline:
        raise click.UsageError("--baseline names a baseline and --no-baseline leaves it out; give only one of them.")
    if baseline is None and not no_baseline and os.path.lexists(BASELINE):
        baseline = BASELINE
    results = load_results(Path(run), arrays=False)
    file = None if baseline is None else view.BaselineFile(load_baseline(baseline), baseline, run)
    try:
        checked = check(results, None if file is None else file.baseline)
    except DropspinError as error:
        raise DropspinError(f"{baseline}: {error} With --no-baseline, only the expectations of the scenes are checked.") from None
    found = failures(checked.results, baseline)
    if junit is not None:
        write_text(junit, junit_xml(checked.results, baseline).decode())
    if summary is not None:
        write_text(summary, check_markdown(checked, file, found), append=True)
    if json_output:
        echo(json_rows(checked.results.table))
    else:
        print_checked(checked, file, found)
    return checked.results.exit_code()


def print_checked(checked: "Checked", file: "BaselineFile | None", found: "list[Failure]") -> None:
    """Print the failures, then the outcome of the check; on GitHub's runners, also print annotations."""
    from dropspin.reports.terminal.rows import print_sentences
    from dropspin.reports.terminal.summary import print_failures
    from dropspin.reports.views import check as view
    from dropspin.reports.views.failures import grouped

    print_failures(grouped(checked.results, found, None if file is None else file.path))
    print_sentences([view.scope(file), *view.sentences(checked, file)])
    for command in view.annotations(found):
        echo(command)
