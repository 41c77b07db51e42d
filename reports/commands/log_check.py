"""`dropspin log check`."""

import click

from dropspin.reports.commands.options import as_json, output_option
from dropspin.reports.terminal.safe_output import echo


@click.command("check")
@click.argument("recording", metavar="RECORDING")
@output_option("out/log-check", "for the tables and the report")
@as_json
def log_check_command(recording: str, output: str, json_output: bool) -> int:
    """Check a recording of tosses by their free flight.

    RECORDING is a header, a TOML file that names the body, the units and the file of data; or toss-cube, 100 measured tosses of a cube.
    Gravity, scale, drag, inertia and centre of mass are estimated from the flights alone, each with a 95 % interval. Wrong units, axes,
    quaternion orders and frame rates are listed with remedies. In the output folder, corrected.toml is the header with every remedy that
    is the only one for its finding. If the header has a floor, the folder scenes/ has a scene for each toss and one for all tosses, which
    begin at the end of the flights; dropspin run compares engines with them. They are not written if the header has the body below the
    floor there.

    Exit code: 0 no finding, 1 a finding, 2 bad input.
    """
    from dropspin.comparisons.logs.check import log_check
    from dropspin.comparisons.logs.continued_tosses import measured_scene
    from dropspin.reports.stories.log_check import CheckedLog
    from dropspin.reports.study_files import write_scenes, write_toml, written_study
    from dropspin.reports.terminal.progress import share_bar
    from dropspin.scenarios import DropspinError

    with written_study(output, json_output, has_report=True) as keep:
        with share_bar(recording) as on_progress:
            check = log_check(recording, on_progress)
        folder = keep(CheckedLog(recording=recording, values=[*check.values], findings=[*check.findings], tosses=[*check.tosses]))
        write_toml(check.corrected.model_dump(mode="json", exclude_none=True), folder / "corrected.toml")
        can_continue = check.reads_the_columns_right and check.flights.log.header.floor is not None
        try:
            scene = measured_scene(check.flights) if can_continue else None
        except DropspinError as error:  # the findings say what is wrong with the header
            echo(f"scenes/ is not written: {error}", err=True)
        else:
            if scene is not None:
                write_scenes(scene, folder / "scenes")
    return int(bool(check.findings))
