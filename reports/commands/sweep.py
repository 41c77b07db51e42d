"""`dropspin sweep`."""

from typing import Any

import click

from dropspin.reports.commands.options import as_json, time_limit_option
from dropspin.reports.terminal.interrupts import stop_if_interrupted


@click.command("sweep")
@click.argument("spec", metavar="SPEC.toml")
@click.option("-o", "--output", default="out/sweep", metavar="DIR", help="Folder for the table, or a URL of an object store.")
@click.option("--resume", is_flag=True, help="Resume an interrupted sweep: jobs whose rows are already written are not run again.")
@click.option("--scheduler", metavar="ADDRESS", help="Run on a Dask cluster, such as tcp://host:8786.")
@time_limit_option("an engine may use for one job")
@as_json
def sweep_command(spec: str, output: str, json_output: bool, **options: Any) -> int:
    """Run every job of a grid or random sample over scenes, engines, options, time steps and initial states.

    The result of each job is one row of a table in Parquet files. An interrupted sweep keeps the files that were written.

    Exit code: 0 all jobs were run, 2 bad input, 3 an engine broke down in a job or is missing.
    """
    from dropspin.comparisons.sweeps.folder import count
    from dropspin.comparisons.sweeps.running import run_sweep
    from dropspin.comparisons.sweeps.spec import load_sweep
    from dropspin.reports.stories import sweep as view
    from dropspin.reports.stories.study import exit_code
    from dropspin.reports.terminal.progress import jobs_bar
    from dropspin.reports.terminal.rows import print_json_or
    from dropspin.scenarios.text import counted

    asked = load_sweep(spec)
    try:
        with jobs_bar(asked.size) as on_progress:
            run_sweep(asked, output, **options, on_progress=on_progress)
        stop_if_interrupted()
        rows = view.rows(output)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{count(output):,} of {asked.size:,} jobs are kept; --resume continues the sweep") from None
    written = f"{output}, {counted(asked.size, 'job')}; from Python: dropspin.read_sweep({output!r})"
    print_json_or(json_output, rows, view.document(rows), written)
    return exit_code(verdict for row in rows for verdict in row["verdicts"])
