"""`dropspin record`."""

from typing import TYPE_CHECKING, Any

import click

from dropspin.reports.commands.options import jobs_option, output_option, time_limit_option
from dropspin.reports.terminal.interrupts import stop_if_interrupted
from dropspin.reports.terminal.safe import echo

if TYPE_CHECKING:
    from dropspin.comparisons.running.processes import ResourceLimits


@click.command("record")
@click.option("-e", "--engine", "engines", multiple=True, metavar="ENGINE", help="An engine of the record; repeat for more.")
@click.option("--release", "chosen", multiple=True, metavar="VERSION", help="A release; repeat for more. [default: all on the index]")
@click.option("--merge", "sent", multiple=True, metavar="PATH", help="Add a record that somebody sent, a folder or a file; run nothing.")
@output_option("record", "of the record")
@jobs_option("releases")
@click.option("--scheduler", metavar="ADDRESS", help="Measure on the workers of a Dask cluster, such as tcp://host:8786.")
@time_limit_option(60.0, "an engine may use for one simulation")
def record_command(sent: tuple[str, ...], output: str, jobs: int | None, resources: "ResourceLimits", **options: Any) -> None:
    """Measure every release of each engine, in an environment of its own, and keep the results.

    pip, or npm, lists the releases and installs each into a temporary environment, in which the same scenes are run with the same
    settings. A release that the record has already is not run again.
    """
    from dropspin.comparisons.record.plan import load_plan
    from dropspin.comparisons.record.store import Record
    from dropspin.comparisons.record.study import record
    from dropspin.comparisons.running.parallel import as_jobs
    from dropspin.scenarios.text import counted

    if sent and (options["engines"] or options["chosen"]):
        raise click.UsageError("--merge runs nothing; leave out --engine and --release.")
    folder = Record(output)
    if sent:
        echo(f"{counted(len(folder.merge(sent)), 'file')} added to {output}, as unsigned")
        return

    def on_done(release: str, left: int) -> None:
        stop_if_interrupted()
        echo(f"{release} ({left} left)", err=True)

    try:
        record(folder, load_plan(), **options, jobs=as_jobs(jobs), time_limit=resources.processor_time, on_done=on_done)
    except KeyboardInterrupt:
        raise KeyboardInterrupt("finished releases are kept; the same command continues") from None
    echo(f"Record: {output}")
