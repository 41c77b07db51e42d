"""`dropspin list`."""

import click

from dropspin.reports.commands.options import as_json


@click.command("list")
@click.argument("what", type=click.Choice(["scenes", "engines", "metrics"]), default="scenes")
@as_json
def list_command(what: str, json_output: bool) -> None:
    """List the scenes, the engines or the metrics."""
    from dropspin.reports.terminal.rows import print_rows
    from dropspin.reports.views import listings

    rows = {"scenes": listings.scene_rows, "engines": listings.engine_rows, "metrics": listings.metric_rows}[what]
    print_rows(rows(), json_output, listings.LEFT_OUT_FIRST[what])
