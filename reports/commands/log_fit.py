"""`dropspin log fit`."""

from typing import Any

import click

from dropspin.reports.commands.options import FIVE_MINUTES, as_json, engines_option, jobs_option, output_option, time_limit_option


@click.command("fit")
@click.argument("recording", metavar="RECORDING")
@engines_option()
@click.option(
    "--frames", type=click.IntRange(2, 100), default=8, metavar="N", help="Number of frames of each toss to use after its flight."
)
@time_limit_option("an engine may use for one grid of parameters", FIVE_MINUTES)
@jobs_option("engines")
@output_option("out/log-fit", "for the tables and the report")
@as_json
def log_fit_command(recording: str, output: str, json_output: bool, **options: Any) -> None:
    """Find the friction and restitution with which engines continue the tosses of a recording, with 95 % intervals.

    RECORDING is a header, a TOML file that names the body, the units and the file of data; or toss-cube, 100 measured tosses of a cube.
    Give corrected.toml, which dropspin log check writes. The default engines are mujoco and wang[contact=sequential,law=coulomb].
    """
    from dropspin.comparisons.logs.check import log_check
    from dropspin.comparisons.logs.continued_tosses import flights_in
    from dropspin.comparisons.logs.fit import log_fit
    from dropspin.reports.stories.log_fit import FittedLog
    from dropspin.reports.study_files import written_study
    from dropspin.reports.terminal.progress import share_bar

    with written_study(output, json_output, has_report=True) as keep, share_bar(recording) as on_progress:
        flights = flights_in(recording)
        fit = log_fit(flights, **options, on_progress=on_progress)
        keep(FittedLog(recording=recording, findings=list(log_check(flights).findings), fit=fit))
