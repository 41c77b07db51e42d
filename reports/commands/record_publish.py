"""`dropspin record publish`."""

import os
from pathlib import Path

import click

from dropspin.reports.commands.options import output_option
from dropspin.reports.terminal.safe_output import echo


@click.command("publish")
@click.argument("record", default="record")
@output_option("out/site-record", "of the site")
def record_publish_command(record: str, output: str) -> None:
    """Write a record as a site: the results of each release of each engine, and what changed.

    RECORD is the folder that dropspin record wrote. The site needs no server and no network. If it is written into a folder of the
    documentation's site, it links to the documentation.
    """
    from dropspin.comparisons.record.findings import on_other_machines, others, read
    from dropspin.comparisons.results.complete_folders import replaced_folder
    from dropspin.reports.html.record import INDEX, Site, files_of_site

    releases = read(record)
    docs = "../" if (Path(output).resolve().parent / "problems.html").is_file() else ""
    with replaced_folder(output, files_of_site, "record publish") as folder:
        Site(releases, others(record, releases), docs).write(folder)
    for engine, names in on_other_machines(record, releases).items():
        echo(f"left out: {engine} {', '.join(names)}, measured on another machine than most releases of {engine}", err=True)
    echo(f"Site: {os.path.join(output, INDEX)}")
