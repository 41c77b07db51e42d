"""`dropspin report`."""

import shutil
from dataclasses import replace
from pathlib import Path

import click

from dropspin.reports.commands.options import within_option
from dropspin.reports.terminal.safe_output import echo


@click.command("report")
@click.argument("run", metavar="RUN")
@click.option(
    "--add",
    "studies",
    multiple=True,
    metavar="FOLDER",
    help="Add a study: the folder that dropspin tradeoff, limits, symmetries or reproduce wrote; repeat for more.",
)
@click.option(
    "--plots",
    multiple=True,
    type=click.Choice(["svg", "png", "pdf", "csv"]),
    help="Also write the plots as files of this format, or their data as CSV; repeat for more.",
)
@within_option
def report_command(run: str, studies: tuple[str, ...], plots: tuple[str, ...], within: float | None) -> None:
    """Write the report of a run again: to add studies, to write plots as files, or after an update of dropspin.

    The new report has only the studies and plots given in this call. A replay in the folder is kept.
    """
    from dropspin.comparisons.results.store import load_results
    from dropspin.reports.run_folder import fill, run_folder
    from dropspin.reports.study_files import read_study

    sections = [read_study(folder) for folder in dict.fromkeys(studies)]
    results = load_results(Path(run))
    if within is not None:
        asked = {**results.provenance["asked"], "within": within}
        results = replace(results, provenance={**results.provenance, "asked": asked})
    with run_folder(run) as unfinished:
        fill(results, unfinished, sections, plots)
        replay = Path(run) / "replay.html"
        if replay.is_file() and not replay.is_symlink():  # the run may be somebody else's, and the link lead to a private file
            shutil.copy2(replay, unfinished)
    echo(f"Report: {Path(run) / 'report.html'}")
