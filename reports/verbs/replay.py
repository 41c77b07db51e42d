"""`dropspin replay`."""

from dataclasses import replace
from pathlib import Path

import click

from reports.interrupts import stop_if_interrupted
from reports.verbs.options import write_text


@click.command()
@click.argument("run", metavar="RUN")
@click.argument("scenes", nargs=-1, metavar="[SCENE]...")
@click.option(
    "--dt", type=click.FloatRange(min=0.0, min_open=True), metavar="SECONDS", help="Which of the run's steps. [default: the coarsest]"
)
@click.option("-o", "--output", metavar="FILE", help="The page to write. [default: replay.html in the run's folder]")
@click.option("--gif", metavar="FILE", help="Write a clip of one scene instead.")
@click.option("--mp4", metavar="FILE", help="Write a video of one scene instead; needs imageio-ffmpeg.")
@click.option(
    "--speed", default=0.25, show_default=True, type=click.FloatRange(min=0.0, min_open=True), help="Of a clip: 1 is as fast as it happens."
)
@click.option("--open/--no-open", "opens", default=True, help="Show the page in a browser. [default: --open]")
def replay(
    run: str, scenes: tuple[str, ...], dt: float | None, output: str | None, gif: str | None, mp4: str | None, speed: float, opens: bool
) -> None:
    """The motion in 3D: a run's scenes, engines overlaid or side by side, the truth as a ghost.

    Play, scrub, slow down, turn the view; contacts and impulses are shown where the floor acts. The page is one file and needs no network.
    """
    from comparisons.store import restore
    from reports.plots import time_figure
    from reports.replay import replay_of, replay_page, write_clip
    from reports.svg import svg
    from reports.terminal import share_bar
    from scenarios import DropspinError

    clips = {"--mp4": mp4, "--gif": gif}
    for option, file in clips.items():
        if file is not None and Path(file).suffix.lower() != f".{option[2:]}":
            raise click.UsageError(f"{option} {file}: give the file the ending .{option[2:]}.")
    asked = [file for file in clips.values() if file is not None]
    if asked and output is not None:
        raise click.UsageError(f"-o {output} is for the page, which is not written beside a clip; leave it out.")
    results = restore(Path(run))
    found = [replay_of(results, name, dt) for name in scenes or results.scenes]
    shown = [one for one in found if one is not None]
    if not shown:
        raise DropspinError(f"{run}: no engine has moved in these scenes; see report.html for why.")
    if asked and len(shown) > 1:
        raise click.UsageError(f"a clip shows one scene; name it: {', '.join(one.scene.name for one in shown)}.")
    for file in asked:
        with share_bar(file) as progress:

            def drawn(share: float) -> None:
                stop_if_interrupted()
                progress("", share)

            write_clip(shown[0], file, speed, drawn)
        click.echo(f"Written: {file}")
    if asked:
        return
    plots: dict[str, str] = {}
    for one in shown:
        at_this_step = {key: motion for key, motion in results.trajectories.items() if key[2] == one.dt}
        drawing = time_figure(replace(results, trajectories=at_this_step), one.scene.name)
        plots[one.scene.name] = svg(drawing, f"s{len(plots):02d}-time")
    file = str(Path(run) / "replay.html") if output is None else output
    write_text(file, replay_page(shown, plots))
    click.echo(f"Written: {file}")
    if opens:
        click.launch(file)
