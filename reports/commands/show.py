"""`dropspin show`."""

import click

from reports.commands.options import as_json


@click.command("show")
@click.argument("scene")
@click.option("-e", "--engine", "engine_name", metavar="ENGINE", help="Show what this engine builds and with which settings.")
@click.option("--dt", default=1e-3, show_default=True, type=float, metavar="SECONDS", help="The time step the settings are for.")
@as_json
def show_command(scene: str, engine_name: str | None, dt: float, json_output: bool) -> None:
    """Show a scene: what is modelled, its exact solution, what it expects; or an engine's settings for it."""
    from reports.terminal.rows import print_rows
    from reports.views import show
    from scenarios import load

    loaded = load(scene)
    print_rows(show.scene_rows(loaded) if engine_name is None else show.built_rows(loaded, engine_name, dt), json_output, ["why"])
