"""`dropspin tradeoff`."""

from typing import Any

import click

from dropspin.reports.commands.options import (
    POSITIVE,
    WholeNumbers,
    as_json,
    engines_option,
    jobs_option,
    output_option,
    scenes_argument,
    seconds_option,
)


@click.command("tradeoff")
@scenes_argument
@engines_option()
@click.option("--metric", metavar="METRIC", help="The metric of the error. [default: the scene's leading metric]")
@click.option(
    "--within",
    multiple=True,
    type=POSITIVE,
    default=(1e-3,),
    metavar="TOLERANCE",
    help="The largest error allowed; repeat for more.",
)
@seconds_option(
    "--budget",
    default=10.0,
    of="for measuring the errors of one engine at all its time steps; once it is used up, no smaller time step is tried.",
)
@click.option(
    "--worlds",
    type=WholeNumbers(),
    default="256",
    metavar="N[,N]...",
    help="Numbers of worlds in the batches to time, for engines that step many worlds together, such as 1,256,4096.",
)
@jobs_option("engines whose errors are measured")
@output_option("out/tradeoff", "for the table and the plots")
@as_json
def tradeoff_command(scenes: tuple[str, ...], within: tuple[float, ...], output: str, json_output: bool, **options: Any) -> int:
    """Measure what accuracy costs: the error and the computing time at many time steps, and the cheapest configuration within a tolerance.

    The default is the scene spin-asymmetric, with engines and methods that give different results for it.

    Exit code: 0 whatever is measured, also if an engine diverges at some time steps, 2 bad input, or no engine can be
    compared, 3 an engine crashed or exceeded a limit, its batches broke down, or one that was named is missing.
    """
    from dropspin.comparisons.engines.base import EngineBroken
    from dropspin.comparisons.tradeoff.study import NotCompared, tradeoff
    from dropspin.reports.stories.study import exit_code
    from dropspin.reports.stories.tradeoff import TradeOffs
    from dropspin.reports.study_files import written_study
    from dropspin.reports.terminal.progress import share_bar
    from dropspin.scenarios import load

    loaded, results = list(map(load, scenes or ("spin-asymmetric",))), []
    verdicts: list[str | None] = []
    named = bool(options["engines"])
    with written_study(output, json_output) as keep:
        for scene in loaded:
            try:
                with share_bar(scene.name) as on_progress:
                    results.append(tradeoff(scene, **options, within=max(within), on_progress=on_progress))
                verdicts += [ladder.verdict for ladder in results[-1].ladders]
            except NotCompared as error:
                verdicts += [ladder.verdict for ladder in error.ladders]
                if scene is loaded[-1] and not results:
                    raise EngineBroken(str(error)) if exit_code(verdicts, named=named) else error from None
                click.echo(f"left out: {error}", err=True)
        keep(TradeOffs(scenes=results, within=within))
    return exit_code(verdicts, named=named)
