"""`dropspin log fit`."""

from typing import Any

import click

from dropspin.reports.commands.options import as_json, engines_option, jobs_option, time_limit_option


@click.command("fit")
@click.argument("recording", metavar="RECORDING")
@engines_option
@click.option("--frames", type=click.IntRange(2, 100), default=8, metavar="N", help="Frames of each toss to use after its flight.")
@time_limit_option(300.0, "an engine may use for one grid of parameters")
@jobs_option("engines")
@as_json
def log_fit_command(recording: str, json_output: bool, **options: Any) -> None:
    """Find the friction and restitution with which engines continue the tosses of a recording, with 95 % intervals.

    RECORDING is a header, a TOML file that names the body, the units and the file of data; or toss-cube, 100 measured tosses of a cube.
    Correct what dropspin log check finds first. The default engines are mujoco and wang[contact=sequential,law=coulomb].
    """
    from dropspin.comparisons.logs.fit import log_fit
    from dropspin.reports.stories.log_fit import as_data, document
    from dropspin.reports.terminal.progress import share_bar
    from dropspin.reports.terminal.rows import print_json_or

    with share_bar(recording) as on_progress:
        fit = log_fit(recording, **options, on_progress=on_progress)
    print_json_or(json_output, as_data(fit), document(fit))
