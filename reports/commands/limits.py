"""`dropspin limits`."""

from typing import Any

import click

from dropspin.reports.commands.options import (
    POSITIVE,
    as_json,
    engines_option,
    jobs_option,
    output_option,
    scenes_argument,
    time_limit_option,
)


@click.command("limits")
@scenes_argument
@engines_option()
@click.option(
    "--axis",
    "axes",
    multiple=True,
    metavar="AXIS",
    help="The quantity to vary, such as spin; repeat for more. [default: every axis that the scene has]",
)
@click.option("--dt", default=5e-3, type=float, metavar="SECONDS", help="The time step, for every axis except step.")
@click.option(
    "--within",
    default=0.1,
    type=POSITIVE,
    metavar="TOLERANCE",
    help="The largest error with which an engine counts as sound: a ratio, or an angle in radians.",
)
@time_limit_option("an engine may use for one tested value")
@jobs_option("axes to scan")
@output_option("out/limits", "for the tables and the figures")
@as_json
def limits_command(scenes: tuple[str, ...], axes: tuple[str, ...], output: str, json_output: bool, **options: Any) -> None:
    """Find where engines break down as time step, spin, height, inertia ratio, mass, restitution, duration, size or scale varies.

    The default is five scenes (two spins, a ball, a box, a block), with engines and methods that give different results for them. The
    default study takes some minutes.
    """
    from dropspin.comparisons.limits.axes import AXES
    from dropspin.comparisons.limits.study import SCENES, find_limits
    from dropspin.reports.stories.limits import Limits
    from dropspin.reports.study_files import written_study
    from dropspin.reports.terminal.progress import share_bar
    from dropspin.scenarios import load

    loaded = list(map(load, scenes or SCENES))
    if len({scene.name for scene in loaded}) < len(loaded):
        raise click.UsageError("a scene is given twice, or two files have the same name; give each scene once, or rename a file.")
    lacking = {scene.name: [name for name in axes if name in AXES and not AXES[name].applies(scene)] for scene in loaded}
    if len(loaded) == 1 or all(len(names) == len(axes) for names in lacking.values()):
        lacking = {name: [] for name in lacking}  # the error of find_limits lists the axes of a scene
    results = []
    with written_study(output, json_output) as keep:
        for scene in loaded:
            own = [name for name in axes if name not in lacking[scene.name]]
            if own or not axes:
                with share_bar(scene.name) as on_progress:
                    results.append(find_limits(scene, axes=own, **options, on_progress=on_progress))
        keep(Limits(scenes=results, left_out={name: f"it has no axis {' or '.join(names)}" for name, names in lacking.items() if names}))
