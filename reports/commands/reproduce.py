"""`dropspin reproduce`."""

import json
import os

import click

from dropspin.reports.commands.interrupts import stop_if_interrupted
from dropspin.reports.commands.options import as_json, time_limit_option
from dropspin.reports.terminal.safe import echo


@click.command("reproduce")
@click.argument("names", nargs=-1, metavar="[SOURCE]...")
@time_limit_option(60.0, "an engine may use for one run")
@click.option("-o", "--output", default="out/reproduce", show_default=True, metavar="DIR", help="Folder for the tables.")
@as_json
def reproduce_command(names: tuple[str, ...], time_limit: float, output: str, json_output: bool) -> int:
    """Compare published results with what engines and exact solutions give here.

    Each SOURCE has a citation, a scene, and the digits that it prints. Its scene is run, and the values are compared digit by digit; for
    values that cannot be reproduced, the reason is printed. The default is all sources.

    Exit code 1: a value differs that is claimed to be reproducible.
    """
    from dropspin.comparisons.published.sources import sources
    from dropspin.comparisons.published.study import reproduce
    from dropspin.comparisons.results.folder import study_folder
    from dropspin.comparisons.running.processes import ResourceLimits
    from dropspin.reports.study_files import write_reproduced
    from dropspin.reports.terminal.progress import share_bar
    from dropspin.reports.terminal.rows import print_rows, print_sentences
    from dropspin.reports.views import reproduce as view

    chosen = sources(names)
    with study_folder(output) as folder:
        with share_bar("reproduce") as progress:

            def on_progress(what: str, share: float) -> None:
                stop_if_interrupted()
                progress(what, share)

            results = reproduce(names, on_progress=on_progress, resources=ResourceLimits(processor_time=time_limit))
        write_reproduced(chosen, results, folder)
    if json_output:
        echo(json.dumps(view.rows(results), indent=1, ensure_ascii=False))
        return view.exit_code(results)
    for source in chosen:
        own = [one for one in results if one.source == source.name]
        print_sentences(view.heading(source))
        print_rows(view.table(own), json_output=False)
        print_sentences([*view.notes(source, own), ""])
    print_rows(view.summary(results), json_output=False)
    print_sentences([view.LEGEND, view.verdict(results)])
    echo(f"Written: {os.path.join(output, 'reproduce.md')}")
    return view.exit_code(results)
