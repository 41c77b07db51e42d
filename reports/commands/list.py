"""`dropspin list`."""

import click

from dropspin.reports.commands.options import as_json


@click.command("list")
@click.argument("kind", type=click.Choice(["scenes", "engines", "metrics"]), default="scenes")
@as_json
def list_command(kind: str, json_output: bool) -> None:
    """List the scenes, the engines or the metrics."""
    from dropspin.reports.document import Document, Sentences, Table
    from dropspin.reports.stories import listings
    from dropspin.reports.terminal.rows import print_json_or

    rows = {"scenes": listings.scene_rows, "engines": listings.engine_rows, "metrics": listings.metric_rows}[kind]()
    table = Table([{name: cell for name, cell in row.items() if name != "options"} for row in rows], listings.LEFT_OUT_FIRST[kind])
    hint = [Sentences(["dropspin show ENGINE lists the options and settings of an engine."])] if kind == "engines" else []
    print_json_or(json_output, rows, Document(kind, [table, *hint]))
