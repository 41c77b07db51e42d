"""`dropspin replay`."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import click

from dropspin.reports.commands.options import POSITIVE, scenes_argument
from dropspin.reports.terminal.safe_output import echo


@click.command("replay")
@click.argument("run", metavar="RUN")
@scenes_argument
@click.option("--dt", type=POSITIVE, metavar="SECONDS", help="One of the run's time steps. [default: the coarsest]")
@click.option("-o", "--output", metavar="FILE", help="The page to write. [default: replay.html in the run's folder]")
@click.option("--gif", metavar="FILE", help="Write an animated GIF of one scene instead.")
@click.option("--mp4", metavar="FILE", help="Write an MP4 video of one scene instead.")
@click.option("--speed", default=0.25, type=POSITIVE, help="Speed of the GIF or the video: 1 is real time.")
@click.option("--open/--no-open", "opens", default=True, show_default=False, help="Show the page in a browser. [default: --open]")
def replay_command(
    run: str, scenes: tuple[str, ...], dt: float | None, output: str | None, gif: str | None, mp4: str | None, speed: float, opens: bool
) -> None:
    """Show the motions of a run in 3D: engines overlaid or side by side, with the exact solution or recording dashed.

    On the page you can play the motions at any speed, go to any time, rotate the view, and see contacts and impulses. The page is one
    file and needs no network.
    """
    from dropspin.comparisons.results.complete_folders import written_whole
    from dropspin.comparisons.results.store import load_results
    from dropspin.reports.html.replay import replay_page
    from dropspin.reports.plots.run_charts import time_charts
    from dropspin.reports.replay import replay_of
    from dropspin.reports.replay.clip import write_clip
    from dropspin.reports.terminal.progress import share_bar
    from dropspin.scenarios import DropspinError

    films = {f"--{ending}": (clip, f".{ending}") for ending, clip in (("gif", gif), ("mp4", mp4)) if clip is not None}
    for option, (clip, ending) in films.items():
        if Path(clip).suffix.lower() != ending:
            raise click.UsageError(f"{option} {clip}: the file name must end in {ending}.")
        if output is not None:
            raise click.UsageError(f"-o {output} names the page, but with {option} no page is written; leave -o out.")
    file = Path(run) / "replay.html" if output is None else Path(output)
    if (ending := file.suffix.lower()) in (".gif", ".mp4"):
        raise click.UsageError(f"-o {output} names the page, which is HTML; give --{ending[1:]} {output} for a film.")
    if output is None and file.is_symlink():  # the run may be somebody else's, and the link lead to any file
        raise DropspinError(f"{file}: is a link; delete it, or choose a file with -o.")
    results = load_results(Path(run))
    replays = (replay_of(results, name, dt) for name in scenes or results.scenes)
    shown = [replay for replay in replays if replay is not None]
    if not shown:
        raise DropspinError(f"{run}: no engine completed a time step in these scenes; report.html has the reasons.")
    for option, (clip, _) in films.items():
        if len(shown) > 1:
            raise click.UsageError(f"{option} shows one scene; name it: {', '.join(replay.scene.name for replay in shown)}.")
        with share_bar(clip) as on_progress:
            write_clip(shown[0], clip, speed, partial(on_progress, ""))
        echo(f"Written: {clip}")
    if films:
        return
    charts = []
    for replay in shown:
        at_this_step = {key: motion for key, motion in results.trajectories.items() if key[2] == replay.dt}
        charts.append(time_charts(replace(results, trajectories=at_this_step), replay.scene.name))
    with written_whole(file) as unfinished:
        unfinished.write_text(replay_page(shown, charts), encoding="utf-8")
    echo(f"Written: {file}")
    if opens:
        click.launch(str(file))
