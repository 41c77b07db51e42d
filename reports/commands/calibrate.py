"""`dropspin calibrate`."""

from typing import Any

import click

from dropspin.reports.commands.options import as_json
from dropspin.reports.terminal.interrupts import stop_if_interrupted
from dropspin.reports.terminal.safe_output import echo


@click.command("calibrate")
@click.option("-e", "--engine", "engine", default="mujoco", metavar="ENGINE", help="The engine, with options.")
@click.option("--restitution", type=click.FloatRange(0.0, 1.0), required=True, metavar="E", help="Coefficient of restitution.")
@click.option("--dt", type=float, required=True, metavar="SECONDS", help="The time step.")
@click.option("--friction", default="none", metavar="F", help="Friction: none, infinite or a Coulomb coefficient.")
@click.option("--shape", type=click.Choice(["ball", "box"]), default="ball", help="The shape of the falling body.")
@click.option("--as", "language", metavar="LANGUAGE", help="Print only the text to paste: python, mjcf or urdf.")
@as_json
def calibrate_command(friction: str, language: str | None, json_output: bool, **options: Any) -> None:
    """Print the settings that give a coefficient of restitution at a time step, ready to paste, with measured results.

    For MuJoCo, the settings make the contact a damper that acts for one time step or, with -e mujoco[spring_steps=20], a spring that acts
    for 20 time steps.
    """
    from dropspin.comparisons.calibration import calibrate
    from dropspin.reports.stories import calibrate as view
    from dropspin.reports.terminal.progress import status
    from dropspin.reports.terminal.rows import print_json_or
    from dropspin.scenarios import UnknownName

    if language is not None and json_output:
        raise click.UsageError("--as prints one text and --json prints all of them; give only one of these options.")
    with status(f"measuring {options['engine']}"):
        result = calibrate(**options, friction=view.friction(friction))
    stop_if_interrupted()
    if language is not None:
        if language not in result.programs:
            raise UnknownName(f"{result.engine}'s language", language, result.programs)
        echo(result.programs[language], nl=False)
        return
    print_json_or(json_output, view.as_data(result), view.document(result))
    for name, text in result.programs.items() if not json_output else ():
        echo(f"To paste, as {name}:\n\n{text}")
