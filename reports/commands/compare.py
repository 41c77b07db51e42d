"""`dropspin compare`."""

from pathlib import Path

import click

from dropspin.reports.commands.options import as_json, summary_option, write_text


@click.command("compare")
@click.argument("old", metavar="OLD")
@click.argument("new", metavar="NEW")
@summary_option
@as_json
def compare_command(old: str, new: str, summary: str | None, json_output: bool) -> int:
    """Show which results changed between two runs, and the cause: the engine, its settings, dropspin, or the machine.

    OLD and NEW are folders that dropspin run -o wrote, on one machine or on two. For a folder named history, write ./history, because
    history is a command. Scenes and engines of one run alone, scenes that differ, changes of speed, and whether motions are equal bit
    for bit in both runs do not affect the exit code.

    Exit code: 0 nothing is worse, 1 a result is worse, moved or gone, 2 bad input.
    """
    from dropspin.comparisons.regressions.comparing import compare
    from dropspin.comparisons.results.store import load_results
    from dropspin.reports.markdown import markdown
    from dropspin.reports.stories import compare as story
    from dropspin.reports.terminal.rows import print_json_or

    later = load_results(Path(new))
    changes = compare(load_results(Path(old)), later)
    document = story.document(changes, later)
    if summary is not None:
        write_text(summary, markdown(document, level=2), append=True)
    print_json_or(json_output, story.as_data(changes), document)
    return int(bool(len(changes.regressions)))
