"""`dropspin reproduce`."""

from typing import Any

import click

from dropspin.reports.commands.options import as_json, output_option, time_limit_option


@click.command("reproduce")
@click.argument("names", nargs=-1, metavar="[SOURCE]... [DIR]")
@time_limit_option("an engine may use for one run")
@output_option("out/reproduce", "for the tables")
@as_json
def reproduce_command(names: tuple[str, ...], output: str, json_output: bool, **options: Any) -> int:
    """Compare published results with those of engines and exact solutions in dropspin.

    Each SOURCE has a citation, a scene, and the digits that it prints. Its scene is run, and the values are compared digit by digit; for
    values that cannot be reproduced, the reason is printed. The default is all sources but acosta-cube, which needs DIR, a folder of
    measured tosses.

    Exit code 1: a value that should be reproduced differs. 3: an engine broke down, or an engine of a SOURCE that was named is missing.
    """
    from dropspin.comparisons.published.sources import source_names, sources
    from dropspin.comparisons.published.study import reproduce
    from dropspin.reports.stories.reproduce import Reproduction, exit_code
    from dropspin.reports.study_files import written_study
    from dropspin.reports.terminal.progress import share_bar

    data = None
    if len(names) > 1 and names[-1] not in source_names() and any(source.data for source in sources(names[:-1])):
        names, data = names[:-1], names[-1]
    chosen = sources(names)
    with written_study(output, json_output) as keep, share_bar("reproduce") as on_progress:
        results = reproduce(names, data=data, **options, on_progress=on_progress)
        keep(Reproduction(sources=chosen, results=results))
    return exit_code(results, named=bool(names))
