"""`dropspin check`."""

import os
from pathlib import Path

import click

from dropspin.reports.commands.options import BASELINE, as_json, summary_option, write_text


@click.command("check")
@click.argument("run", metavar="RUN")
@click.option("--baseline", metavar="FILE", help=f"The baseline. [default: {BASELINE}, which dropspin accept writes, if it exists]")
@click.option("--no-baseline", is_flag=True, help=f"Check the expectations of the scenes only, even if there is a {BASELINE}.")
@click.option("--complete", is_flag=True, help="End with exit code 2, not 0, if the run does not cover every accepted result.")
@click.option("--junit", metavar="FILE", help="Write a test case for every check as JUnit XML, the format that CI servers read.")
@summary_option
@as_json
def check_command(
    run: str, baseline: str | None, no_baseline: bool, complete: bool, junit: str | None, summary: str | None, json_output: bool
) -> int:
    """Check a run against the expectations of its scenes, and against the accepted results of a baseline.

    RUN is the folder that dropspin run -o wrote. The output says which baseline was used.

    Exit code: 0 nothing failed, 1 a check failed or an accepted result is worse, 2 bad input, 3 an engine broke down or is missing.
    """
    from dropspin.comparisons.regressions.ablation import with_explaining_settings
    from dropspin.comparisons.regressions.baseline import load_baseline
    from dropspin.comparisons.regressions.checking import check
    from dropspin.comparisons.results.store import load_results
    from dropspin.reports.junit import junit_xml
    from dropspin.reports.markdown import markdown
    from dropspin.reports.stories import check as story
    from dropspin.reports.stories.failures import failures
    from dropspin.reports.terminal.rows import print_json_or
    from dropspin.scenarios import DropspinError

    if baseline is not None and no_baseline:
        raise click.UsageError("--baseline names a baseline and --no-baseline leaves it out; give only one of them.")
    if no_baseline and complete:
        raise click.UsageError("--complete compares with a baseline and --no-baseline leaves it out; give only one of them.")
    if baseline is None and not no_baseline and os.path.lexists(BASELINE):
        baseline = BASELINE
    results = load_results(Path(run), arrays=False)
    accepted = None if baseline is None else load_baseline(baseline)
    if complete and accepted is None:
        raise click.UsageError(f"--complete needs a baseline, and there is no {BASELINE}; give --baseline.")
    try:
        checked = with_explaining_settings(check(results, accepted), accepted, imports=False)
    except DropspinError as error:
        raise DropspinError(f"{baseline}: {error} With --no-baseline, only the expectations of the scenes are checked.") from None
    document = story.document(checked, failures(checked.results, baseline), run, baseline)
    print_json_or(json_output, checked.results.table.to_dict("records"), document)
    code = checked.results.exit_code()
    if complete and len(checked.not_run) and not code:  # without files, which would say that all checks pass
        raise DropspinError(f"{baseline}: {story.not_covered(checked)}. Run them, or leave out --complete.")
    if junit is not None:
        write_text(junit, junit_xml(checked.results, baseline).decode())
    if summary is not None:
        write_text(summary, markdown(document, level=2), append=True)
    return code
