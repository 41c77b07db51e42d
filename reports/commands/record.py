"""`dropspin record`."""

import os
from typing import TYPE_CHECKING, Any

import click

from dropspin.reports.commands.options import engines_option, jobs_option, output_option, time_limit_option, write_text
from dropspin.reports.terminal.interrupts import stop_if_interrupted
from dropspin.reports.terminal.safe_output import echo

if TYPE_CHECKING:
    from dropspin.comparisons.running.process_limits import ResourceLimits


@click.command("record")
@engines_option("An engine of the record; repeat for more.")
@click.option("--release", "chosen", multiple=True, metavar="VERSION", help="A release; repeat for more. [default: all on the index]")
@click.option("--merge", "sent", multiple=True, metavar="PATH", help="Add a record that somebody sent, a folder or a file; run nothing.")
@click.option("--pre", is_flag=True, help="Measure the newest prerelease and the release before it, and write what changed between them.")
@output_option("record", "of the record")
@jobs_option("releases")
@click.option("--scheduler", metavar="ADDRESS", help="Measure on the workers of a Dask cluster, such as tcp://host:8786.")
@time_limit_option("an engine may use for one simulation")
def record_command(sent: tuple[str, ...], output: str, jobs: int | None, resources: "ResourceLimits", *, pre: bool, **options: Any) -> int:
    """Measure every release of each engine, in an environment of its own, and keep the results.

    pip, or npm, lists the releases and installs each into a temporary environment, in which the same scenes are run with the same
    settings. A release that the record has already is not run again. With --pre, DIR/prereleases.md lists, for each engine, what changed
    between its newest release and a later prerelease, or between the two releases that --release names.

    Exit code: 0 done, 1 with --pre, a result changed or a release has no results, 2 bad input.
    """
    from dropspin.comparisons.record.findings import in_order
    from dropspin.comparisons.record.plan import load_plan
    from dropspin.comparisons.record.store import Record
    from dropspin.comparisons.record.study import record
    from dropspin.comparisons.running.parallel import as_jobs
    from dropspin.reports.markdown import markdown
    from dropspin.reports.stories.prereleases import prereleases
    from dropspin.reports.terminal.rows import print_document
    from dropspin.scenarios.text import counted

    if sent and (options["engines"] or options["chosen"] or pre):
        raise click.UsageError("--merge runs nothing; leave out --engine, --release and --pre.")
    folder = Record(output)
    if sent:
        echo(f"{counted(len(folder.merge(sent)), 'file')} added to {output}, as unsigned")
        return 0

    def on_done(release: str, left: int) -> None:
        stop_if_interrupted()
        echo(f"{release} ({left} left)", err=True)

    try:
        plan, seconds = load_plan(), resources.processor_time
        asked = record(folder, plan, **options, pre=pre, jobs=as_jobs(jobs), time_limit=seconds, on_done=on_done)
    except KeyboardInterrupt:
        raise KeyboardInterrupt("finished releases are kept; the same command continues") from None
    echo(f"Record: {output}")
    if not pre:
        return 0
    document, has_changes = prereleases({engine: in_order(folder, engine, names) for engine, names in asked.items()})
    write_text(os.path.join(output, "prereleases.md"), markdown(document, level=2))
    print_document(document)
    return int(has_changes)
