"""`dropspin limits`."""

import json
import os

import click

from reports.interrupts import stop_if_interrupted
from reports.verbs.options import as_json, time_limit_option


@click.command()
@click.argument("scenes", nargs=-1, metavar="[SCENE]...")
@click.option("-e", "--engine", "engines", multiple=True, metavar="ENGINE", help="An engine, with options; repeat for more.")
@click.option(
    "--axis", "axes", multiple=True, metavar="AXIS", help="What to vary, such as spin; repeat for more. [default: all a scene has]"
)
@click.option(
    "--pair", "pairs", multiple=True, metavar="AXIS,AXIS", help="Two to vary together, such as spin,inertia-ratio; repeat for more."
)
@click.option("--dt", default=5e-3, show_default=True, type=float, metavar="SECONDS", help="The step, where it is not what is varied.")
@click.option(
    "--within",
    default=0.1,
    show_default=True,
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="TOLERANCE",
    help="How large an error may be to count as sound: a ratio, or an angle in radians.",
)
@time_limit_option(60.0, "an engine may take at one point")
@click.option("-o", "--output", default="out/limits", show_default=True, metavar="DIR", help="Folder for the tables and the maps.")
@as_json
def limits(
    scenes: tuple[str, ...],
    engines: tuple[str, ...],
    axes: tuple[str, ...],
    pairs: tuple[str, ...],
    dt: float,
    within: float,
    time_limit: float,
    output: str,
    json_output: bool,
) -> None:
    """Where engines break: steps, spins, heights, inertias, masses, restitutions, durations and sizes at their extremes.

    Without arguments: a spin about an axis, a tumble, a ball, a box and a block, the methods that they let differ; some minutes.
    """
    from comparisons import Limits
    from comparisons.extremes import AXES, SCENES
    from comparisons.extremes import limits as extremes
    from reports import extremes as told
    from reports.terminal import print_rows, share_bar
    from reports.written import folder_made
    from scenarios import load

    planes = [_pair(pair) for pair in pairs]
    loaded = [load(name) for name in scenes or SCENES]
    if len({scene.name for scene in loaded}) < len(loaded):
        raise click.UsageError("two scenes have the same name; a scene's name is its file's, rename one.")
    named = {*axes, *(axis for plane in planes for axis in plane)} & AXES.keys()
    having = [scene for scene in loaded if all(AXES[name].applies(scene) for name in named)]
    found = []
    with folder_made(output) as folder:
        for scene in having or loaded[:1]:  # which says what it has not got
            with share_bar(scene.name) as progress:

                def advance(what: str, share: float) -> None:
                    stop_if_interrupted()
                    progress(what, share)

                chosen = planes if pairs else None
                found.append(extremes(scene, engines, axes, chosen, dt, within, advance, Limits(processor_time=time_limit)))
        told.write(found, folder)
    if json_output:
        click.echo(json.dumps([row for one in found for row in told.rows(one)], indent=1))
        return
    surprising = told.sentences(found)
    for number, sentence in enumerate(surprising[: told.AS_SURPRISING], start=1):
        click.echo(f"{number}. {sentence}")
    if len(surprising) > told.AS_SURPRISING:
        click.echo(f"and {len(surprising) - told.AS_SURPRISING} more")
    if steps := told.step_rows(found):
        print_rows(steps, json_output=False)
    click.echo(f"Written: {os.path.join(output, 'limits.md')}")


def _pair(text: str) -> tuple[str, str]:
    names = [name.strip() for name in text.split(",")]
    if len(names) != 2:
        raise click.UsageError(f"--pair: got {text!r}; name two axes, such as spin,inertia-ratio.")
    return names[0], names[1]
