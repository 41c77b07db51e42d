"""`dropspin tradeoff`."""

import json
import os

import click

from dropspin.reports.commands.interrupts import stop_if_interrupted
from dropspin.reports.commands.options import POSITIVE, WholeNumbers, as_json, jobs_option, seconds_option
from dropspin.reports.terminal.safe import echo


@click.command("tradeoff")
@click.argument("scenes", nargs=-1, metavar="[SCENE]...")
@click.option("-e", "--engine", "engines", multiple=True, metavar="ENGINE", help="An engine, with options; repeat for more.")
@click.option("--metric", metavar="METRIC", help="The metric of the error. [default: the scene's leading metric]")
@click.option(
    "--within",
    multiple=True,
    type=POSITIVE,
    default=(1e-3,),
    show_default=True,
    metavar="TOLERANCE",
    help="The largest error allowed; repeat for more.",
)
@seconds_option(
    "--budget", 10.0, "for measuring the errors of one engine at all its time steps; once it is used up, no smaller time step is tried."
)
@click.option(
    "--worlds",
    type=WholeNumbers(),
    default="256",
    show_default=True,
    metavar="N[,N]...",
    help="Numbers of worlds in the batches to time, for engines that step many worlds together, such as 1,256,4096.",
)
@jobs_option("engines whose errors are measured")
@click.option("-o", "--output", default="out/tradeoff", show_default=True, metavar="DIR", help="Folder for the table and the plots.")
@as_json
def tradeoff_command(
    scenes: tuple[str, ...],
    engines: tuple[str, ...],
    metric: str | None,
    within: tuple[float, ...],
    budget: float,
    worlds: tuple[int, ...],
    jobs: int | None,
    output: str,
    json_output: bool,
) -> None:
    """Measure what accuracy costs: the error and the computing time at many time steps, and the cheapest configuration within a tolerance.

    The default is the scene spin-asymmetric, with engines and methods that give different results for it.
    """
    from dropspin.comparisons.results.folder import study_folder
    from dropspin.comparisons.tradeoff.study import tradeoff
    from dropspin.reports.study_files import write_tradeoff
    from dropspin.reports.terminal.progress import share_bar
    from dropspin.reports.terminal.rows import print_rows, print_sentences
    from dropspin.reports.views import tradeoff as view
    from dropspin.scenarios import load

    loaded, found = [load(name) for name in scenes or ("spin-asymmetric",)], []
    with study_folder(output) as folder:
        for scene in loaded:
            with share_bar(scene.name) as progress:

                def on_progress(what: str, share: float) -> None:
                    stop_if_interrupted()
                    progress(what, share)

                found.append(tradeoff(scene, engines, metric, budget=budget, worlds=worlds, on_progress=on_progress, jobs=jobs))
        write_tradeoff(found, within, folder)
    if json_output:
        echo(json.dumps([row for one in found for row in view.rows(one)], indent=1))
        return
    for one in found:
        print_rows(view.pareto_front_rows(one), json_output=False, left_out_first=view.left_out_first(one))
        print_sentences(view.sentences(one, within))
    echo(f"Written: {os.path.join(output, 'tradeoff.md')}")
