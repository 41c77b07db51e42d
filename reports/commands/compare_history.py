"""`dropspin compare history`."""

import os
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dropspin.reports.commands.options import as_json, output_option

if TYPE_CHECKING:
    from dropspin.comparisons.results.results import Results


@click.command("history")
@click.argument("runs", metavar="RUN...", nargs=-1, required=True)
@output_option("out/history", "for the table and the plots")
@as_json
def compare_history_command(runs: tuple[str, ...], output: str, json_output: bool) -> None:
    """Follow each result over runs, commits and versions of engines, and find the runs in which results changed.

    RUN is a folder that dropspin run -o wrote, or a folder of such folders. Runs are sorted by start time.
    """
    from dropspin.comparisons.regressions.history import history
    from dropspin.comparisons.results.complete_folders import study_folder
    from dropspin.reports.stories.history import rows
    from dropspin.reports.study_files import write_history
    from dropspin.reports.terminal.progress import status
    from dropspin.reports.terminal.rows import print_json_or

    with study_folder(output) as folder:
        with status("reading the runs"):
            results = history(_load_runs(runs))
        with status("drawing"):
            document = write_history(results, folder)
    print_json_or(json_output, rows(results), document, os.path.join(output, "history.md"))


def _load_runs(places: tuple[str, ...]) -> "dict[str, Results]":
    """The results of all runs in the given folders, by the name of the run's folder if it is unique, else by its path.

    Raises:
        DropspinError: A given folder is neither a run nor a folder of runs.
    """
    from dropspin.comparisons.results.complete_folders import is_unfinished
    from dropspin.comparisons.results.store import load_results
    from dropspin.scenarios import DropspinError
    from dropspin.scenarios.text import printable

    short: dict[Path, str] = {}
    for place in places:
        path = Path(place)
        here = [path] if (path / "run.json").is_file() else sorted(file.parent for file in path.glob("*/run.json"))
        tables = [table for table in sorted(path.glob("*/results.parquet")) if not is_unfinished(table.parent.name)]
        if lost := [table.parent for table in tables if not (table.parent / "run.json").is_file()]:
            raise DropspinError(f"{lost[0]}: has results, and no run.json; it is not a whole run. Remove it, or run it again.")
        if not here:
            raise DropspinError(
                f"{place}: neither a run nor a folder of runs; give folders that dropspin run -o wrote, or a folder of them."
            )
        short |= {folder: printable(folder.resolve().name) for folder in here}
    alike = Counter(short.values())
    names = {path: name if alike[name] == 1 else printable(str(path)) for path, name in short.items()}
    return {name: load_results(path, arrays=False) for path, name in names.items()}
