"""The output of `dropspin compare history`: the runs in which results changed."""

from dropspin.comparisons.regressions.history import History, Move
from dropspin.reports.views.numbers import formatted, subject
from dropspin.scenarios.text import counted

MOST_RESULTS = 6
"""Largest number of results listed for one run; the table in the file has all of them."""


def rows(found: History) -> list[dict[str, str]]:
    """For each run in which results changed, the results that changed most."""
    return [row for move in found.moves for row in _of_move(found, move)]


def listed(found: History) -> list[str]:
    """The results that changed most, one line for each."""
    return [
        f"{row['run']} · {row['engine']} · {row['scene']}: "
        f"{row['result']} at {row['step']} from {row['before']} to {row['now']}, {row['change']}"
        for row in rows(found)
    ]


def sentences(found: History) -> list[str]:
    """The cause to which the changes in each run are attributed."""
    moved = [
        f"{move.engine}: {counted(len(move.results), 'result')} changed in {found.names[move.run]}, after {found.names[move.before]}. "
        f"{move.attribution.message[0].upper()}{move.attribution.message[1:]}."
        for move in found.moves
    ]
    scenes = found.results["scene"].nunique()
    return moved or [f"No result changed in {counted(len(found.names), 'run')} of {counted(scenes, 'scene')}."]


def _of_move(found: History, move: Move) -> list[dict[str, str]]:
    return [
        {
            "run": found.names[move.run],
            "engine": move.engine,
            "scene": row["scene"],
            "result": subject(row["metric"], row["kind"]),
            "step": "→ 0" if "," in row["steps"] else f"{1e3 * float(row['steps']):g} ms",
            "before": formatted(row["before"]),
            "now": formatted(row["value"]),
            "change": row["change"],
        }
        for row in move.results.head(MOST_RESULTS).to_dict("records")
    ]
