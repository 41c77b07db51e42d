"""`dropspin limits`."""

import json
import os

import click

from dropspin.reports.commands.interrupts import stop_if_interrupted
from dropspin.reports.commands.options import POSITIVE, as_json, jobs_option, time_limit_option
from dropspin.reports.terminal.safe import echo


@click.command("limits")
@click.argument("scenes", nargs=-1, metavar="[SCENE]...")
@click.option("-e", "--engine", "engines", multiple=True, metavar="ENGINE", help="An engine, with options; repeat for more.")
@click.option(
    "--axis",
    "axes",
    multiple=True,
    metavar="AXIS",
    help="The quantity to vary, such as spin; repeat for more. [default: every axis that the scene has]",
)
@click.option("--dt", default=5e-3, show_default=True, type=float, metavar="SECONDS", help="The time step, for every axis except step.")
@click.option(
    "--within",
    default=0.1,
    show_default=True,
    type=POSITIVE,
    metavar="TOLERANCE",
    help="The largest error that counts as sound: a ratio, or an angle in radians.",
)
@time_limit_option(60.0, "an engine may use for one tested value")
@jobs_option("axes to scan")
@click.option("-o", "--output", default="out/limits", show_default=True, metavar="DIR", help="Folder for the tables and the figures.")
@as_json
def limits_command(
    scenes: tuple[str, ...],
    engines: tuple[str, ...],
    axes: tuple[str, ...],
    dt: float,
    within: float,
    time_limit: float,
    jobs: int | None,
    output: str,
    json_output: bool,
) -> None:
    """Find where engines break down as time step, spin, height, inertia ratio, mass, restitution, duration, size or scale varies.

    The default is five scenes (two spins, a ball, a box, a block), with engines and methods that give different results for them; this
    takes some minutes.
    """
    from dropspin.comparisons.results.folder import study_folder
    from dropspin.comparisons.robustness.axes import AXES
    from dropspin.comparisons.robustness.study import SCENES, find_limits
    from dropspin.comparisons.running.processes import ResourceLimits
    from dropspin.reports.study_files import write_limits
    from dropspin.reports.terminal.progress import share_bar
    from dropspin.reports.terminal.rows import print_rows, print_sentences
    from dropspin.reports.views import limits as view
    from dropspin.scenarios import load

    loaded = [load(name) for name in scenes or SCENES]
    if len({scene.name for scene in loaded}) < len(loaded):
        raise click.UsageError("two scenes have the same name, which is that of the file; rename one of the files.")
    having = [scene for scene in loaded if all(AXES[name].applies(scene) for name in {*axes} & AXES.keys())]
    found = []
    with study_folder(output) as folder:
        for scene in having or loaded[:1]:  # the error of find_limits lists the axes of a scene
            with share_bar(scene.name) as progress:

                def on_progress(what: str, share: float) -> None:
                    stop_if_interrupted()
                    progress(what, share)

                resources = ResourceLimits(processor_time=time_limit)
                study = find_limits(scene, engines, axes, dt=dt, within=within, on_progress=on_progress, resources=resources, jobs=jobs)
                found.append(study)
        write_limits(found, folder)
    if json_output:
        echo(json.dumps([row for one in found for row in view.rows(one)], indent=1))
        return
    for one in found:
        print_sentences([view.nominal(one)])
        if rows := view.range_rows(one):
            print_rows(rows, json_output=False)
        print_sentences(view.sentences(one))
    if rows := view.step_rows(found):
        print_rows(rows, json_output=False)
        print_sentences([view.ACCURATE_AND_STABLE])
    echo(f"Written: {os.path.join(output, 'limits.md')}")
