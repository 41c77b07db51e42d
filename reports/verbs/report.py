"""`dropspin report`."""

from pathlib import Path

import click


@click.command()
@click.argument("run", metavar="RUN")
@click.option("--add", "studies", multiple=True, metavar="FOLDER", help="Add what dropspin tradeoff or limits found; repeat for more.")
@click.option("--png", is_flag=True, help="Write the plots as PNG too.")
def report(run: str, studies: tuple[str, ...], png: bool) -> None:
    """Write the reports of a run again: with what other studies found, with plots as PNG, or after dropspin itself has changed."""
    from comparisons.store import restore
    from reports.folder import write
    from reports.section import read_section

    sections = [read_section(folder) for folder in studies]
    click.echo(f"Report: {write(restore(Path(run)), run, sections, png)}")
