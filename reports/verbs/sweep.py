"""`dropspin sweep`."""

import json

import click

from reports.interrupts import stop_if_interrupted
from reports.verbs.options import as_json, time_limit_option


@click.command()
@click.argument("spec", metavar="SPEC.toml")
@click.option(
    "-o",
    "--output",
    default="out/sweep",
    show_default=True,
    metavar="DIR",
    help="Folder for the table, or a URL of an object store.",
)
@click.option("--resume", is_flag=True, help="Go on with a sweep that was interrupted or killed: jobs that are there are not run again.")
@click.option("--scheduler", metavar="ADDRESS", help="Run on a Dask cluster, such as tcp://host:8786.")
@time_limit_option(60.0, "an engine may take for one job")
@as_json
def sweep(spec: str, output: str, resume: bool, scheduler: str | None, time_limit: float, json_output: bool) -> int:
    """Run every job of a grid or random sample over scenes, engines, options, steps and starts.

    Each job is one row of a table in Parquet parts. A sweep that is interrupted or killed keeps the parts that are written.

    Exit code: 0 all jobs were run, 2 bad input, 3 an engine broke down in a job or is missing.
    """
    from comparisons import Limits
    from comparisons.sweeps import count, load_sweep, run_sweep
    from reports.sweeps import exit_code, summary_rows, tallies, written_rows
    from reports.terminal import jobs_bar, print_rows

    asked = load_sweep(spec)
    try:
        with jobs_bar(asked.size) as progress:

            def told(jobs: int) -> None:
                stop_if_interrupted()
                progress(jobs)

            run_sweep(asked, output, resume=resume, scheduler=scheduler, limits=Limits(processor_time=time_limit), told=told)
        stop_if_interrupted()
        found = tallies(output)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{count(output):,} of {asked.size:,} jobs are kept, --resume goes on") from None
    if json_output:
        click.echo(json.dumps(summary_rows(found), indent=1, ensure_ascii=False))
    else:
        print_rows(written_rows(found), json_output=False)
        click.echo(f"Written: {output}, {asked.size:,} jobs; from Python: comparisons.sweeps.read({output!r})")
    return exit_code(found)
