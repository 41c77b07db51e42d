"""`dropspin tradeoff`."""

import json
import os

import click

from reports.interrupts import stop_if_interrupted
from reports.verbs.options import as_json


@click.command()
@click.argument("scenes", nargs=-1, metavar="[SCENE]...")
@click.option("-e", "--engine", "engines", multiple=True, metavar="ENGINE", help="An engine, with options; repeat for more.")
@click.option("--metric", metavar="METRIC", help="What the error is of. [default: what the scene is about]")
@click.option(
    "--within",
    multiple=True,
    type=click.FloatRange(min=0.0, min_open=True),
    default=(1e-3,),
    show_default=True,
    metavar="TOLERANCE",
    help="How large the error may be; repeat for more.",
)
@click.option("-o", "--output", default="out/tradeoff", show_default=True, metavar="DIR", help="Folder for the table and the plots.")
@as_json
def tradeoff(
    scenes: tuple[str, ...], engines: tuple[str, ...], metric: str | None, within: tuple[float, ...], output: str, json_output: bool
) -> None:
    """What accuracy costs: error against time over a ladder of steps, and the cheapest engine, method and step within a tolerance.

    Without arguments: a spin, the methods that it lets differ.
    """
    from comparisons.tradeoff import tradeoff as traded
    from reports import trade
    from reports.terminal import print_rows, share_bar
    from reports.written import folder_made
    from scenarios import load

    found = []
    with folder_made(output) as folder:
        for name in scenes or ("spin-asymmetric",):
            with share_bar(name) as progress:

                def told(what: str, share: float) -> None:
                    stop_if_interrupted()
                    progress(what, share)

                found.append(traded(load(name), engines, metric, told))
            if not json_output:
                print_rows(trade.front_rows(found[-1]), json_output=False)
                for sentence in trade.sentences(found[-1], within):
                    click.echo(sentence)
        trade.write(found, within, folder)
    if json_output:
        click.echo(json.dumps([row for one in found for row in trade.rows(one)], indent=1))
    else:
        click.echo(f"Written: {os.path.join(output, 'tradeoff.md')}")
