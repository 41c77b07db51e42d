"""`dropspin history`."""

import json
import os

import click

from reports.verbs.options import as_json


@click.command()
@click.argument("runs", metavar="RUN...", nargs=-1, required=True)
@click.option("-o", "--output", default="out/history", show_default=True, metavar="DIR", help="Folder for the table and the plots.")
@as_json
def history(runs: tuple[str, ...], output: str, json_output: bool) -> None:
    """Follow each figure over runs, commits and versions of engines, and find the runs in which some moved.

    RUN is a folder that dropspin run -o wrote, or a folder of such; runs are put in the order of when they were started.
    """
    from comparisons.regressions.history import history as followed
    from reports import history as told
    from reports.terminal import status
    from reports.written import folder_made

    with folder_made(output) as folder:
        with status("reading the runs"):
            found = followed(told.load_runs(told.find_runs(runs)))
        with status("drawing"):
            told.write(found, folder)
    if json_output:
        click.echo(json.dumps(told.rows(found), indent=1, ensure_ascii=False))
        return
    for line in [*told.listed(found), *told.sentences(found)]:
        click.echo(line)
    click.echo(f"Written: {os.path.join(output, 'history.md')}")
