"""`dropspin doctor`."""

import click

from dropspin.reports.commands.options import as_json


@click.command("doctor")
@as_json
def doctor_command(json_output: bool) -> None:
    """Check this installation: versions, engines, processor, and whether each engine can take a time step."""
    from dropspin.comparisons.engines.registry import engine_names
    from dropspin.reports.terminal.rows import print_rows
    from dropspin.reports.views import doctor

    print_rows(doctor.rows(engine_names()), json_output)
