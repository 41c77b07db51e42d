"""What a history of runs says: rows, sentences, files."""

from collections import Counter
from pathlib import Path
from typing import Any

from comparisons.regressions.history import History, Move
from comparisons.store import restore
from reports.html import page
from reports.numbers import subject, written
from reports.plots import history_figure
from reports.written import write_table
from scenarios import DropspinError

AT_MOST = 6
"""Figures that are told of one move; the table in the file has them all."""


def find_runs(places: tuple[str, ...]) -> dict[str, Path]:
    """The folders of runs at some places: each is one, or holds some.

    Raises:
        DropspinError: At one of them there is none.
    """
    found: dict[str, Path] = {}
    for place in places:
        path = Path(place)
        here = [path] if (path / "run.json").is_file() else sorted(file.parent for file in path.glob("*/run.json"))
        if not here:
            raise DropspinError(f"{place}: no run, and no folder of runs; give folders that dropspin run -o wrote, or a folder of such.")
        found |= {str(one): one for one in here}
    return found


def load_runs(found: dict[str, Path]) -> dict[str, Any]:
    """Their figures, by names that are as short as they can be told apart."""
    short = {place: path.resolve().name for place, path in found.items()}
    alike = Counter(short.values())
    return {short[place] if alike[short[place]] == 1 else place: restore(path, arrays=False) for place, path in found.items()}


def rows(found: History) -> list[dict[str, str]]:
    """Every run in which figures moved, and those that moved most."""
    return [row for move in found.moves for row in _of_move(found, move)]


def listed(found: History) -> list[str]:
    """The same, a line each."""
    return [
        f"{row['run']} · {row['engine']} · {row['scene']}: "
        f"{row['figure']} at {row['step']} from {row['before']} to {row['now']}, {row['change']}"
        for row in rows(found)
    ]


def sentences(found: History) -> list[str]:
    """What each move is put down to."""
    told = [
        f"{move.engine}: {len(move.figures):,} figures moved in {found.names[move.run]}, after {found.names[move.before]}. "
        f"{move.blame.said[0].upper()}{move.blame.said[1:]}."
        for move in found.moves
    ]
    scenes = found.figures["scene"].nunique()
    return told or [f"No figure has moved in {len(found.names)} runs of {scenes} scenes."]


def write(found: History, folder: Path) -> None:
    """`history.csv` and `history.json` with every figure of every run, `history.md`, and a plot for each scene."""
    figures = found.figures.drop(columns="verdict").assign(run=[found.names[number] for number in found.figures["run"]])
    table = figures.merge(found.stamps, on="run")
    known = table.astype(object).where(table.notna(), None)  # JSON knows no NaN
    records = [{str(key): value for key, value in row.items()} for row in known.to_dict("records")]
    write_table(folder, "history", [str(name) for name in table], records)
    scenes = list(dict.fromkeys(found.figures["scene"]))
    for scene in scenes:
        history_figure(found, scene).savefig(folder / f"{scene}.svg")
    told = page("history.md", runs=len(found.names), sentences=sentences(found), scenes=scenes)
    (folder / "history.md").write_text(told, encoding="utf-8")


def _of_move(found: History, move: Move) -> list[dict[str, str]]:
    return [
        {
            "run": found.names[move.run],
            "engine": move.engine,
            "scene": row["scene"],
            "figure": subject(row["metric"], row["kind"]),
            "step": "→ 0" if "," in row["steps"] else f"{1e3 * float(row['steps']):g} ms",
            "before": written(row["before"]),
            "now": written(row["value"]),
            "change": row["change"],
        }
        for row in move.figures.head(AT_MOST).to_dict("records")
    ]
