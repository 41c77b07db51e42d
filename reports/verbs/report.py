"""`dropspin report`."""

import shutil
from pathlib import Path

import click


@click.command()
@click.argument("run", metavar="RUN")
@click.option("--add", "studies", multiple=True, metavar="FOLDER", help="Add what dropspin tradeoff or limits found; repeat for more.")
@click.option("--png", is_flag=True, help="Write the plots as PNG too.")
def report(run: str, studies: tuple[str, ...], png: bool) -> None:
    """Write the reports of a run again: with what other studies found, with plots as PNG, or after dropspin itself has changed.

    Studies and PNGs are those that are asked for this time. A replay in the folder stays.
    """
    from comparisons.store import restore
    from reports.folder import fill, run_folder
    from reports.section import read_section

    sections = [read_section(folder) for folder in dict.fromkeys(studies)]
    results = restore(Path(run))
    with run_folder(run) as unfinished:
        fill(results, unfinished, sections, png)
        if (Path(run) / "replay.html").exists():
            shutil.copy2(Path(run) / "replay.html", unfinished)
    click.echo(f"Report: {Path(run) / 'report.html'}")
