"""`dropspin accept`."""

import click

from dropspin.reports.commands.options import BASELINE, as_json


@click.command("accept")
@click.argument("runs", metavar="RUN...", nargs=-1, required=True)
@click.option("--reason", required=True, metavar="TEXT", help="The reason why these results are accepted; it is written to the file.")
@click.option(
    "--baseline",
    default=BASELINE,
    metavar="FILE",
    help="The baseline file; it is created if it does not exist. dropspin check has the same default.",
)
@click.option(
    "--known-failures",
    is_flag=True,
    help="Accept failing checks as known failures, which fail only if their results get worse.",
)
@as_json
def accept_command(runs: tuple[str, ...], reason: str, baseline: str, known_failures: bool, json_output: bool) -> None:
    """Accept a run's results as the new baseline.

    RUN is the folder that dropspin run -o wrote. Accepted results stay as they are in the file if they changed by no more than their
    tolerance, or if RUN does not cover them.
    """
    import datetime
    import os
    from pathlib import Path

    from dropspin.comparisons.regressions.baseline import Baseline, load_baseline, write_baseline
    from dropspin.comparisons.regressions.checking import accept, redefined
    from dropspin.comparisons.results.complete_folders import one_at_a_time
    from dropspin.comparisons.results.store import load_results
    from dropspin.reports.document import Document, Sentences
    from dropspin.reports.stories.check import accepted_sentences
    from dropspin.reports.terminal.rows import print_json_or
    from dropspin.scenarios import DropspinError
    from dropspin.scenarios.text import counted

    if not reason.strip():
        raise click.UsageError("--reason is empty; give the reason why these results are accepted.")
    with one_at_a_time(baseline):  # two commands that accept into one file lose no result
        new = load_baseline(baseline) if os.path.exists(baseline) else Baseline()
        changes, sentences = [], []
        for run in runs:
            results = load_results(Path(run), arrays=False)
            other = redefined(results, new)
            new, accepted = accept(results, new, reason.strip(), datetime.date.today(), known_failures=known_failures)
            changes += accepted.to_dict("records")
            sentences += accepted_sentences(results, accepted, known_failures, other)
        if new.results.empty:
            raise DropspinError(
                f"{', '.join(runs)}: there is nothing to accept, because no engine was measured; {baseline} is not written."
            )
        write_baseline(new, baseline)
    written = f"{baseline}, {counted(len(new.results), 'accepted result')}. Review the difference and commit it."
    print_json_or(json_output, changes, Document("Accepted results", [Sentences(sentences)]), written)
