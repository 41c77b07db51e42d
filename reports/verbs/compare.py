"""`dropspin compare`."""

import json
from pathlib import Path

import click

from reports.verbs.options import as_json, summary_option, write_text


def _share(context: click.Context, parameter: click.Parameter, text: str | None) -> float | None:
    if text is None:
        return None
    try:
        share = float(text.strip().removesuffix("%")) / 100.0
    except ValueError:
        share = float("nan")
    if not 0.0 < share < float("inf"):
        raise click.BadParameter(f"{text!r} is no share of time; give a percentage above 0, such as 20%.", context, parameter)
    return share


@click.command()
@click.argument("old", metavar="OLD")
@click.argument("new", metavar="NEW")
@click.option(
    "--fail-speed", metavar="PERCENT", callback=_share, help="Fail engines that are slower by more, beside the others of their run."
)
@summary_option
@as_json
def compare(old: str, new: str, fail_speed: float | None, summary: str | None, json_output: bool) -> int:
    """What changed between two runs, and what it is put down to: the engine, its settings, dropspin, or the machine.

    OLD and NEW are folders that dropspin run -o wrote. Accuracy is judged; speed is told, and judged only with --fail-speed.

    Exit code: 0 nothing is worse, 1 a figure is worse, moved or gone, 2 bad input.
    """
    from comparisons.regressions.comparing import compare as compared
    from comparisons.store import restore
    from reports import regressions

    changes = compared(restore(Path(old), arrays=False), restore(Path(new), arrays=False))
    if fail_speed is not None and not changes.speed:
        raise click.UsageError("--fail-speed: takes two engines that ran the same scenes in both runs; speed is told beside another's.")
    if summary is not None:
        write_text(summary, regressions.summary(changes, fail_speed), append=True)
    if json_output:
        click.echo(json.dumps(regressions.as_data(changes), indent=1, ensure_ascii=False, allow_nan=False))
    else:
        for line in [*regressions.listed(changes), *regressions.sentences(changes, fail_speed)]:
            click.echo(line)
    slower = [] if fail_speed is None else changes.slower(fail_speed)
    return int(bool(len(changes.regressions)) or bool(slower))
