"""`dropspin check`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from reports.commands.options import as_json, baseline_option, summary_option, write_text
from reports.terminal.safe import echo

if TYPE_CHECKING:
    from comparisons.regressions.checking import Checked
    from reports.views.check import BaselineFile
    from reports.views.failures import Failure


@click.command("check")
@click.argument("run", metavar="RUN")
@baseline_option
@click.option("--junit", metavar="FILE", help="Write a test case for every check as JUnit XML, the format that CI servers read.")
@summary_option
@as_json
def check_command(run: str, baseline: str | None, junit: str | None, summary: str | None, json_output: bool) -> int:
    """Check a run: compare it with the expectations of its scenes, and with the accepted results of a baseline.

    RUN is the folder that dropspin run -o wrote.

    Exit code: 0 nothing failed, 1 a check failed or an accepted result is worse, 2 bad input, 3 an engine broke down or is missing.
    """
    from comparisons.regressions.baseline import load_baseline
    from comparisons.regressions.checking import check
    from comparisons.results.store import load_results
    from reports.junit import junit_xml
    from reports.markdown import check_markdown
    from reports.terminal.rows import json_rows
    from reports.views import check as view
    from reports.views.failures import failures

    results = load_results(Path(run), arrays=False)
    file = None if baseline is None else view.BaselineFile(load_baseline(baseline), baseline, run)
    checked = check(results, None if file is None else file.baseline)
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
    from reports.terminal.rows import print_sentences
    from reports.terminal.summary import print_failures
    from reports.views import check as view
    from reports.views.failures import grouped

    print_failures(grouped(checked.results, found, None if file is None else file.path))
    print_sentences(view.sentences(checked, file))
    for command in view.annotations(found):
        echo(command)
