"""`dropspin show`."""

import click

from dropspin.reports.commands.options import as_json, step_option


@click.command("show")
@click.argument("scene")
@click.option("-e", "--engine", "engine_name", metavar="ENGINE", help="Show the model that this engine builds, and its settings.")
@step_option(" for which the settings are computed")
@as_json
def show_command(scene: str, engine_name: str | None, dt: float, json_output: bool) -> None:
    """Show a scene: what it models, its exact solution and its expectations; or the settings of an engine for the scene.

    SCENE may also be an engine, to show its options and the settings of its library that can be given as options, or a mesh file (.obj,
    .stl), to show its volume, mass properties, hull and defects.
    """
    from dropspin.comparisons.engines.registry import engine_names
    from dropspin.reports.document import Document, Table
    from dropspin.reports.stories import show
    from dropspin.reports.stories.mesh import mesh_rows
    from dropspin.reports.terminal.rows import print_json_or
    from dropspin.scenarios import load

    if scene.lower().endswith((".obj", ".stl")):
        name, rows = scene, mesh_rows(scene)
    elif engine_name is None and (":" in scene or scene.partition("[")[0] in engine_names()):
        name, rows = scene, show.setting_rows(scene)
    else:
        loaded = load(scene)
        name, rows = loaded.name, show.scene_rows(loaded) if engine_name is None else show.built_rows(loaded, engine_name, dt)
    print_json_or(json_output, rows, Document(name, [Table(rows, ["why", "unit", "allowed"])]))
