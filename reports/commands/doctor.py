"""`dropspin doctor`."""

import click

from dropspin.reports.commands.options import as_json


@click.command("doctor")
@as_json
def doctor_command(json_output: bool) -> None:
    """Check this installation: versions, engines, processor, and whether each engine can take a time step."""
    from dropspin.comparisons.engines.registry import engine_names
    from dropspin.reports.document import Document, Table
    from dropspin.reports.stories import doctor
    from dropspin.reports.terminal.rows import print_json_or

    rows = doctor.rows(engine_names())
    print_json_or(json_output, rows, Document("This installation", [Table(rows)]))
