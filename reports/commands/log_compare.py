"""`dropspin log compare`."""

from typing import Any

import click

from dropspin.reports.commands.options import FIVE_MINUTES, as_json, engines_option, jobs_option, output_option, time_limit_option


@click.command("compare")
@click.argument("recording", metavar="RECORDING")
@engines_option()
@click.option(
    "--fit", "fits", is_flag=True, help="First fit friction and restitution for each engine, to find the part of the error that they cause."
)
@time_limit_option("an engine may use for all tosses", FIVE_MINUTES)
@jobs_option("engines")
@output_option("out/log-compare", "for the tables and the report")
@as_json
def log_compare_command(recording: str, fits: bool, output: str, json_output: bool, **options: Any) -> None:
    """Compare engines with the tosses of a recording, each from the state at the end of its flight.

    RECORDING is a header, a TOML file that names the body, the units and the file of data; or toss-cube, 100 measured tosses of a cube.
    Give corrected.toml, which dropspin log check writes. The default engines are mujoco and wang[contact=sequential,law=coulomb]
    with calibrated settings, and mujoco and pybullet with default settings.
    """
    from dropspin.comparisons.logs.check import log_check
    from dropspin.comparisons.logs.compare import ENGINES, log_compare
    from dropspin.comparisons.logs.continued_tosses import flights_in
    from dropspin.comparisons.logs.fit import log_fit
    from dropspin.reports.stories.log_compare import ComparedLog
    from dropspin.reports.study_files import written_study
    from dropspin.reports.terminal.progress import share_bar

    options["engines"] = options["engines"] or ENGINES
    with written_study(output, json_output, has_report=True) as keep, share_bar(recording) as on_progress:
        flights = flights_in(recording)
        fit = log_fit(flights, **options, on_progress=on_progress) if fits else None
        comparison = log_compare(flights, fit=fit, **options, on_progress=on_progress)
        keep(ComparedLog(recording=recording, findings=list(log_check(flights).findings), comparison=comparison))
