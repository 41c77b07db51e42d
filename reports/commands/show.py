"""`dropspin show`."""

import click

from dropspin.reports.commands.options import as_json


@click.command("show")
@click.argument("scene")
@click.option("-e", "--engine", "engine_name", metavar="ENGINE", help="Show the model that this engine builds, and its settings.")
@click.option(
    "--dt", default=1e-3, show_default=True, type=float, metavar="SECONDS", help="The time step for which the settings are computed."
)
@as_json
def show_command(scene: str, engine_name: str | None, dt: float, json_output: bool) -> None:
    """Show a scene: what it models, its exact solution and its expectations; or the settings of an engine for the scene."""
    from dropspin.reports.terminal.rows import print_rows
    from dropspin.reports.views import show
    from dropspin.scenarios import load

    loaded = load(scene)
    print_rows(show.scene_rows(loaded) if engine_name is None else show.built_rows(loaded, engine_name, dt), json_output, ["why"])
