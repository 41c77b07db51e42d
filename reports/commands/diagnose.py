"""`dropspin diagnose`."""

import os
from typing import Any

import click

from dropspin.reports.commands.options import POSITIVE, as_json, engines_option, jobs_option, output_option, time_limit_option


@click.command("diagnose")
@click.argument("file", metavar="FILE")
@engines_option("mujoco or pybullet, without options: settings are those of the file. [default: those that can read the file]")
@click.option("--body", "bodies", multiple=True, metavar="NAME", help="A body to diagnose; repeat for more. [default: all free bodies]")
@click.option("--on", metavar="GEOM", help="The plane or box to land on. [default: the first that the body collides with]")
@click.option("--loose", is_flag=True, help="Also diagnose bodies on joints, each cut loose from its joint.")
@click.option("--density", default=1000.0, type=POSITIVE, metavar="KG/M3", help="Density of a mesh.")
@click.option("--scale", default=1.0, type=POSITIVE, metavar="METRES", help="Length of a unit of a mesh's coordinates: 0.001 for mm.")
@click.option("--restitution", type=click.FloatRange(0.0, 1.0), metavar="E", help="Target for the coefficient of restitution.")
@click.option("--friction", type=POSITIVE, metavar="MU", help="Target for the coefficient of friction.")
@time_limit_option("an engine may use for one body")
@jobs_option("bodies to diagnose")
@output_option("out/diagnosis", "for the tables and the report")
@as_json
def diagnose_command(file: str, output: str, json_output: bool, **options: Any) -> int:
    """Measure what the settings of your model do: FILE is an MJCF or URDF file, or a mesh (.obj, .stl).

    Each free body is simulated alone, with the file's own settings, above the surface that it lands on. Its fall, spin, impact, rest,
    slide and roll are compared with exact solutions with these settings and without them. A remedy marked "tried" was simulated.

    Exit code: 0 no impossible inertia and no missed target, 1 otherwise, 2 bad input, 3 a body without a result.
    """
    from dropspin.comparisons.diagnosis.study import diagnose
    from dropspin.reports.stories.diagnose import Diagnosed
    from dropspin.reports.study_files import written_study
    from dropspin.reports.terminal.progress import share_bar

    with written_study(output, json_output, has_report=True) as keep, share_bar(os.path.basename(file)) as on_progress:
        diagnosis = diagnose(file, **options, on_progress=on_progress)
        keep(Diagnosed(diagnosis=diagnosis))
    return 3 if diagnosis.broke_down else int(diagnosis.failed)
